"""A valve as an FMU, validated and run by FMPy: the same numbers as our own simulation."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.model_description import read_model_description
from fmpy.simulation import instantiate_fmu
from fmpy.validation import validate_fmu

from config.valve_file import ValveFile, valve
from positioner.cli.main import main
from sim.composition import Composition
from sim.fmu.fmu_file import export_fmu
from sim.simulation import simulate
from sim.valve import Valve

TIME_S = np.arange(0.0, 2.0, 1e-3)
COMMAND_PA = 40e3 + 35e3 * np.sin(6.0 * TIME_S)
EFFECTS = [
    {"name": "ip_lag", "time_constant_s": 0.02},
    {"name": "dwell_stiction", "growth_n": 300.0, "time_constant_s": 0.5},
    {"name": "backlash", "width_m": 1e-3},
]


def extended() -> ValveFile:
    seed = valve("seed")
    return ValveFile.model_validate({"valve": seed.valve.model_dump(), "effect": EFFECTS})


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmu")
    files = {"seed": valve("seed"), "extended": extended()}
    for name, file in files.items():
        export_fmu(Composition.from_file(file), folder / f"{name}.fmu")
    return {name: folder / f"{name}.fmu" for name in files}


def simulated(unit: Path, **start: float) -> Any:
    entering = np.array(list(zip(TIME_S, COMMAND_PA, strict=True)), dtype=[("time", float), ("command_pa", float)])
    return simulate_fmu(
        str(unit),
        input=entering,
        output=["position_m", "pressure_pa"],
        start_values=start,
        step_size=1e-3,
        output_interval=1e-3,
        stop_time=TIME_S[-1],
    )


@pytest.mark.parametrize("name", ["seed", "extended"])
def test_it_is_valid_and_gives_the_numbers_of_our_own_simulation(units: dict[str, Path], name: str) -> None:
    assert validate_fmu(str(units[name])) == []
    ours = simulate({"seed": valve("seed"), "extended": extended()}[name], TIME_S, COMMAND_PA)
    theirs = simulated(units[name])
    assert np.ptp(ours.position_m) > 0.02
    assert np.abs(theirs["position_m"] - ours.position_m).max() < 1e-6
    assert np.abs(theirs["pressure_pa"] - ours.columns["pressure_pa"]).max() < 1e-3


def test_its_parameters_are_those_of_the_valve_file(units: dict[str, Path]) -> None:
    stiffer = extended().valve.model_copy(update={"static_n": 2400.0})
    effects = [*EFFECTS[:2], {"name": "backlash", "width_m": 3e-3}]
    file = ValveFile.model_validate({"valve": stiffer.model_dump(), "effect": effects})
    theirs = simulated(units["extended"], **{"static_n": 2400.0, "backlash.width_m": 3e-3})
    assert np.abs(theirs["position_m"] - simulate(file, TIME_S, COMMAND_PA).position_m).max() < 1e-6


class Unit:
    """An instance of a unit, its variables by name."""

    def __init__(self, path: Path, said: list[str]) -> None:
        description = read_model_description(str(path))
        self._at = {each.name: each.valueReference for each in description.modelVariables}
        self.slave: FMU2Slave = instantiate_fmu(
            extract(str(path)), description, "CoSimulation", logger=lambda *words: said.append(words[-1].decode())
        )
        self.slave.setupExperiment(startTime=0.0)

    def begin(self, **values: float) -> None:
        self.slave.enterInitializationMode()
        for name, value in values.items():
            self.set(name, value)
        self.slave.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        self.slave.setReal([self._at[name]], [value])

    def get(self, name: str) -> float:
        return float(self.slave.getReal([self._at[name]])[0])


def test_parameters_change_while_it_runs_and_a_kept_state_comes_back(units: dict[str, Path]) -> None:
    unit, ours = Unit(units["seed"], []), Valve.from_file(valve("seed"))
    unit.begin(initial_position_m=0.03)
    ours.rest_at(0.03, 0.0)
    assert unit.get("position_m") == 0.03
    unit.set("command_pa", 70e3)
    unit.slave.doStep(0.0, 0.05)
    ours.advance(70e3, 0.05)
    kept = unit.slave.getFMUState()
    ends = []
    for _ in range(2):
        unit.set("spring_n_per_m", 80e3)
        unit.slave.doStep(0.05, 0.2)
        ends.append(unit.get("stem_position_m"))
        unit.slave.setFMUState(kept)
    ours.change(spring_n_per_m=80e3)
    ours.advance(70e3, 0.2)
    assert ends == pytest.approx([ours.position_m, ours.position_m], abs=1e-6)
    unit.slave.freeInstance()


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("mass_kg", 0.0, "mass_kg: must be above 0 to"),
        ("static_n", 100.0, "static_n is below coulomb_n"),
        ("backlash.width_m", -1.0, "backlash.width_m: must be from 0 to 1, got"),
        ("command_pa", float("nan"), "the command is not finite"),
    ],
)
def test_what_is_not_physical_is_refused_and_said(units: dict[str, Path], name: str, value: float, line: str) -> None:
    said: list[str] = []
    unit = Unit(units["extended"], said)
    unit.begin()
    unit.set(name, value)
    with pytest.raises(Exception, match=r"(?i)fmi2DoStep failed"):
        unit.slave.doStep(0.0, 1e-3)
    assert said[-1].startswith(line)


def test_the_command_writes_the_same_bytes_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    units = [tmp_path / "first.fmu", tmp_path / "second.fmu"]
    for unit in units:
        assert main(["export", "fmu", "seed", "-o", str(unit)]) == 0
    assert "in command_pa, out position_m" in capsys.readouterr().out
    assert units[0].read_bytes() == units[1].read_bytes()


def test_without_a_compiler_it_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert main(["export", "fmu", "seed", "-o", str(tmp_path / "valve.fmu")]) == 2
    assert capsys.readouterr().err.strip().endswith("needs a C compiler: apt install gcc, or name one in CC")
    assert not (tmp_path / "valve.fmu").exists()


def test_an_fmu_on_a_full_disk_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "fmu", "seed", "-o", "/dev/full"]) == 2
    assert capsys.readouterr().err == "positioner export: /dev/full: cannot be written: No space left on device\n"
