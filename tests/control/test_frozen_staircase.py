"""A position sensor that freezes in S3 by a staircase: the stem is not driven out of the window unseen."""

from dataclasses import replace
from functools import cache
from math import inf, nan

import pytest

from benchmarks.sensor_faults import SensorFault, Spoilt
from config.codes import Fault, InhibitReason, Mode, State
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.daemon.cycle import Cycle
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always

STROKE_M, LOW, HIGH = 0.04, 0.1, 0.9
START_PA = 60e3
PERIODS_S = (0.02, 0.1)
VALVE = {
    "name": "FV",
    "mass_kg": 6.0,
    "diaphragm_area_m2": 0.032,
    "spring_n_per_m": 64e3,
    "viscous_ns_per_m": 1500.0,
    "coulomb_n": 430.0,
    "static_n": 580.0,
    "stribeck_velocity_m_per_s": 0.005,
    "deadzone_ratio": 1e-4,
    "stroke_m": STROKE_M,
}
"""A bench range of 80 kPa of the 140 kPa that are allowed."""
EFFECTS = (
    {"name": "preload", "force_n": 640.0},
    {"name": "asymmetric_friction", "asymmetry": 0.16},
    {"name": "ip_lag", "time_constant_s": 0.06},
    {"name": "end_stop", "lower_m": 0.0, "travel_m": STROKE_M, "stiffness_n_per_m": 4e7, "damping_ns_per_m": 4e4},
)


class Reversed(Spoilt):
    """A device whose position counts the other way round, as an air-to-close valve's does from its closed end."""

    def _measure(self) -> None:
        self.position_m = STROKE_M - self._device.position_m


class Frozen:
    """A valve whose sensor freezes a time after S3 began, or counts the other way round."""

    def __init__(self, period_s: float, after_s: float, *, is_reversed: bool = False) -> None:
        file = ValveFile.model_validate({"valve": VALVE, "effect": EFFECTS})
        self.valve = Valve.from_file(file, step_s=FINE_STEP_S)
        self.valve.rest_at(0.5 * STROKE_M, START_PA)
        slave = {
            "clock": {"mode": "lockstep", "period_s": period_s},
            "sensor": {"noise_std_m": 2e-4 * STROKE_M, "quantum_m": STROKE_M / 4096, "seed": 7},
        }
        good = Device(self.valve, SlaveFile.model_validate(slave), {})
        device = (Reversed if is_reversed else Spoilt)(good, SensorFault(1.0 + after_s, inf, nan))
        daemon = {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": period_s},
            "pressure": {"maximum_pa": 140e3},
            "safety": {"stale_after_s": 4 * period_s},
            "control": {"law": "slides"},
            "excitation": {"travel_window": (LOW, HIGH)},
        }
        first = Requests(mode=Mode.AUTOMATIC, mode_writes=1)
        self.cycle: Cycle = virtual_cycle(DaemonFile.model_validate(daemon), device, first)
        self.until(1.0)
        self.before_pa = self.decision.command_pa
        self.cycle.requests = replace(self.cycle.requests, eta=(0, 0, 0))

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    def until(self, time_s: float, *, s3: bool = False) -> list[tuple[float, Decision]]:
        """Return the true stem, of the stroke, and the decision of every cycle, until a time or the end of S3."""
        seen = []
        while self.cycle.snapshot.sample.now_s < time_s:
            self.cycle.once()
            seen.append((self.valve.position_m / STROKE_M, self.decision))
            if s3 and (self.decision.state is not State.S3_IDENTIFY or self.decision.progress >= 1.0):
                break
        return seen


GONE_ON_S, MARGIN = 14.0, 0.02
"""When the stem has gone on once, at either period; of the stroke, about the window."""


@cache
def whole_s(period_s: float) -> float:
    """Return how long S3 takes with a good sensor, s."""
    path = Frozen(period_s, inf).until(300.0, s3=True)
    assert path[-1][1].progress == 1.0
    return period_s * len(path)


