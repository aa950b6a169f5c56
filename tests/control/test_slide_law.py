"""The law of slides and the staircase: on simulated valves at slow loops, and what they may not do."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config.codes import Fault, InhibitReason, Mode, State
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.control.controller import Decision
from positioner.control.requests import Requests
from positioner.control.slide_law import Balance, step
from positioner.control.slide_memory import DAY_S, Margin, SlideMemory, SlideSettings, StemObservation
from positioner.control.staircase_excitation import Staircase, StaircaseLimits
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.stem_at_rest import Rest
from positioner.virtual.virtual_cycle import identified, virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
SLOPE_PA_PER_M = VALVE.spring_n_per_m / VALVE.diaphragm_area_m2
FRICTION_PA = VALVE.coulomb_n / VALVE.diaphragm_area_m2
LEAST = (VALVE.static_n - VALVE.coulomb_n) / VALVE.spring_n_per_m / STROKE_M
STEPS_PU = (0.003, -0.0015, 0.04, 0.001, -0.006, -0.09, 0.002, 0.12)


class Loop:
    """A valve with a daemon's cycle under the law of slides, in virtual time; the staircase has identified it."""

    def __init__(self, period_s: float, *effects: dict[str, object], identify: bool = True, **control: object) -> None:
        self.period_s = period_s
        daemon = {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": period_s},
            "safety": {"stale_after_s": 4 * period_s},
            "control": {"law": "slides", **control},
            "excitation": {"travel_window": (0.3, 0.9)},
        }
        slave = {
            "clock": {"mode": "lockstep", "period_s": period_s},
            "sensor": {"noise_std_m": 1e-5, "quantum_m": STROKE_M / 4096, "seed": 1},
        }
        self.valve = Valve.from_file(ValveFile.model_validate({"valve": VALVE.model_dump(), "effect": effects}))
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        self.cycle = virtual_cycle(
            DaemonFile.model_validate(daemon), device, Requests(mode=Mode.AUTOMATIC, mode_writes=1)
        )
        if identify:
            self.identify()

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    def ask(self, **values: Any) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)

    def identify(self, within_s: float = 600.0) -> None:
        for _ in identified(self.cycle, within_s, wait=False):
            pass

    def step_to(self, reference_pu: float, cycles: int = 150) -> np.ndarray:
        """Return the true stem, p.u., at every cycle."""
        writes = self.cycle.requests.reference_writes + 1
        self.ask(reference_m=reference_pu * STROKE_M, reference_writes=writes)
        path = []
        for _ in range(cycles):
            self.cycle.once()
            path.append(self.valve.indicated_m / STROKE_M)
        return np.array(path)


@pytest.mark.parametrize("period_s", [0.01, 0.05, 0.2])
def test_small_steps_land_at_any_period(period_s: float) -> None:
    loop = Loop(period_s)
    law = loop.decision.static_law
    assert abs(law.slope.value - SLOPE_PA_PER_M) < 3 * law.slope.std
    assert law.slope.std < 1e-3 * SLOPE_PA_PER_M
    at = 0.6
    loop.step_to(at)
    for step_pu in STEPS_PU:
        before, at = at, at + step_pu
        path = loop.step_to(at)
        assert abs(path[-1] - at) < 1e-3
        beyond = max(min(before, at) - path.min(), path.max() - max(before, at))
        assert beyond < 1.8 * LEAST


@pytest.mark.parametrize(
    ("effect", "up_pa", "down_pa"),
    [
        ({"name": "preload", "force_n": 600.0}, FRICTION_PA + 9302.3, FRICTION_PA - 9302.3),
        ({"name": "asymmetric_friction", "asymmetry": 0.15}, 1.15 * FRICTION_PA, 0.85 * FRICTION_PA),
    ],
    ids=["preload", "asymmetry"],
)
def test_each_direction_has_its_own_friction(effect: dict[str, object], up_pa: float, down_pa: float) -> None:
    loop = Loop(0.05, effect)
    law = loop.decision.static_law
    assert law.up.value == pytest.approx(up_pa, rel=3e-3)
    assert law.down.value == pytest.approx(down_pa, rel=3e-3)
    assert loop.decision.applied.ratios == law.ratios
    for at in (0.6, 0.603, 0.55):
        assert abs(loop.step_to(at)[-1] - at) < 1e-3


def test_friction_that_grows_over_the_travel_is_corrected_where_slides_land() -> None:
    loop = Loop(0.05, {"name": "position_friction", "growth": 0.3, "travel_m": STROKE_M})
    assert loop.decision.static_law.residual_m > 5e-3 * STROKE_M
    for at in (0.5, 0.503, 0.8, 0.79):
        assert abs(loop.step_to(at, cycles=300)[-1] - at) < 1e-3


def test_within_the_dead_band_nothing_moves() -> None:
    loop = Loop(0.05, dead_band=0.005)
    loop.step_to(0.6)
    command_pa = loop.decision.command_pa
    loop.step_to(0.604)
    assert loop.decision.command_pa == command_pa


def test_an_excursion_beyond_the_limit_is_not_made_and_said() -> None:
    loop = Loop(0.05, excursion_limit=0.01)
    loop.step_to(0.6)
    path = loop.step_to(0.61)
    assert np.ptp(path) < 1e-3
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_BEYOND_LIMIT


def test_excursions_keep_their_interval() -> None:
    loop = Loop(0.05, excursion_interval_s=20.0)
    loop.step_to(0.6)
    assert abs(loop.step_to(0.605)[-1] - 0.605) < 1e-3
    waiting = loop.step_to(0.61)
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_WAITS
    assert np.ptp(waiting) < 1e-3
    assert abs(loop.step_to(0.61, cycles=500)[-1] - 0.61) < 1e-3


