"""A small plant for tests of fleets, and examinations without Dask."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.slave_file import Sensor
from config.valve_file import ValveFile, valve
from config.writing import write_valve
from sim.composition import Composition
from workbench.blind.input_signal import excitation
from workbench.blind.trial import Trial
from workbench.fleet.examination import examine

HEAD = "valve,file,recording,when\n"
ROWS, PERIOD_S = 1000, 0.02
TIGHTER = {"coulomb_n": 2200.0, "static_n": 2600.0}
PLAY = {"name": "backlash", "width_m": 4e-3}
FEW = ["asymmetric_friction", "backlash", "preload", "ip_lag"]


def record(file: ValveFile, path: Path, seed: int, *, share: float = 1.0, gain: float = 1.0) -> None:
    """Record a valve under a command that shows what it is: a share of it arrives, the position is read by a gain."""
    path.parent.mkdir(exist_ok=True)
    command_pa = excitation(valve("seed").valve, np.random.default_rng(seed), ROWS)
    composition = Composition.from_file(file)
    answer_m = gain * Trial(share * command_pa, PERIOD_S).answer_m(composition, composition.theta)
    Trial(command_pa, PERIOD_S).recording(answer_m, Sensor(noise_std_m=5e-5, seed=seed)).write(path)


def play() -> ValveFile:
    return ValveFile.model_validate({"valve": valve("seed").valve.model_dump(), "effect": [PLAY]})


def plant(folder: Path) -> Path:
    """A valve that is well, one whose packing was tightened, one with play, one with a recording of garbage."""
    well = valve("seed")
    tight = well.model_copy(update={"valve": well.valve.model_copy(update=TIGHTER)})
    write_valve(folder / "seed.toml", well)
    rows = []
    for number, (name, autumn) in enumerate({"well": well, "tight": tight, "play": play(), "bad": well}.items()):
        record(well, folder / "recordings" / f"{name}-1.csv", 2 * number)
        record(autumn, folder / "recordings" / f"{name}-2.csv", 2 * number + 1)
        rows += [f"{name},seed.toml,recordings/{name}-{i}.csv,2026-0{i}-01\n" for i in (1, 2)]
    (folder / "recordings" / "bad-2.csv").write_text("no recording\n")
    (folder / "small.csv").write_text(HEAD + "".join(rows[:4] + rows[6:]))
    (folder / "plant.csv").write_text(HEAD + "".join([*rows, "absent,none.toml,recordings/absent.csv,2026-01-01\n"]))
    return folder / "plant.csv"


class Straight:
    """In place of Dask: examines where it stands."""

    def __enter__(self) -> "Straight":
        return self

    def __exit__(self, *_: object) -> None:
        pass


def straight(_client: object, courses: Any, _time_limit_s: float) -> None:
    for course in courses:
        while (request := course.following()) is not None:
            course.take(examine(request))


def examined_here(patch: pytest.MonkeyPatch) -> None:
    """Without Dask, and against few effects: the whole library would take the longest of all."""
    patch.setattr("workbench.fleet.fleet.work", straight)
    patch.setattr("workbench.fleet.fleet.cluster", lambda *_: Straight())
    patch.setattr("workbench.select.diagnosis.tried_effects", lambda: FEW)


def tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.glob("*.parquet")}
