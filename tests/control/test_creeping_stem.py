"""A stem that never rests: below break-away its packing flows, as soft ones do, so that it creeps on under its load."""

import numpy as np

from config.codes import InhibitReason, Ne107Cause, Ne107Status, State
from config.daemon_file import DaemonFile
from positioner.daemon.health import ne107_condition
from positioner.estimation.landings.static_law import StaticLaw
from positioner.estimation.landings.stem_at_rest import Rest, RestWindow
from tests.control.virtual_loop import VirtualLoop, assert_static_law

STROKE_M, AREA_M2, SPRING_N_PER_M, PRELOAD_N, COULOMB_N, VISCOUS_NS_PER_M = 0.04, 0.07, 140e3, 1400.0, 400.0, 2100.0
PERIOD_S, SUBSTEP_S, QUANTUM_M = 0.1, 2e-3, 2.5e-6
SLOW, FAST = 2e7, 2e6
"""N s/m: creeps of 20 and 200 um/s under the friction that a slide leaves, 3 % and 30 % of the stroke a minute."""
GOOD_PA = 140e3
MIDDLE_PA = (SPRING_N_PER_M * 0.5 * STROKE_M + PRELOAD_N) / AREA_M2


class CreepingValve:
    """A stem without inertia that goes F/flow_ns_per_m fast under less than F_c, and slides under more."""

    sample_counter = 0
    status = 0

    def __init__(self, flow_ns_per_m: float) -> None:
        self.flow_ns_per_m, self.supply_pa = flow_ns_per_m, GOOD_PA
        self.stem_m = self.position_m = 0.5 * STROKE_M
        self.command_pa = self.pressure_pa = MIDDLE_PA

    @property
    def device_time_us(self) -> int:
        return round(1e6 * PERIOD_S * self.sample_counter)

    def tick(self, command_pa: float) -> None:
        self.command_pa, self.pressure_pa = command_pa, min(command_pa, self.supply_pa)
        self.sample_counter += 1
        for _ in range(round(PERIOD_S / SUBSTEP_S)):
            force_n = AREA_M2 * self.pressure_pa - PRELOAD_N - SPRING_N_PER_M * self.stem_m
            held_n = min(max(force_n, -COULOMB_N), COULOMB_N)
            speed = (force_n - held_n) / VISCOUS_NS_PER_M + held_n / self.flow_ns_per_m
            self.stem_m = min(max(self.stem_m + speed * SUBSTEP_S, 0.0), STROKE_M)
        self.position_m = QUANTUM_M * round(self.stem_m / QUANTUM_M)


class Loop(VirtualLoop):
    """The valve under the law of slides, which knows its static law."""

    def __init__(self, flow_ns_per_m: float) -> None:
        daemon = {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "pressure": {"maximum_pa": 140e3},
            "safety": {"stale_after_s": 4 * PERIOD_S},
            "control": {"law": "slides"},
            "law": {
                "b_over_c_pa_per_m": -SPRING_N_PER_M / AREA_M2,
                "k_over_c_pa": -COULOMB_N / AREA_M2,
                "offset_pa": PRELOAD_N / AREA_M2,
            },
        }
        self.valve = CreepingValve(flow_ns_per_m)
        super().__init__(DaemonFile.model_validate(daemon), self.valve)

    def step_to(self, reference_pu: float, for_s: float) -> float:
        """Return the error in the end, as a share of the stroke."""
        self.refer_to(reference_pu, for_s)
        return self.valve.stem_m / STROKE_M - reference_pu


def assert_true(law: StaticLaw) -> None:
    up_pa, down_pa = (COULOMB_N + PRELOAD_N) / AREA_M2, (COULOMB_N - PRELOAD_N) / AREA_M2
    assert_static_law(law, SPRING_N_PER_M / AREA_M2, up_pa, down_pa)


def test_a_valve_that_creeps_after_each_slide_is_identified() -> None:
    loop = Loop(SLOW)
    loop.begin()
    loop.cycles(100.0)
    law = loop.decision.static_law
    loop.end()
    assert loop.decision.applied.ratios == law.ratios
    assert_true(law)


def test_an_identification_waits_for_the_supply() -> None:
    loop = Loop(SLOW)
    loop.begin()
    loop.cycles(25.0)
    loop.valve.supply_pa = 50e3
    loop.cycles(60.0)
    waited = loop.why
    loop.valve.supply_pa = GOOD_PA
    loop.cycles(200.0)
    loop.end()
    assert waited is InhibitReason.PRESSURE_ELSEWHERE
    assert_true(loop.decision.static_law)


def test_a_stem_that_does_not_come_to_rest_off_its_reference_is_said() -> None:
    loop = Loop(FAST)
    error = loop.step_to(0.6, 20.0)
    decision = loop.decision
    assert abs(error) > 0.03
    assert decision.inhibit_reason is InhibitReason.NOT_AT_REST
    condition = ne107_condition(decision, loop.health)
    assert (condition.status, condition.cause) == (Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.NOT_AT_REST)


def test_it_is_said_no_more_once_the_stem_rests() -> None:
    loop = Loop(FAST)
    loop.step_to(0.6, 60.0)
    loop.valve.flow_ns_per_m = 1e12
    assert abs(loop.step_to(0.5, 20.0)) < 1e-3
    assert loop.decision.inhibit_reason is InhibitReason.NOTHING


def test_a_staircase_says_what_it_waits_for() -> None:
    loop = Loop(FAST)
    loop.begin()
    loop.cycles(30.0)
    decision = loop.decision
    assert (decision.state, decision.inhibit_reason) == (State.S3_IDENTIFY, InhibitReason.NOT_AT_REST)


def rests(time_s: np.ndarray, position_m: np.ndarray) -> list[Rest]:
    window = RestWindow(STROKE_M)
    found = []
    for at_s, at_m in zip(time_s.tolist(), position_m.tolist(), strict=True):
        window.add(at_s, at_m, np.nan)
        if window.rest is not None:
            found.append(window.rest)
    return found


def test_what_creeps_after_a_slide_stands_where_it_is_and_says_how_far_it_crept() -> None:
    time_s = np.arange(0.0, 3.0, 0.05)
    position_m = np.where(time_s > 0.0, 4e-3, 0.0) + 5e-5 * time_s
    rest = rests(time_s, position_m)[-1]
    assert abs(rest.position_m - position_m[-1]) < 0.1 * rest.crept_m
    assert abs(rest.crept_m - 0.75 * 5e-5 * time_s[-1]) < 0.1 * rest.crept_m


def test_no_answer_of_a_slow_pressure_is_taken_for_a_creep() -> None:
    """Lags, one or two, dead times and rate limits: the stem that follows them is waited for to the end."""
    time_s = np.arange(0.0, 40.0, 0.05)
    for dead_s in (0.0, 2.0):
        for ramp_s in (0.05, 3.0):
            pressure = np.clip((time_s - dead_s) / ramp_s, 0.0, 1.0)
            for _ in range(2):
                for i in range(1, time_s.size):
                    pressure[i] = pressure[i - 1] + 0.05 * (pressure[i] - pressure[i - 1])
                found = rests(time_s, 4e-3 * pressure)
                assert found
                assert not any(each.crept_m for each in found)
