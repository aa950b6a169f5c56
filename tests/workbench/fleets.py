"""A small plant for tests of fleets, and examinations without Dask."""

import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.recording import Recording
from config.slave_file import Sensor
from config.valve_file import ValveFile, valve
from config.valve_file_writer import valve_toml, write_valve
from sim.composition import Composition
from sim.effect import FINE_STEP_S
from workbench.blind.input_signal import excitation
from workbench.blind.trial import Trial
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.fleet.examination import examine

HEAD = "valve,file,recording,when\n"
ROWS, PERIOD_S = 700, 0.02
TIGHTER = {"coulomb_n": 2200.0, "static_n": 2600.0}
PLAY = {"name": "backlash", "width_m": 4e-3}
FEW = ["asymmetric_friction", "backlash"]


def record(file: ValveFile, path: Path, seed: int, *, share: float = 1.0, gain: float = 1.0) -> None:
    """Record a valve under a command that shows what it is: a share of it arrives, the position is read by a gain."""
    path.parent.mkdir(exist_ok=True)
    command_pa = excitation(valve("seed").valve, np.random.default_rng(seed), ROWS)
    composition = Composition.from_file(file)
    answer_m = gain * Trial(share * command_pa, PERIOD_S).answer_m(composition, composition.theta, FINE_STEP_S)
    Trial(command_pa, PERIOD_S).recording(answer_m, Sensor(noise_std_m=5e-5, seed=seed)).write(path)


def play() -> ValveFile:
    return ValveFile.model_validate({"valve": valve("seed").valve.model_dump(), "effect": [PLAY]})


def plant(folder: Path, *, alike: bool = False) -> Path:
    """A valve that is well, one whose packing was tightened, one with play, one with a recording of garbage.

    Where they were alike in January it is to the byte: one diagnosis then serves all four.
    """
    well = valve("seed")
    tight = well.model_copy(update={"valve": well.valve.model_copy(update=TIGHTER)})
    write_valve(folder / "seed.toml", well)
    rows = []
    for number, (name, autumn) in enumerate({"well": well, "tight": tight, "play": play(), "bad": well}.items()):
        record(well, folder / "recordings" / f"{name}-1.csv", 0 if alike else 2 * number)
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
    """Without Dask, and against few effects, once a recording and valve: the whole library would take the longest."""
    diagnosed: dict[tuple[bytes, str], Diagnosis] = {}

    def once(recording: Recording, held: ValveFile, **options: Any) -> Diagnosis:
        nameless = held.model_copy(update={"valve": held.valve.model_copy(update={"name": ""})})
        key = recording.columns["position_m"].tobytes(), valve_toml(nameless)
        if key not in diagnosed:
            diagnosed[key] = diagnose(recording, held, **options)
        return diagnosed[key]

    patch.setattr("workbench.fleet.examination.diagnose", once)
    patch.setattr("workbench.fleet.drill_down.diagnose", once)
    patch.setattr("workbench.fleet.fleet.work", straight)
    patch.setattr("workbench.fleet.fleet.cluster", lambda *_: Straight())
    patch.setattr("workbench.diagnosis.diagnosis.tried_effects", lambda: FEW)


def serve_cluster(said: Connection) -> None:
    """Be a scheduler with a worker in it, and say its address."""
    from distributed import LocalCluster  # a second of every worker that only collects this file

    local: Any = LocalCluster
    with local(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1", dashboard_address=None
    ) as cluster:
        said.send(cluster.scheduler_address)
        while True:
            time.sleep(3600.0)


def tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.glob("*.parquet")}
