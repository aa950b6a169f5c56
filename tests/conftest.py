"""How `make test` shares the suite out over workers: a file is one group, all that happens in real time is another, all
that waits for other programs a third.

A group runs on one worker, in order. So a file's valves, fits and processes are made once, and no two tests that are
held to a clock ever wait for each other. The others give way to these. See tests/README.md.
"""

import gc
import os
import signal
import sys
import tempfile
from functools import cache
from pathlib import Path

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

ROOT = Path(__file__).parents[1]
FITS = ROOT / "tests" / "workbench"
REAL_TIME = "pytest.mark.real_time"
"""In a file: it is held to a clock, by a process or a wire."""
PATIENT = "pytest.mark.patient"
"""In a file: it waits for other programs, a browser or workers, and is held to no clock."""
SELDOM = 50_000
"""Objects after which garbage is looked for: with the usual 700 that takes an eighth of the tests' time."""
MOST_PROCESSORS = 4
"""More would not end sooner: what happens in real time takes the longest then."""
GIVES_WAY = 3
"""Niceness of a test that waits for nothing outside, half the weight: more would starve it beside busy processes."""

# While all is imported, nothing of it is to be collected.
gc.disable()
# Of every process: threads for small matrices would only take the processors from the other workers.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Effects that tests write themselves lie in temporary folders.
os.environ["POSITIONER_EFFECTS"] = os.pathsep.join((".", tempfile.gettempdir()))
# Nor compile our modules anew in each, where a person has switched the keeping off.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# A child has the signals that its parent ignores ignored: nohup and a shell's "&" would decide what ends a daemon.
for ignored in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
    if signal.getsignal(ignored) is signal.SIG_IGN:
        signal.signal(ignored, signal.default_int_handler if ignored is signal.SIGINT else signal.SIG_DFL)


class Groups(LoadScopeScheduling):  # type: ignore[misc]
    """Gives each worker a whole group at a time; xdist knows a test by its id alone, hence by its file."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        return _mark(ROOT / file) or file


@cache
def _mark(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    return next((each for each in (REAL_TIME, PATIENT) if each in text), "")


def _is_real_time(path: Path) -> bool:
    return _mark(path) == REAL_TIME


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Groups:
    """Share out by groups, in the order of `pytest_collection_modifyitems`."""
    config.option.loadscopereorder = False
    return Groups(config, log)


def pytest_xdist_auto_num_workers() -> int:
    """Of `-n auto`: two workers more than processors, as those of the two groups that wait mostly do."""
    return min(os.cpu_count() or 1, MOST_PROCESSORS) + 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put what waits first, in real time before all, then the files of fits: what takes long must not come last."""
    items.sort(key=lambda item: ((REAL_TIME, PATIENT, "").index(_mark(item.path)), FITS not in item.path.parents))


def pytest_collection_finish() -> None:
    """Leave all that is imported by now out of garbage collection, and let that look at the rest seldom.

    To go through it takes half a second on a busy machine, in which no thread of the process answers anybody.
    """
    gc.freeze()
    gc.set_threshold(SELDOM)
    gc.enable()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Give way to what happens in real time on another worker; that group goes first, so a worker never turns back."""
    if "PYTEST_XDIST_WORKER" in os.environ and not _is_real_time(item.path):
        os.setpriority(os.PRIO_PROCESS, 0, GIVES_WAY)