@pytest.mark.parametrize("share", few_always([0.1, 0.6, 0.0, 0.25, 0.4, 0.5, 0.75, 0.9], 2))
@pytest.mark.parametrize("period_s", PERIODS_S)
def test_a_stem_that_is_not_seen_any_more_is_not_driven_out_of_the_window(period_s: float, share: float) -> None:
    """Frozen while it goes on, in a turn, in the last one: by 23, or by the monitor's fault in the first turn."""
    after_s = GONE_ON_S + share * (whole_s(period_s) - GONE_ON_S)
    valve = Frozen(period_s, after_s)
    path = valve.until(300.0, s3=True)[int(after_s / period_s) :]
    stem = [each for each, _ in path]
    assert min(stem) > LOW - MARGIN
    assert max(stem) < HIGH + MARGIN
    ended = valve.decision
    assert (ended.state, ended.command_pa) == (State.S0_START, valve.before_pa), "the command before S3 is held"
    by_monitor = ended.fault is Fault.FROZEN_SENSOR
    assert by_monitor or (ended.fault, ended.inhibit_reason) == (Fault.NONE, InhibitReason.STAIRCASE_UNANSWERED)


def test_after_it_nothing_moves_until_the_dcs_asks_for_something_else() -> None:
    """The law has a static law, and a reference: it would follow a position that is none."""
    valve = Frozen(0.1, inf)
    valve.until(1.0 + whole_s(0.1) + 1.0)
    valve.cycle.requests = replace(valve.cycle.requests, eta=QUIET, reference_m=0.02, reference_writes=1)
    valve.until(valve.cycle.snapshot.sample.now_s + 10.0)
    before, applied = valve.decision.command_pa, valve.decision.applied
    assert applied.ratios is not None
    valve.cycle.requests = replace(valve.cycle.requests, eta=(0, 0, 0))
    began_s = valve.cycle.snapshot.sample.now_s
    valve.until(began_s + 15.0)
    valve.valve.change(static_n=1e6, coulomb_n=1e6)
    valve.until(began_s + 100.0, s3=True)
    ended = valve.decision
    valve.cycle.requests = replace(valve.cycle.requests, reference_m=0.03, reference_writes=2)
    held = valve.until(valve.cycle.snapshot.sample.now_s + 10.0)
    assert ended.inhibit_reason is InhibitReason.STAIRCASE_UNANSWERED
    assert {(each.state, each.command_pa, each.inhibit_reason) for _, each in held} == {
        (State.S0_START, before, InhibitReason.STAIRCASE_UNANSWERED)
    }
    valve.cycle.requests = replace(valve.cycle.requests, eta=QUIET)
    assert valve.until(valve.cycle.snapshot.sample.now_s + 1.0)[-1][1].state is State.S1_UP


@pytest.mark.parametrize("period_s", PERIODS_S)
def test_a_stem_that_goes_against_the_pressure_is_not_driven_on(period_s: float) -> None:
    """It went to its stop, and S3 on to the highest pressure, and then said that its landings were too few."""
    valve = Frozen(period_s, inf, is_reversed=True)
    asked = replace(valve.cycle.requests, eta=QUIET, mode=Mode.MANUAL, mode_writes=2)
    valve.cycle.requests = replace(asked, manual_pa=START_PA, manual_writes=1)
    valve.until(10.0)
    valve.cycle.requests = replace(valve.cycle.requests, mode=Mode.AUTOMATIC, mode_writes=3, eta=(0, 0, 0))
    path = valve.until(300.0, s3=True)
    ended = valve.decision
    assert (ended.state, ended.command_pa) == (State.S0_START, START_PA), "the command before S3 is held"
    assert (ended.fault, ended.inhibit_reason) == (Fault.NONE, InhibitReason.STAIRCASE_REVERSED)
    assert ended.applied.ratios is None
    assert min(stem for stem, _ in path) > LOW
    assert max(stem for stem, _ in path) < HIGH
