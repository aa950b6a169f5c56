"""An ordinary valve by its shipped profiles, in virtual time: 20 ms, 12 bits, whole mbar, and nothing typed in."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from functools import cache
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.codes import InhibitReason, Mode
from config.daemon_file import CycleTable, DaemonFile, load_daemon
from config.loading import SHIPPED
from config.recording import read_recording
from config.slave_file import Initial, SlaveClock, load_slave
from config.valve_file import load_valve, shipped_valve
from positioner.cli.main import main
from positioner.control.requests import QUIET, Requests
from positioner.daemon.cycle import Cycle
from positioner.daemon.snapshot import Snapshot
from positioner.estimation.landings.static_law import StaticLaw
from positioner.virtual.virtual_cycle import play_script, run_identification, virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always

FILE = load_valve(shipped_valve("ordinary"))
VALVE = FILE.valve
STROKE_M = VALVE.stroke_m
QUANTUM_M = STROKE_M / 4096
LANDED_M = max(1e-3 * STROKE_M, QUANTUM_M)
EFFECTS = {each.name: each.parameters for each in FILE.effect}
PRELOAD_N, ASYMMETRY = EFFECTS["preload"]["force_n"], EFFECTS["asymmetric_friction"]["asymmetry"]
SLOPE = VALVE.spring_n_per_m / VALVE.diaphragm_area_m2
UP_PA = (VALVE.coulomb_n * (1 + ASYMMETRY) + PRELOAD_N) / VALVE.diaphragm_area_m2
DOWN_PA = (VALVE.coulomb_n * (1 - ASYMMETRY) - PRELOAD_N) / VALVE.diaphragm_area_m2
MBAR_PA = 100.0
PERIOD_S = 0.02
STEP_S = 4.0
ON_THE_SEAT, MIDWAY, WIDE_OPEN = (
    Initial(),
    Initial(position_m=0.02, pressure_pa=60e3),
    Initial(position_m=0.04, pressure_pa=140e3),
)


class WholeMillibars:
    """A device whose registers hold whole mbar: what is commanded and what is measured."""

    def __init__(self, device: Device) -> None:
        self.device = device

    def __getattr__(self, name: str) -> Any:
        if name == "device":  # a copy that has none yet
            raise AttributeError(name)
        value = getattr(self.device, name)
        return mbar(value) if name == "pressure_pa" else value

    def tick(self, command_pa: float) -> None:
        self.device.tick(mbar(command_pa))


def mbar(pressure_pa: float) -> float:
    return MBAR_PA * round(pressure_pa / MBAR_PA)


def daemon_file(**control: float) -> DaemonFile:
    file = load_daemon(SHIPPED / "profiles" / "daemon_ordinary.toml")
    assert file.cycle.period_s == PERIOD_S
    table = file.control.model_copy(update=control)
    return file.model_copy(update={"cycle": CycleTable(pace="device", period_s=PERIOD_S), "control": table})


class Loop:
    """The valve, its device, and the daemon's cycle, identified when it is made."""

    def __init__(self, initial: Initial = ON_THE_SEAT, seed: int = 0, **control: float) -> None:
        file = load_slave(SHIPPED / "profiles" / "slave_ordinary.toml")
        sensor = file.sensor.model_copy(update={"seed": seed})
        clock = SlaveClock(mode="lockstep", period_s=PERIOD_S)
        file = file.model_copy(update={"clock": clock, "initial": initial, "sensor": sensor})
        self.valve = Valve.from_file(FILE, step_s=FINE_STEP_S)
        self.valve.rest_at(initial.position_m, initial.pressure_pa)
        device = WholeMillibars(Device(self.valve, file, {}))
        self.cycle: Cycle = virtual_cycle(daemon_file(**control), device, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
        self.staircase = list(run_identification(self.cycle, 60.0, wait=False))

    @property
    def law(self) -> StaticLaw:
        return self.cycle.snapshot.decision.static_law

    def step_to(self, reference_m: float) -> list[Snapshot]:
        """Write a reference; return the snapshots of the time given to the move."""

        def ask(snapshot: Snapshot, requests: Requests) -> Requests:
            new = requests.reference_m != reference_m or not requests.reference_writes
            writes = requests.reference_writes + int(new)
            return replace(requests, eta=QUIET, reference_m=reference_m, reference_writes=writes)

        return list(play_script(self.cycle, ask, self.cycle.snapshot.sample.time_s + STEP_S))


@cache
def _loop(initial: Initial) -> Loop:
    return Loop(initial)


def identified(initial: Initial = ON_THE_SEAT) -> Loop:
    """Return a loop of one's own; the one that it is copied from is made once."""
    return deepcopy(_loop(initial))


def references_m(seed: int) -> Iterator[float]:
    """Yield 12 references, steps of 0.5 to 10 % of the stroke."""
    rng = np.random.default_rng(seed)
    at = 0.5
    for _ in range(12):
        step = rng.uniform(0.005, 0.1) * rng.choice((-1, 1))
        at += step if 0.1 < at + step < 0.9 else -step
        yield float(at * STROKE_M)


def test_the_numbers_are_those_of_an_ordinary_valve() -> None:
    bench_pa = SLOPE * STROKE_M
    assert PRELOAD_N / VALVE.diaphragm_area_m2 == pytest.approx(0.2e5)
    assert bench_pa == pytest.approx(0.8e5)
    assert 0.05 < 2 * VALVE.coulomb_n / VALVE.diaphragm_area_m2 / bench_pa < 0.08
    damping = VALVE.viscous_ns_per_m / (2 * (VALVE.mass_kg * VALVE.spring_n_per_m) ** 0.5)
    assert 1.0 < damping < pi / 2


@pytest.mark.parametrize("initial", [ON_THE_SEAT, MIDWAY, WIDE_OPEN])
def test_a_staircase_identifies_it_wherever_the_stem_is(initial: Initial) -> None:
    loop = identified(initial)
    for found, true in zip((loop.law.slope, loop.law.up, loop.law.down), (SLOPE, UP_PA, DOWN_PA), strict=True):
        assert abs(found.value - true) < max(3 * found.std, 0.01 * abs(true))
    decision = loop.cycle.snapshot.decision
    assert decision.applied.count == 1
    assert decision.applied.ratios == loop.law.ratios
    position_m = np.array([each.sample.position_m for each in loop.staircase])
    inside = (position_m > 0.1 * STROKE_M) & (position_m < 0.9 * STROKE_M)
    since = position_m[int(np.argmax(inside)) :]
    assert 0.1 * STROKE_M - LANDED_M < since.min() < since.max() < 0.9 * STROKE_M + LANDED_M


@pytest.mark.parametrize("seed", few_always(range(4)))
def test_steps_land(seed: int) -> None:
    loop = Loop(seed=seed) if seed else identified()
    learning = 0
    for reference_m in references_m(seed):
        move = loop.step_to(reference_m)
        slides = int(np.count_nonzero(np.diff([each.decision.command_pa for each in move])))
        assert slides <= 5, "one tried too short, then two, two again; no other whole mbar lands it better"
        learning += int(slides > 4)
        end = move[-1]
        assert all(each.decision.command_pa == mbar(each.decision.command_pa) for each in move)
        assert loop.valve.position_m == pytest.approx(reference_m, abs=LANDED_M)
        assert end.decision.inhibit_reason is InhibitReason.NOTHING
    assert learning <= 1, "what was tried too short is known then"


def test_play_knows_it(tmp_path: Path) -> None:
    reference = tmp_path / "reference.csv"
    reference.write_text("time_s,reference_m\n0,0.02\n3,0.0204\n6,0.018\n9,0.018\n")
    out = tmp_path / "played.csv"
    words = ["play", "ordinary", "--law", "slides", "--period-s", "0.02", "--noise-m", "4e-6"]
    assert main([*words, "--reference", str(reference), "-o", str(out)]) == 0
    columns = read_recording(out).columns
    ends = np.searchsorted(columns["time_s"], (2.9, 5.9, 8.9))
    assert np.abs(columns["position_m"][ends] - (0.02, 0.0204, 0.018)).max() < LANDED_M


def test_a_reference_below_its_cutoff_shuts_the_valve_tight_and_one_above_opens_it_wide() -> None:
    loop = Loop(MIDWAY, cutoff_low=0.01, cutoff_high=0.98)
    loop.step_to(0.3 * STROKE_M)
    known = loop.law
    shut = loop.step_to(0.008 * STROKE_M)[-1]
    assert shut.decision.inhibit_reason is InhibitReason.CUT_OFF
    assert shut.decision.command_pa == daemon_file().pressure.minimum_pa
    assert loop.valve.position_m < 1e-5, "on its seat"
    still = loop.step_to(0.013 * STROKE_M)[-1]
    assert still.decision.command_pa == shut.decision.command_pa, "within the hysteresis"
    assert loop.law == known, "a stem that is pressed onto a seat tells nothing of its balance"
    landed = loop.step_to(0.3 * STROKE_M)[-1]
    assert landed.decision.inhibit_reason is InhibitReason.NOTHING
    assert abs(loop.valve.position_m - 0.3 * STROKE_M) <= LANDED_M
    wide = loop.step_to(0.99 * STROKE_M)[-1]
    assert wide.decision.command_pa == daemon_file().pressure.maximum_pa
    assert loop.valve.position_m > STROKE_M - 1e-4


def test_without_a_cutoff_it_is_positioned_beside_its_seat() -> None:
    loop = identified(MIDWAY)
    beside = loop.step_to(0.008 * STROKE_M)[-1]
    assert beside.decision.inhibit_reason is not InhibitReason.CUT_OFF
    assert abs(loop.valve.position_m - 0.008 * STROKE_M) < 0.002 * STROKE_M
