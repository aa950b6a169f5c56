"""How long commands take to start, and a set of effects that was never simulated.

Of a command it is the best of several, for the start-up of a process is noisy; of a kernel, the processor's time.
"""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

TARGET_S = 0.3
TIMES = 7
COMPILED = """
import time
from sim.effect import find_effect, shipped_effects
from sim.kernel import {0}

for names in ([], *([each] for each in shipped_effects())):
    effects = [find_effect(each, "benchmark") for each in names]
    start_s = time.process_time()
    {0}(effects)
    print(time.process_time() - start_s)
"""


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
        compiled("with inertia", "kernel"),
        compiled("without inertia", "quasi_static_kernel"),
    ]


def compiled(form: str, name: str) -> str:
    """Return the line of a form's kernels, compiled on a machine that has none: the bare valve's, then the effects'."""
    with TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        words = [sys.executable, "-c", COMPILED.format(name)]
        said = subprocess.run(words, env=environment, capture_output=True, check=True, text=True).stdout
    first_s, *others_s = (float(each) for each in said.split())
    return (
        f"kernels {form}, in processor time: the first, with the laws, {first_s:.2f} s; "
        f"another effect {min(others_s):.2f} to {max(others_s):.2f} s, median {median(others_s):.2f} s"
    )


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
