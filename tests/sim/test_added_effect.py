"""An effect added by its recipe, one file in sim/effects/, is known in every room: none keeps a list of its own."""

import ast
import shutil
from pathlib import Path

import numpy as np
import pytest

import sim.effect
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.effect import shipped_effect, shipped_effects
from sim.simulation import simulate
from sim.static_inverse import extended_valve
from workbench.fit.fitting import fit
from workbench.fleet.valve_complaints import complaint_of
from workbench.select.equivalence import algebraic_class

ROOT = Path(__file__).parents[2]
ROOMS = ("config", "signals", "webpage", "fieldbus", "drivers", "positioner", "northbound", "sim", "workbench")


def named_in(path: Path) -> set[str]:
    text, effects = path.read_text(encoding="utf-8"), set(shipped_effects()) - {"positioner"}
    named = {each for each in effects if each in text}
    if len(named) < 3:
        return named
    tree = ast.walk(ast.parse(text))
    return named & {each.value for each in tree if isinstance(each, ast.Constant) and isinstance(each.value, str)}


def test_no_module_keeps_a_list_of_effects() -> None:
    files = (path for room in ROOMS for path in (ROOT / room).rglob("*.py") if path.parent.name != "effects")
    assert not {path.relative_to(ROOT).as_posix() for path in files if len(named_in(path)) > 2}


EFFECT = '''"""A force that grows with the square of the position.

    F = -F_q (x / L)^2
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "bellows"
LOOKS = "The static curve bends."
INVERSE = "balance"


class Parameters(NamedTuple):
    """F_q and L."""

    force_n: Annotated[float, Parameter("at full stroke", 0.0, 1e6, off=0.0, starts=(0.1, 1.0), scale="coulomb_n")]
    travel_m: Annotated[float, Parameter("stroke", 1e-3, 10.0, starts=(1.0,), scale="stroke_m", given=True)]


def force(x: float, q: Parameters) -> float:
    """Pull back."""
    return -q.force_n * (x / q.travel_m) ** 2
'''


@pytest.fixture
def bellows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    folder = tmp_path / "effects"
    shutil.copytree(sim.effect.SHIPPED, folder, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "bellows.py").write_text(EFFECT)
    monkeypatch.setattr(sim.effect, "SHIPPED", folder)
    return "bellows"


def test_an_added_effect_is_known_in_every_room(bellows: str) -> None:
    seed = load_valve(shipped_valve("seed"))
    table = EffectTable.model_validate({"name": bellows, "force_n": 2000.0, "travel_m": seed.valve.stroke_m})
    valve = ValveFile(valve=seed.valve, effect=(table,))
    assert bellows in shipped_effects()
    assert f"{bellows}.force_n" in Composition.from_file(valve).names
    time_s = np.arange(0.0, 8.0, 0.01)
    command_pa = 6e4 * (1.0 - np.cos(2.0 * np.pi * time_s / 4.0))
    recording = simulate(valve, time_s, command_pa, noise_std_m=1e-5)
    found = fit(recording, seed, effects=(bellows,), workers=1)
    assert found.parameters[f"{bellows}.force_n"].value == pytest.approx(2000.0, rel=0.05)
    assert algebraic_class(bellows, {bellows: shipped_effect(bellows, "test")}) == {bellows}
    assert extended_valve(valve, "test").up_pa[-1] != extended_valve(seed, "test").up_pa[-1]
    assert complaint_of(bellows) == complaint_of(f"{bellows}.force_n") == "bellows"
