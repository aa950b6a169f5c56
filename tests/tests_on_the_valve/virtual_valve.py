"""A simulated valve under the daemon's own cycle in virtual time, on which programs of tests are played."""

from dataclasses import replace
from typing import Any

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.slave_file import Change, DeviceFault, Initial, Sensor, SlaveClock, SlaveFile, Supply
from config.travel import ActionWord
from config.valve_file import ValveFile, load_valve, shipped_valve
from drivers.in_memory import Plant
from positioner.control.requests import ExperimentRequest, Requests
from positioner.daemon.cycle import Cycle
from positioner.tests_on_the_valve.own_cycle import OwnCycle
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve

PERIOD_S = 0.05
ORDINARY = load_valve(shipped_valve("ordinary"))
PARAMETERS = ORDINARY.valve
PRELOAD_N = next(each.parameters["force_n"] for each in ORDINARY.effect if each.name == "preload")
ASYMMETRY = next(each.parameters["asymmetry"] for each in ORDINARY.effect if each.name == "asymmetric_friction")
AREA_M2, STROKE_M = PARAMETERS.diaphragm_area_m2, PARAMETERS.stroke_m
SLOPE = PARAMETERS.spring_n_per_m / AREA_M2
MAXIMUM_PA = 140e3
MIDWAY = Initial(position_m=0.02, pressure_pa=60e3)
WINDOWLESS = {"travel_window": (0.0, 1.0), "limit_s": 300.0}


def told(file: ValveFile = ORDINARY, **parameters: float) -> ValveFile:
    """Return a valve file with other parameters."""
    return file.model_copy(update={"valve": file.valve.model_copy(update=parameters)})


def daemon_file(**tables: dict[str, Any]) -> DaemonFile:
    whole: dict[str, Any] = {
        "valve": {"name": "FV-1", "stroke_m": STROKE_M},
        "cycle": {"pace": "device", "period_s": PERIOD_S},
        "pressure": {"maximum_pa": MAXIMUM_PA},
        "safety": {"stale_after_s": 0.5},
        "experiment": WINDOWLESS,
    }
    for name, table in tables.items():
        whole[name] = whole.get(name, {}) | table
    return DaemonFile.model_validate(whole)


class VirtualValve(OwnCycle):
    """The ordinary valve unless told otherwise, its consent given, in automatic."""

    def __init__(
        self,
        valve: ValveFile = ORDINARY,
        file: DaemonFile | None = None,
        *,
        noise: float = 0.0,
        seed: int = 0,
        initial: Initial = MIDWAY,
        faults: tuple[DeviceFault, ...] = (),
        changes: tuple[Change, ...] = (),
        action: ActionWord = "air_to_open",
        maximum_pa: float = MAXIMUM_PA,
    ) -> None:
        self.file = file or daemon_file()
        slave = SlaveFile(
            clock=SlaveClock(mode="lockstep", period_s=PERIOD_S),
            sensor=Sensor(noise_std_m=noise * valve.valve.stroke_m, seed=seed),
            initial=initial,
            supply=Supply(maximum_pa=maximum_pa),
            action=action,
            fault=faults,
            change=changes,
        )
        stem = Valve.from_file(valve, step_s=FINE_STEP_S)
        stem.rest_at(initial.position_m, initial.pressure_pa)
        self.device = Device(stem, slave, valve.valve.model_dump(exclude={"name", "kind"}))
        super().__init__(cycle_of(self.file, self.device), kind=valve.valve.own)


def cycle_of(file: DaemonFile, device: Plant) -> Cycle:
    """Return a cycle in automatic, with consent."""
    experiment = ExperimentRequest(consented=True)
    cycle = virtual_cycle(file, device, Requests(mode=Mode.AUTOMATIC, mode_writes=1, experiment=experiment))
    for _ in range(3):
        cycle.once()
    return cycle


def vetoed(cycle: Cycle) -> None:
    """Set the operator's veto."""
    cycle.requests = replace(cycle.requests, experiment=replace(cycle.requests.experiment, vetoed=True))
