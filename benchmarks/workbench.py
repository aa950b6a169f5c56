"""How long a person waits for the workbench: compare, preview and diagnosis of 60 s, the whole library tried.

At 200 Hz and at 1 kHz; first what all is made of: a free run of the bare valve, and how far it is from one in steps and
to a tolerance a hundredth of its own.

`python -m benchmarks.workbench [SEED]`. Libraries are loaded and kernels compiled beforehand: these once per machine,
about a minute for all.
"""

import sys
import time
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import first_effects, shipped_effect
from workbench.blind.hiding import hide
from workbench.compare.comparison import compare
from workbench.data.held_out import split
from workbench.data.record import Record
from workbench.diagnosis.diagnosis import diagnose
from workbench.fit.fit_problem import problem
from workbench.fit.fitting import base_fit
from workbench.model.free_run import FINE, Accuracy, FreeRun
from workbench.select.tangent_preview import preview

RUNS = 20
DURATION_S, SEED = 60.0, 20001
TARGETS_S = {
    0.005: {"compare": 3.0, "preview": 2.0, "diagnose": 15.0},
    0.001: {"compare": 3.0, "preview": 2.0, "diagnose": 60.0},
}
"""By the period, s."""


def report(seed: int = SEED) -> Iterator[str]:
    """Yield one line a target."""
    for period_s, targets_s in TARGETS_S.items():
        yield from _waits(seed, period_s, targets_s)


def _waits(seed: int, period_s: float, targets_s: Mapping[str, float]) -> Iterator[str]:
    hidden = hide(seed, duration_s=DURATION_S, period_s=period_s)
    library = {name: shipped_effect(name, "library") for name in first_effects()}
    parts = split([hidden.fit], hidden.test)
    of = problem(parts.train.record, hidden.base.valve)
    bare = base_fit(of, hidden.base)
    preview(bare, of, library)  # compiles what is not in the cache
    compare(hidden.fit, hidden.base)
    yield f"{len(hidden.fit)} samples, {DURATION_S:g} s, seed {seed}"
    yield _free_runs(parts.train.record, bare.valve)
    does: Mapping[str, Callable[[], object]] = {
        "compare": lambda: compare(hidden.fit, hidden.base),
        "preview": lambda: preview(bare, of, library),
        "diagnose": lambda: diagnose(hidden.fit, hidden.base, test=hidden.test),
    }
    for name, target_s in targets_s.items():
        yield f"{name:10}{_seconds(does[name]):7.2f} s, target {target_s:g} s"


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


if __name__ == "__main__":
    for line in report(*map(int, sys.argv[1:2])):
        print(line, flush=True)
