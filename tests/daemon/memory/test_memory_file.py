"""What is known of a valve, kept: whole or not at all, for the configuration it was learnt under."""

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from config.daemon_file import DaemonFile
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.memory.known_configuration import conditions_of
from positioner.daemon.memory.memory_file import SET_ASIDE, read_memory, write_memory
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Directions
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import Answers, SlideOutcome

SLIDE = SlideOutcome(-1.25, 1, 0.05, 70e3, 0.06, 1e-6, True, True)
KNOWLEDGE = ValveKnowledge(
    ratios=Ratios(-814542.6, -22068.2, 1 / 3),
    covariance=((2e6, 0.1, 0.2), (0.1, 3e3, 0.0), (0.2, 0.0, 4e3)),
    residual_m=2e-5,
    landings=(SLIDE,),
    held=(SLIDE._replace(moved=False, landing=False, time_s=-3.5),),
    answers=Answers(0.04, 1e-7, 2e4),
    distances=BreakawayDistance(Interval(5e-3, 6e-3, seen=True), turning_down=Interval(0.0, 7e-3)),
    tracked={"friction_up_n": 1.5e3},
)
FILE: dict[str, Any] = {"valve": {"name": "FV-1", "stroke_m": 0.1}, "cycle": {"period_s": 0.05}}
NOW = conditions_of(DaemonFile.model_validate(FILE))
NAME = "valve.memory.json"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_memory(tmp_path / NAME, "FV-1", NOW, KNOWLEDGE)
    return tmp_path / NAME


def test_what_was_written_is_read_to_the_last_bit(path: Path) -> None:
    for knowledge in (KNOWLEDGE, replace(KNOWLEDGE, distances=None, landings=(), tracked={})):
        write_memory(path, "FV-1", NOW, knowledge)
        kept = read_memory(path, "FV-1", NOW)
        assert (kept.knowledge, kept.problem) == (knowledge, None)
        assert kept.written is not None
    assert [each.name for each in path.parent.iterdir()] == [NAME]


def test_without_a_file_nothing_is_known(tmp_path: Path) -> None:
    kept = read_memory(tmp_path / NAME, "FV-1", NOW)
    assert (kept.knowledge, kept.problem) == (None, None)


def test_a_file_torn_anywhere_is_set_aside_and_never_half_used(path: Path) -> None:
    """At every eleventh byte, which is at each place of a line by turns, and at the last."""
    whole = path.read_bytes()
    end = len(whole.rstrip())
    for length in (*range(0, end, 11), end - 1):
        path.write_bytes(whole[:length])
        kept = read_memory(path, "FV-1", NOW)
        assert kept.knowledge is None
        assert kept.problem is not None
        assert "\n" not in kept.problem
        assert not path.exists()
        assert path.with_name(NAME + SET_ASIDE).read_bytes() == whole[:length]


@pytest.mark.parametrize("directions", list(Directions))
def test_in_which_direction_friction_is_known_is_kept(path: Path, directions: Directions) -> None:
    known = replace(KNOWLEDGE, ratios=replace(KNOWLEDGE.ratios, directions=directions))
    write_memory(path, "FV-1", NOW, known)
    assert read_memory(path, "FV-1", NOW).knowledge == known


