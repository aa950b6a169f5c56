"""When what is known is written: on news, now and then, at the end; and what is told."""

import logging
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from config.codes import Restored
from config.daemon_file import DaemonFile
from config.errors import InputError
from positioner.control.controller_memory import Decision
from positioner.control.restored_knowledge import Restoration
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.keeping_thread import WRITE_EVERY_CHECKS
from positioner.daemon.memory import MemoryKeeper, StoredMemory
from positioner.daemon.memory.known_configuration import conditions_of
from positioner.daemon.memory.memory_file import SET_ASIDE
from positioner.estimation.acceptance import Applied, Ratios

FIRST = ValveKnowledge(Ratios(-8e5, -2e4), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 1e-5)
NOW = conditions_of(DaemonFile.model_validate({"valve": {"stroke_m": 0.1}}))


class Bench:
    """A keeper, and a controller that says what it is told to."""

    def __init__(self, folder: Path) -> None:
        self.stored = StoredMemory.in_folder(folder, "FV-1", NOW)
        self.knowledge: ValveKnowledge | None = None
        self.restoration, self.count = Restoration.of(self.stored.kept.knowledge, None, 0.1), 0
        self.keeper = MemoryKeeper(self.stored, "FV-1", self.decided, lambda: self.knowledge, lambda: 0.0)

    def decided(self) -> Decision:
        return cast(Decision, SimpleNamespace(restoration=self.restoration, applied=Applied(None, self.count)))

    def check(self, **values: Any) -> None:
        for name, value in values.items():
            setattr(self, name, value)
        self.keeper.check()

    def kept(self) -> ValveKnowledge | None:
        """What another start would find; it is put back."""
        path = self.stored.path
        text = path.read_bytes() if path.exists() else None
        found = StoredMemory.in_folder(path.parent, "FV-1", NOW).kept.knowledge
        if text is not None:
            path.write_bytes(text)
        return found


def test_an_identification_is_written_at_once_and_landings_now_and_then(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.check()
    assert bench.kept() is None
    bench.check(knowledge=FIRST, count=1)
    assert bench.kept() == FIRST
    later = replace(FIRST, residual_m=2e-5)
    bench.check(knowledge=later)
    assert bench.kept() == FIRST
    for _ in range(WRITE_EVERY_CHECKS):
        bench.check()
    assert bench.kept() == later


def test_what_is_confirmed_is_written_and_at_the_end_the_rest(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.check(knowledge=FIRST, count=1)
    again = Bench(tmp_path)
    later = replace(FIRST, residual_m=2e-5)
    again.check(restoration=replace(again.restoration, trust=Restored.CONFIRMED), knowledge=later)
    assert again.kept() == later
    again.knowledge = replace(FIRST, residual_m=3e-5)
    again.keeper.start()
    again.keeper.stop()
    assert again.kept() == again.knowledge


def test_what_was_contradicted_is_set_aside_with_one_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    Bench(tmp_path).check(knowledge=FIRST, count=1)  # an earlier daemon
    bench = Bench(tmp_path)
    assert bench.stored.kept.knowledge == FIRST
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            bench.check(restoration=replace(bench.restoration, trust=Restored.DROPPED))
    assert [record.getMessage() for record in caplog.records] == ["memory set aside"]
    assert Bench(tmp_path).stored.kept.knowledge is None
    assert bench.stored.path.with_name(bench.stored.path.name + SET_ASIDE).exists()


def test_the_start_tells_what_was_restored_or_why_not(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    Bench(tmp_path).check(knowledge=FIRST, count=1)
    for spoil in (False, True):
        if spoil:
            Bench(tmp_path).stored.path.write_text("{")
        bench = Bench(tmp_path)
        with caplog.at_level(logging.INFO):
            bench.keeper.start()
            bench.keeper.stop()
    assert [record.getMessage() for record in caplog.records] == ["memory restored, provisional", "memory set aside"]


def test_a_folder_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="what is known cannot be kept there"):
        StoredMemory.in_folder(tmp_path / "file", "FV-1", NOW)


def test_a_disk_that_fails_is_told_once_and_control_goes_on(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(tmp_path / "gone")
    bench.stored.path.parent.rmdir()
    with caplog.at_level(logging.ERROR):
        bench.check(knowledge=FIRST, count=1)
        bench.check(knowledge=FIRST, count=2)
    assert [record.getMessage() for record in caplog.records] == ["memory cannot be written"]
