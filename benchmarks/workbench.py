"""How long a person waits for the workbench: compare, preview and diagnosis of 60 s at 200 Hz, the whole library tried.

First, what all is made of: a free run of the bare valve, and how far it is from one in steps and to a tolerance a
hundredth of its own.

`python -m benchmarks.workbench [SEED]`. Libraries are loaded and kernels compiled beforehand: these once per machine,
about a minute for all.
"""

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import first_effects, shipped_effect
from workbench import compare, diagnose, fit
from workbench.blind.hiding import hide
from workbench.data.held_out import split
from workbench.data.record import Record
from workbench.model.free_run import FINE, Accuracy, FreeRun
from workbench.select.tangent_preview import preview

RUNS = 20
DURATION_S, PERIOD_S, SEED = 60.0, 0.005, 20001
TARGETS_S = {"compare": 3.0, "preview": 2.0, "diagnose": 60.0}


def report(seed: int = SEED) -> Iterator[str]:
    """Yield one line a target."""
    hidden = hide(seed, duration_s=DURATION_S, period_s=PERIOD_S)
    library = {name: shipped_effect(name, "library") for name in first_effects()}
    parts = split([hidden.fit], hidden.test)
    bare = fit(parts.train.recording, hidden.base, profile=False)
    preview(bare, parts, library)  # compiles what is not in the cache
    compare(hidden.fit, hidden.base)
    yield _free_runs(parts.train.record, bare.valve)
    yield f"{len(hidden.fit)} samples, {DURATION_S:g} s, seed {seed}"
    yield _line("compare", _seconds(lambda: compare(hidden.fit, hidden.base)))
    yield _line("preview", _seconds(lambda: preview(bare, parts, library)))
    yield _line("diagnose", _seconds(lambda: diagnose(hidden.fit, hidden.base, test=hidden.test)))


def _free_runs(record: Record, valve: ValveFile) -> str:
    composition = Composition.from_file(valve)
    exact = Accuracy(0.01 * FINE.steps, 0.01 * FINE.tolerance)
    fine, finest = (FreeRun(composition, record, accuracy=each) for each in (FINE, exact))
    off_m = fine.position_m(composition.theta) - finest.position_m(composition.theta)
    seconds = min(_seconds(lambda: fine.position_m(composition.theta)) for _ in range(RUNS))
    return f"free run {1e3 * seconds:.2f} ms, off by {1e6 * float(np.nanstd(off_m)):.3f} um rms"


def _seconds(does: Callable[[], object]) -> float:
    began_s = time.perf_counter()
    does()
    return time.perf_counter() - began_s


def _line(name: str, seconds: float) -> str:
    return f"{name:10}{seconds:7.2f} s, target {TARGETS_S[name]:g} s"


if __name__ == "__main__":
    for line in report(*map(int, sys.argv[1:2])):
        print(line, flush=True)