def test_killed_between_any_two_writes_the_old_or_the_new_is_left(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each call that changes the disk is the last one in turn."""
    new = replace(KNOWLEDGE, residual_m=7e-5)
    seen = set()
    for last in range(8):
        write_memory(path, "FV-1", NOW, KNOWLEDGE)
        left = iter(range(last))

        def killing(real: Any, left: Iterator[int] = left) -> Any:
            def call(*arguments: Any, **named: Any) -> Any:
                if next(left, None) is None:
                    raise KeyboardInterrupt
                return real(*arguments, **named)

            return call

        with monkeypatch.context() as patch, suppress(KeyboardInterrupt):
            for name in ("fsync", "replace", "open"):
                patch.setattr(os, name, killing(getattr(os, name)))
            write_memory(path, "FV-1", NOW, new)
        kept = read_memory(path, "FV-1", NOW)
        assert kept.problem is None
        assert kept.knowledge in (KNOWLEDGE, new)
        seen.add(kept.knowledge.residual_m if kept.knowledge else 0.0)
    assert seen == {KNOWLEDGE.residual_m, new.residual_m}


def test_a_part_of_a_new_file_beside_the_old_one_is_never_read(path: Path) -> None:
    text = path.read_bytes()
    for length in (0, 1, len(text) // 2, len(text)):
        path.with_name(NAME + ".new").write_bytes(text[:length])
        assert read_memory(path, "FV-1", NOW).knowledge == KNOWLEDGE


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda file: file.update(version=4), "version: allowed is 3, got 4"),
        (lambda file: file.update(version=True), "has no version"),
        (lambda file: file.update(more=1), "must hold version, sha256 and a content"),
        (lambda file: file["content"].pop("knowledge"), "must hold version, sha256 and a content"),
        (lambda file: file["content"]["knowledge"].update(k_over_c_pa=-22068.3), "sha256: is not that"),
        (lambda file: file["content"]["conditions"].update({"valve.stroke_m": "0.2"}), "sha256: is not that"),
    ],
)
def test_what_was_changed_by_hand_or_is_newer_is_set_aside(path: Path, change: Any, said: str) -> None:
    file = json.loads(path.read_text())
    change(file)
    path.write_text(json.dumps(file))
    kept = read_memory(path, "FV-1", NOW)
    assert kept.knowledge is None
    assert kept.problem is not None
    assert kept.problem.startswith(said)
    assert json.loads(path.with_name(NAME + SET_ASIDE).read_text()) == file


@pytest.mark.parametrize("text", [b"", b"[1]", b"\xff\x00", b"[" * 100_000, b'{"version": 1}'])
def test_garbage_is_set_aside_in_one_line(path: Path, text: bytes) -> None:
    path.write_bytes(text)
    kept = read_memory(path, "FV-1", NOW)
    assert kept.knowledge is None
    assert kept.problem is not None
    assert "\n" not in kept.problem


def test_another_valves_is_set_aside(path: Path) -> None:
    assert read_memory(path, "FV-2", NOW).problem == "valve: allowed is 'FV-2', got 'FV-1'"


@pytest.mark.parametrize(
    ("knowledge", "said"),
    [
        (replace(KNOWLEDGE, ratios=Ratios(814542.6, -22068.2)), "knowledge.b_over_c_pa_per_m: "),
        (replace(KNOWLEDGE, landings=(SLIDE._replace(time_s=3.0),)), "knowledge.landings.0.time_s: "),
        (replace(KNOWLEDGE, residual_m=-1.0), "knowledge.residual_m: "),
        (replace(KNOWLEDGE, distances=BreakawayDistance(Interval(-1.0))), "knowledge.distances.0.held_m: "),
        (replace(KNOWLEDGE, landings=(SLIDE._replace(direction=0),)), "knowledge.direction: "),
        (replace(KNOWLEDGE, ratios=Ratios(-1e300, -22068.2)), "knowledge.b_over_c_pa_per_m: "),
        (replace(KNOWLEDGE, ratios=Ratios(-1e-300, -22068.2)), "knowledge.b_over_c_pa_per_m: "),
        (replace(KNOWLEDGE, residual_m=1e308), "knowledge.residual_m: "),
        (replace(KNOWLEDGE, landings=(SLIDE._replace(position_m=1e9),)), "knowledge.landings.0.position_m: "),
        (replace(KNOWLEDGE, answers=Answers(-1.0)), "knowledge.answers.0: "),
    ],
)
def test_what_cannot_be_true_is_not_taken(path: Path, knowledge: ValveKnowledge, said: str) -> None:
    write_memory(path, "FV-1", NOW, knowledge)
    kept = read_memory(path, "FV-1", NOW)
    assert kept.knowledge is None
    assert kept.problem is not None
    assert kept.problem.startswith(said)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"valve": {"name": "FV-1", "stroke_m": 0.2}}, "valve.stroke_m was 0.1, is 0.2"),
        ({"pressure": {"maximum_pa": 300e3}}, "pressure.maximum_pa was 420000.0, is 300000.0"),
        ({"cycle": {"period_s": 0.1}}, "cycle.period_s was 0.05, is 0.1"),
        ({"device": {"host": "10.0.0.7"}}, 'device.host was "127.0.0.1", is "10.0.0.7"'),
        (
            {"law": {"b_over_c_pa_per_m": -8e5, "k_over_c_pa": -2e4}},
            "law.b_over_c_pa_per_m was nothing, is -800000.0",
        ),
    ],
)
def test_another_configuration_is_told_by_its_key(path: Path, change: dict[str, Any], said: str) -> None:
    then = conditions_of(DaemonFile.model_validate(FILE | change))
    assert read_memory(path, "FV-1", then).problem == f"was learnt under another configuration: {said}"
    assert path.with_name(NAME + SET_ASIDE).exists()


@pytest.mark.parametrize(
    "change",
    [
        {"device": {"reply_timeout_s": 1.0, "communication_action": "vent"}},
        {"control": {"law": "slides", "dead_band": 0.003}},
        {"safety": {"stale_after_s": 3.0}},
    ],
)
def test_what_says_nothing_of_the_valve_may_change(path: Path, change: dict[str, Any]) -> None:
    then = conditions_of(DaemonFile.model_validate(FILE | change))
    assert read_memory(path, "FV-1", then).knowledge == KNOWLEDGE