def test_excursions_cost_no_more_than_the_budget_of_a_day() -> None:
    """A day's travel may be spent at once: after two excursions there is nothing left for a third."""
    loop = Loop(0.2, excursion_budget_strokes_per_day=0.35)
    loop.step_to(0.6)
    moved = [np.ptp(loop.step_to(at)) > LEAST for at in (0.604, 0.608, 0.612, 0.616)]
    assert moved == [True, True, False, False]
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_BUDGET_SPENT
    assert abs(loop.step_to(0.7)[-1] - 0.7) < 1e-3, "a move that needs no excursion costs nothing"


def test_a_budget_comes_back_with_time() -> None:
    settings = SlideSettings(STROKE_M, 5e-5, 0.0, 420e3, None, 0.5 * STROKE_M, 0.0, budget_m_per_s=STROKE_M / DAY_S)
    memory = SlideMemory(excursion_s=100.0, spent_m=STROKE_M)
    assert memory.spent_at_m(100.0, settings) == STROKE_M
    assert memory.spent_at_m(100.0 + DAY_S / 4, settings) == pytest.approx(0.75 * STROKE_M)
    assert memory.spent_at_m(100.0 + 2 * DAY_S, settings) == 0.0


def test_a_loop_left_alone_does_nothing() -> None:
    loop = Loop(0.05)
    loop.step_to(0.6)
    loop.step_to(0.604)
    commands = set()
    for _ in range(int(600.0 / loop.period_s)):
        loop.cycle.once()
        commands.add(loop.decision.command_pa)
    assert len(commands) == 1


def test_a_ramp_is_followed_within_a_slide() -> None:
    loop = Loop(0.05)
    loop.step_to(0.5)
    errors = []
    for reference_pu in np.linspace(0.5, 0.8, 61):
        path = loop.step_to(float(reference_pu), cycles=10)
        errors.append(abs(path[-1] - reference_pu))
    assert max(errors) < 2 * LEAST
    assert abs(loop.step_to(0.8)[-1] - 0.8) < 1e-3


def test_the_staircase_stays_in_its_window_and_leaves_what_it_found_when_it_fails() -> None:
    """A stem that never moves: the pressure goes to its limits and back, and nothing is applied."""
    loop = Loop(0.05, identify=False)
    loop.valve.change(static_n=1e6, coulomb_n=1e6)
    loop.identify(within_s=3000.0)
    assert loop.decision.applied.ratios is None
    assert loop.decision.state is not State.S3_IDENTIFY
    assert loop.decision.fault is Fault.NONE


LIMITS = StaircaseLimits(low_m=0.1 * STROKE_M, high_m=0.9 * STROKE_M, minimum_pa=0.0, maximum_pa=420e3)


def outcome(direction: int, from_m: float, to_m: float) -> SlideOutcome:
    return SlideOutcome(0.0, direction, from_m, 1.0, to_m, 1e-6, from_m != to_m, from_m != to_m)


def test_steps_grow_until_the_stem_breaks_loose() -> None:
    stairs = Staircase(10e3).stepped(0.03, LIMITS)
    first_pa = stairs.step_pa
    assert stairs.direction == 1
    assert first_pa == pytest.approx(0.02 * 420e3)
    stairs = stairs.counted(outcome(1, 0.03, 0.03)).stepped(0.03, LIMITS)
    assert stairs.step_pa == pytest.approx(1.3 * first_pa)
    assert stairs.level_pa == pytest.approx(10e3 + 2.3 * first_pa)


def test_the_staircase_turns_round_before_it_leaves_the_window() -> None:
    stairs = replace(Staircase(80e3, direction=1, slide_m=0.01), rise_pa=5e3)
    assert stairs.counted(outcome(1, 0.075, 0.085)).stepped(0.085, LIMITS).direction == -1
    assert stairs.counted(outcome(1, 0.065, 0.075)).stepped(0.075, LIMITS).direction == 1


@pytest.mark.parametrize(("landed_m", "longer"), [(0.06, False), (0.0585, True)])
def test_a_short_slide_that_misses_its_aim_makes_the_margin_longer(landed_m: float, longer: bool) -> None:
    """Held elastically, a stem gives way by some per cent before it breaks loose: that was no slide."""
    margin = Margin(0.005, broke=True, held=True)
    memory = SlideMemory(target_m=0.06, direction=-1, up=margin, down=margin)
    rest = Rest(landed_m, 1e-6, 1e-6, 100, 0.1)
    came = SlideOutcome(1.0, -1, 0.0655, 27e3, landed_m, 1e-6, True, True)
    observation = StemObservation(1.0, landed_m, True, rest, 0.0, came)
    balance = Balance(Ratios(-SLOPE_PA_PER_M, -FRICTION_PA), (), (), STROKE_M)
    settings = SlideSettings(STROKE_M, 5e-5, 0.0, 420e3, None, 0.5 * STROKE_M, 0.0)
    after = step(memory, observation, 0.06, balance, settings)
    assert (after.down.way_m > 0.006) is longer
    assert after.up == margin


def test_a_margin_falls_while_slides_break_loose_and_rises_when_one_does_not() -> None:
    margin = Margin().after(0.06, moved=True)
    assert margin.way_m == pytest.approx(0.85 * 0.06)
    assert margin.after(0.2, moved=True).way_m == margin.way_m, "a long slide says nothing of it"
    assert margin.after_miss(margin.way_m).way_m == pytest.approx(1.2 * margin.way_m)
    assert margin.after_miss(0.2).way_m == margin.way_m, "a long slide that misses is the balance's error"
    raised = margin.after(margin.way_m, moved=False)
    assert raised.way_m == pytest.approx(1.06 * margin.way_m)
    assert raised.after(raised.way_m, moved=True).way_m == pytest.approx(0.999 * raised.way_m)
