"""A reference that waits, and who wrote it."""

from dataclasses import replace
from pathlib import Path

import pytest

from config.codes import Mode
from northbound.observer.waiting_reference import Writer, reference_writer, waiting_reference
from positioner.history import HistoryFile
from positioner.history.entries import Write

HELD = {"mode": float(Mode.HOLD), "reference": 0.7, "reference_opening": 0.7, "reference_in_force": 0.2}


@pytest.mark.parametrize(
    ("changed", "waits"),
    [
        ({}, 0.7),
        ({"mode": float(Mode.MANUAL)}, 0.7),
        ({"mode": float(Mode.AUTOMATIC)}, None),
        ({"reference_opening": 0.2}, None),
        ({"reference_opening": float("nan")}, None),
    ],
)
def test_it_waits_outside_automatic_where_the_stem_is_elsewhere(changed: dict[str, float], waits: float | None) -> None:
    assert waiting_reference({**HELD, **changed}) == waits
    assert waiting_reference({}) is None


def test_who_wrote_it_last_is_told_by_the_history(tmp_path: Path) -> None:
    asked = Write(
        1, "FV-101", 1e9, 1e9 + 5, 2, "write", "10.0.0.7:40", "Meier", "operator", "reference = 0.7, heartbeat"
    )
    others = [
        replace(asked, number=2, peer="10.0.0.8:40", text="mode = 2"),
        replace(asked, number=3, peer="10.0.0.8:40", what="refused"),
        replace(asked, number=4, peer="10.0.0.8:40", valve="FV-102"),
    ]
    assert reference_writer(None, "FV-101") is None
    assert reference_writer(tmp_path / "gone", "FV-101") is None
    file = HistoryFile(tmp_path, 1e4, 10)
    try:
        file.append(others)
        assert reference_writer(tmp_path, "FV-101") is None
        file.append([asked])
        assert reference_writer(tmp_path, "FV-101") == Writer("10.0.0.7:40", "Meier", "operator", 1e9 + 5)
    finally:
        file.close()
    assert Writer("10.0.0.7:40", "Meier", "operator", 0.0).words.startswith("Meier (operator) at 10.0.0.7:40, 19")
