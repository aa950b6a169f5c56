"""How long `positioner --help` takes: the best of several, for the start-up of a process is noisy."""

import subprocess
import sys
import time

TARGET_S = 0.3


def report() -> list[str]:
    """Return a line."""
    taken_s = []
    for _ in range(7):
        start_s = time.perf_counter()
        subprocess.run([sys.executable, "-m", "positioner.cli", "--help"], capture_output=True, check=True)
        taken_s.append(time.perf_counter() - start_s)
    bare_s = []
    for _ in range(7):
        start_s = time.perf_counter()
        subprocess.run([sys.executable, "-c", ""], check=True)
        bare_s.append(time.perf_counter() - start_s)
    return [
        f"positioner --help {min(taken_s):.3f} s (target below {TARGET_S} s), the interpreter alone {min(bare_s):.3f} s"
    ]


if __name__ == "__main__":
    print("\n".join(report()))
