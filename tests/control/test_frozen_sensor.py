"""A position sensor that freezes is a fault on the shipped files, under every law that acts on the position."""

from math import inf, nan
from typing import Any

import pytest

from benchmarks.sensor_faults import SensorFault, Spoilt
from config.codes import Fault, State
from config.daemon_file import CycleTable, DaemonFile, load_valves
from config.loading import SHIPPED
from config.slave_file import Initial, SlaveClock, load_slave
from config.valve_file import load_valve, shipped_valve
from drivers.in_memory import Plant
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant
from tests.control.virtual_loop import VirtualLoop

REFERENCES = (0.45, 0.6, 0.65, 0.5, 0.62, 0.4)
SETTLES_S = 4.0
FARTHEST = 0.35
"""Of the stroke, from where it is shown: what the packing of the seed's valve takes, 0.27, and a quarter more."""


def shipped(name: str, number: int, law: str) -> DaemonFile:
    """Return a valve of a shipped daemon's file, in virtual time."""
    file = load_valves(SHIPPED / "profiles" / name)[number]
    cycle = CycleTable(pace="device", period_s=file.cycle.period_s)
    control = file.control.model_copy(update={"law": law})
    safety = file.safety.model_copy(update={"stale_after_s": max(file.safety.stale_after_s, 4 * cycle.period_s)})
    return file.model_copy(update={"cycle": cycle, "control": control, "safety": safety})


class Freezes:
    """What becomes of a position: from a time on, s, it stays as it is."""

    def __init__(self) -> None:
        self.at_s, self._shown_m = inf, 0.0

    def __call__(self, time_s: float, shown_m: float) -> float:
        if time_s < self.at_s:
            self._shown_m = shown_m
        return self._shown_m


def run_to_the_fault(loop: VirtualLoop, freeze: Any, stem_pu: Any, references: int = 6) -> list[float]:
    """Identify, freeze the sensor at mid-travel, write references; return how far off the stem is in each cycle."""
    loop.cycles(0.2)
    loop.begin()
    loop.cycles(loop.period_s)
    while loop.decision.state is State.S3_IDENTIFY and loop.decision.progress < 1.0:
        loop.cycles(loop.period_s)
    loop.end()
    assert loop.decision.applied.ratios is not None
    loop.refer_to(0.3, SETTLES_S)
    loop.refer_to(0.5, SETTLES_S)
    freeze(loop.cycle.snapshot.sample.now_s)
    off = []
    for each in REFERENCES[:references]:
        loop.refer_to(each, 0.0)
        for _ in range(round(SETTLES_S / loop.period_s)):
            loop.cycles(loop.period_s)
            off.append(abs(stem_pu() - loop.cycle.snapshot.sample.position_m / loop.stroke_m))
            if loop.decision.fault:
                return off
    return off


@pytest.mark.parametrize("law", ["slides", "conventional"])
@pytest.mark.parametrize(
    ("name", "number", "slave", "valve"),
    few_always(
        [
            ("daemon_ordinary.toml", 0, "slave_ordinary.toml", "ordinary"),
            ("daemon_rtu.toml", 0, "slave.toml", "seed"),
            ("daemon.toml", 0, "slave.toml", "seed"),
            ("daemon_canopen.toml", 0, "slave_canopen.toml", "seed"),
            ("fleet.toml", 1, "slave.toml", "seed"),
        ]
    ),
)
def test_a_sensor_that_freezes_is_a_fault_by_the_shipped_files(
    name: str, number: int, slave: str, valve: str, law: str
) -> None:
    file, table = shipped(name, number, law), load_slave(SHIPPED / "profiles" / slave)
    clock = SlaveClock(mode="lockstep", period_s=file.cycle.period_s)
    table = table.model_copy(update={"clock": clock, "change": (), "initial": Initial()})
    model = Valve.from_file(load_valve(shipped_valve(valve)), step_s=FINE_STEP_S)
    model.rest_at(0.0, 0.0)
    device = Spoilt(Device(model, table, {}), SensorFault(inf, inf, nan))

    def freeze(at_s: float) -> None:
        device.fault = SensorFault(at_s, inf, nan)

    loop = VirtualLoop(file, device)
    off = run_to_the_fault(loop, freeze, lambda: model.position_m / loop.stroke_m)
    assert loop.decision.fault is Fault.FROZEN_SENSOR
    assert max(off) < FARTHEST


@pytest.mark.parametrize("law", ["slides", "conventional"])
def test_so_it_is_on_another_plant(law: str) -> None:
    file, frozen = shipped("daemon_rtu.toml", 0, law), Freezes()
    plant: Plant = OtherPlant(SEED_LIKE, file.cycle.period_s, noise_std_m=1e-5, sensed=frozen)

    def freeze(at_s: float) -> None:
        frozen.at_s = at_s

    loop = VirtualLoop(file, plant)
    off = run_to_the_fault(loop, freeze, lambda: plant.stem_pu)  # type: ignore[attr-defined]
    assert loop.decision.fault is Fault.FROZEN_SENSOR
    assert max(off) < FARTHEST


def test_a_stem_that_moves_as_it_is_told_is_never_frozen_though_it_is_read_by_few_digits() -> None:
    """7 bits: the position is the same to the digit for most of the time."""
    file = shipped("daemon_rtu.toml", 0, "slides")
    digit_m = SEED_LIKE.stroke_m / 128
    plant = OtherPlant(
        SEED_LIKE, file.cycle.period_s, sensed=lambda _time_s, shown_m: digit_m * round(shown_m / digit_m)
    )
    loop = VirtualLoop(file, plant)
    run_to_the_fault(loop, lambda _at_s: None, lambda: plant.stem_pu, references=3)
    assert loop.decision.fault is Fault.NONE


def test_a_valve_whose_spring_was_changed_is_not_frozen() -> None:
    """It rests where the law, which knows the spring before, says that none does; and comes by the next push."""
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": 0.04},
            "cycle": {"pace": "device", "period_s": 0.05},
            "pressure": {"maximum_pa": 140e3},
            "safety": {"stale_after_s": 0.5},
            "law": {"b_over_c_pa_per_m": -1.5e6, "k_over_c_pa": -2595.0, "offset_pa": 20.3e3},
        }
    )
    table = load_slave(SHIPPED / "profiles" / "slave_ordinary.toml")
    clock, still = SlaveClock(mode="lockstep", period_s=0.05), table.sensor.model_copy(update={"noise_std_m": 0.0})
    table = table.model_copy(update={"clock": clock, "sensor": still})
    model = Valve.from_file(load_valve(shipped_valve("ordinary")), step_s=FINE_STEP_S)
    model.rest_at(0.02, 60e3)
    loop = VirtualLoop(file, Device(model, table, {}))
    loop.cycles(0.2)
    for reference in (0.5, 0.2, 0.8):
        loop.refer_to(reference, 10.0)
        assert loop.decision.fault is Fault.NONE
        assert model.position_m / 0.04 == pytest.approx(reference, abs=0.01)
