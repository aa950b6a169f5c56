"""A loop's export is told from a valve's by names, tags, units and values; its process value is no stem."""

from pathlib import Path

import numpy as np
import pytest

from workbench.imports.control_loop import LoopColumn, loops_of
from workbench.imports.export_preview import preview

RNG = np.random.default_rng(5)
HELD = np.repeat([40.0, 60.0, 45.0, 55.0], 50)
PV = HELD + RNG.normal(0.0, 2.0, 200)
OP = 30.0 + 0.5 * HELD + RNG.normal(0.0, 1.0, 200)
STEM = OP + RNG.normal(0.0, 0.3, 200)


def columns(*named: tuple[str, str, np.ndarray]) -> list[LoopColumn]:
    return [LoopColumn(*each) for each in named]


LOOPS = {
    "names alone": columns(("SP", "", HELD), ("PV", "", PV), ("MV", "", OP)),
    "a tag": columns(("FIC101.SP", "%", HELD), ("FIC101.PV", "%", PV), ("FIC101.OP", "%", OP)),
    "a tag without a set point": columns(("TC12_PV", "", PV), ("TC12_OUT", "", OP)),
    "a process's unit": columns(("PV", "m3/h", PV), ("OP", "%", OP)),
    "a unit in the name": columns(("Durchfluss [m3/h]", "", PV), ("Stellgröße", "%", OP)),
    "milliamperes": columns(("PV", "degC", PV), ("OUT", "mA", 4.0 + 0.16 * OP)),
    "German": columns(("Sollwert", "", HELD), ("Istwert", "", PV), ("Stellgröße", "", OP)),
}
VALVES = {
    "a command in bar": columns(("SP", "", HELD), ("PV", "", PV), ("OP", "bar", 0.01 * OP)),
    "a command in pascals": columns(("SP", "", HELD), ("PV", "", PV), ("OP", "", 1e3 * OP)),
    "a stem in mm": columns(("SP", "", HELD), ("PV", "mm", STEM), ("OP", "", OP)),
    "a valve's tag": columns(("FV101.SP", "", HELD), ("FV101.PV", "", STEM), ("FV101.OP", "", OP)),
    "a set point that is the output": columns(("SP", "", OP), ("PV", "", STEM), ("OP", "", OP)),
    "command and position": columns(("OP", "", OP), ("PV", "", STEM)),
    "set point and travel": columns(("SP", "", HELD), ("ZT", "", STEM)),
}


@pytest.mark.parametrize("kind", LOOPS)
def test_a_loop_is_told(kind: str) -> None:
    (loop,) = loops_of(LOOPS[kind])
    given = [each.name for each in LOOPS[kind]]
    assert (loop.setpoint, loop.process_value, loop.output) == tuple(given if len(given) == 3 else (None, *given))
    assert loop.position is None
    assert loop.because


@pytest.mark.parametrize("kind", VALVES)
def test_a_valve_is_no_loop(kind: str) -> None:
    assert loops_of(VALVES[kind]) == []


def test_loops_of_one_file_are_told_apart_by_their_tags_and_have_their_own_stem() -> None:
    named = columns(
        ("FIC101.PV", "", PV),
        ("FIC101.OP", "", OP),
        ("LIC7/PID1/PV.CV", "", PV),
        ("LIC7/PID1/OUT.CV", "", OP),
        ("FV101.ZT", "", STEM),
    )
    assert [(each.tag, each.process_value, each.position) for each in loops_of(named)] == [
        ("FIC101", "FIC101.PV", "FV101.ZT"),
        ("LIC7 PID1", "LIC7/PID1/PV.CV", None),
    ]


def test_nothing_is_proposed_of_a_loop_without_a_stem(tmp_path: Path) -> None:
    rows = zip(np.arange(200) / 2, HELD, PV, OP, strict=True)
    lines = ["time,SP,PV,MV", *(",".join(f"{each:.3f}" for each in row) for row in rows)]
    (tmp_path / "loop.csv").write_text("\n".join(lines))
    found = preview(tmp_path / "loop.csv")
    assert found.words == ()
    assert [each.process_value for each in found.loops] == ["PV"]
    assert "this is a loop, not a stem" in found.summary()
