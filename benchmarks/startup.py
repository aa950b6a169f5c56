"""How long commands take to start: the best of several, for the start-up of a process is noisy."""

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

TARGET_S = 0.3
TIMES = 7


def report() -> list[str]:
    """Return a line a command."""
    bare_s = best_s("-c", "")
    with TemporaryDirectory() as folder:
        pressure, response = Path(folder) / "pressure.csv", Path(folder) / "response.csv"
        pressure.write_text("time_s,command_pa\n0,0\n1,0\n")
        words = ["simulate", "seed", "--input", str(pressure), "-o", str(response)]
        simulated_s = best_s("-m", "positioner.cli", *words)
    numba_s = best_s("-c", "import numba")
    helped_s = best_s("-m", "positioner.cli", "--help")
    return [
        f"positioner --help {helped_s:.3f} s (target below {TARGET_S} s), the interpreter alone {bare_s:.3f} s",
        f"positioner simulate, two samples, kernel compiled before, {simulated_s:.3f} s; numba alone {numba_s:.3f} s",
    ]


def best_s(*words: str) -> float:
    """Return the least time that the interpreter takes with these words."""
    return min(taken_s(words) for _ in range(TIMES))


def taken_s(words: Sequence[str]) -> float:
    """Return the time of a process."""
    start_s = time.perf_counter()
    subprocess.run([sys.executable, *words], capture_output=True, check=True)
    return time.perf_counter() - start_s


if __name__ == "__main__":
    print("\n".join(report()))
