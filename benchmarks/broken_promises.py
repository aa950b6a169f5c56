"""Promises of `docs/promises.md`, each broken on purpose: does the test that holds it turn red?

    python -m benchmarks.broken_promises

In a copy of the tree one line is changed, and the test that the document names is run; unchanged, it must pass. Exit
status 1 when a broken promise goes unnoticed.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
ROOMS = (
    "config",
    "signals",
    "webpage",
    "fieldbus",
    "drivers",
    "positioner",
    "northbound",
    "sim",
    "workbench",
    "benchmarks",
    "docs",
    "tests",
)


class Breakage(NamedTuple):
    """What is promised, the line of code that keeps it, what stands there instead, and the test that must see it."""

    promise: str
    file: str
    kept: str
    broken: str
    test: str


BREAKAGES = (
    Breakage(
        "a device that is operated locally stays where it is when it is given back",
        "positioner/control/controller.py",
        "if supervision.fault and sample.quality is GOOD and sample.status & NOT_READY:",
        "if False:",
        "tests/control/test_controller.py::test_a_device_that_does_not_obey_stays_where_it_is_when_it_does_again",
    ),
    Breakage(
        "a node that another master stopped is a fault",
        "drivers/canopen/driver.py",
        "self._watcher.was_interrupted |= self.sdo.hears_stopped()",
        "pass",
        "tests/drivers/test_canopen_faults.py::"
        "test_a_node_that_was_stopped_is_one_though_its_tpdo_was_missed_before_its_heartbeat_said_so",
    ),
    Breakage(
        "a fault is latched until it is acknowledged",
        "positioner/control/supervision.py",
        "fault = cause or (NO_FAULT if acknowledged or not_there_yet else memory.fault)",
        "fault = cause",
        "tests/control/test_controller.py::test_recovery_moves_nothing_before_the_mode_is_chosen_again",
    ),
    Breakage(
        "what is kept over a restart is whole, or set aside",
        "positioner/daemon/memory/memory_file.py",
        'if file["sha256"] != _digest(content):',
        "if False:",
        "tests/daemon/memory/test_memory_file.py",
    ),
    Breakage(
        "a role may write what is its own, and nothing else",
        "fieldbus/modbus/client_roles.py",
        "if identity.role < needed:",
        "if False:",
        "tests/daemon/test_role_matrix.py",
    ),
    Breakage(
        "what permits a test ends it when it goes away",
        "positioner/control/permissives.py",
        "    if vetoed:",
        "    if False:",
        "tests/control/test_permissives.py",
    ),
    Breakage(
        "a sensor that stands still while the pressure changes is a fault by default",
        "positioner/control/monitors.py",
        "frozen.unanswered_s > frozen.longest_s,",
        "False,",
        "tests/control/test_monitors.py::"
        "test_by_default_a_sensor_that_stands_still_is_a_fault_and_a_slow_cycle_an_alarm",
    ),
    Breakage(
        "what a device did by itself is no landing, and drops nothing",
        "positioner/control/controller.py",
        "if sample.unattended_s > 0.0 or not _obeyed(now):",
        "if False:",
        "tests/control/test_restored_knowledge.py::test_what_a_device_did_by_itself_is_no_landing_and_drops_nothing",
    ),
    Breakage(
        "a sensor that drifts in S3 by a sine applies nothing beyond its deviation",
        "positioner/estimation/batch.py",
        "drifting = _fitted_beside(best, Beside.DRIFT, prior)",
        "drifting = None",
        "tests/control/test_sensor_matrix.py",
    ),
    Breakage(
        "a sine that is broken off applies nothing",
        "positioner/control/identifying.py",
        "if excitation is not None and excitation.broken_off and memory.identification.estimates.progress < 1.0:",
        "if False:",
        "tests/control/test_late_cycles.py::test_a_sine_that_is_broken_off_applies_nothing",
    ),
    Breakage(
        "a stem that stands away from its reference is never good",
        "positioner/daemon/health/ne107.py",
        "if given_up or health.left_away_m > MISSED * health.settings.stroke_m:",
        "if given_up:",
        "tests/daemon/health/test_valve_health.py::"
        "test_a_stem_that_stands_6_percent_away_is_never_good_whatever_the_law_says",
    ),
)


def rows() -> Iterator[tuple[str, bool]]:
    """Yield a row of the table for each promise, and whether its test has seen that it was broken."""
    with tempfile.TemporaryDirectory() as made:
        tree = Path(made)
        for room in ROOMS:
            shutil.copytree(ROOT / room, tree / room, ignore=shutil.ignore_patterns("__pycache__", "*.pyc"))
        for name in ("pyproject.toml", "README.md", "CHANGELOG.md"):
            shutil.copy(ROOT / name, tree / name)
        for each in BREAKAGES:
            whole = _passes(tree, each.test)
            path = tree / each.file
            kept = path.read_text(encoding="utf-8")
            assert kept.count(each.kept) == 1, f"{each.file} has no such line, or several: {each.kept}"
            path.write_text(kept.replace(each.kept, each.broken), encoding="utf-8")
            seen = not _passes(tree, each.test)
            path.write_text(kept, encoding="utf-8")
            said = "red" if seen else "NOT SEEN"
            yield f"| {each.promise} | `{each.test}` | {'green' if whole else 'RED'} | {said} |", whole and seen


def _passes(tree: Path, test: str) -> bool:
    """Return whether a test passes in a tree; byte code is not written, so that no change goes unnoticed."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    words = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", test]
    done = subprocess.run(words, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return done.returncode == 0


if __name__ == "__main__":
    print("| promise | test | whole | broken |\n|---|---|---|---|")
    unseen = 0
    for line, as_promised in rows():
        print(line, flush=True)
        unseen += not as_promised
    sys.exit(1 if unseen else 0)
