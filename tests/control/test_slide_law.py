"""The law of slides and the staircase: on simulated valves at slow loops, and what they may not do."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
from math import exp, pi, sqrt
from typing import Any

import numpy as np
import pytest

from config.codes import Fault, InhibitReason, Mode, Ne107Cause, State
from config.daemon_file import DaemonFile, HealthTable
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.control.controller_memory import Decision
from positioner.control.laws.slides.slide_bounds import SlideThresholds
from positioner.control.requests import Requests
from positioner.daemon.health import Health, ne107_condition
from positioner.daemon.health.valve_health import HealthSettings
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
SLOPE_PA_PER_M = VALVE.spring_n_per_m / VALVE.diaphragm_area_m2
FRICTION_PA = VALVE.coulomb_n / VALVE.diaphragm_area_m2
LEAST = (VALVE.static_n - VALVE.coulomb_n) / VALVE.spring_n_per_m / STROKE_M
STEPS_PU = (0.003, -0.0015, 0.04, 0.001, -0.006, -0.09, 0.002, 0.12, -0.003, 0.004, 0.003, -0.004, -0.003, 0.006)
TAUGHT = 5
"""Steps by which break-away is known."""


class Loop:
    """A valve with a daemon's cycle under the law of slides, in virtual time."""

    def __init__(
        self,
        period_s: float,
        *effects: dict[str, object],
        typed: dict[str, float] | None = None,
        stribeck_velocity_m_per_s: float = VALVE.stribeck_velocity_m_per_s,
        **control: object,
    ) -> None:
        self.period_s = period_s
        daemon = {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": period_s},
            "safety": {"stale_after_s": 4 * period_s},
            "control": {"law": "slides", **control},
            "excitation": {"travel_window": (0.3, 0.9)},
            "law": typed,
            # A stem that a test holds fast shows the same digit, as a frozen sensor does.
            "supervision": {"frozen_sensor": {"threshold": 0.0}},
        }
        slave = {
            "clock": {"mode": "lockstep", "period_s": period_s},
            "sensor": {"noise_std_m": 1e-5, "quantum_m": STROKE_M / 4096, "seed": 1},
        }
        valve = VALVE.model_dump() | {"stribeck_velocity_m_per_s": stribeck_velocity_m_per_s}
        self.valve = Valve.from_file(ValveFile.model_validate({"valve": valve, "effect": effects}), step_s=FINE_STEP_S)
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        self.cycle = virtual_cycle(
            DaemonFile.model_validate(daemon), device, Requests(mode=Mode.AUTOMATIC, mode_writes=1)
        )

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    def ask(self, **values: Any) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)

    def identify(self, within_s: float = 600.0) -> "Loop":
        for _ in run_identification(self.cycle, within_s, wait=False):
            pass
        return self

    def step_to(self, reference_pu: float, cycles: int = 150) -> np.ndarray:
        """Return the true stem, p.u., at every cycle."""
        writes = self.cycle.requests.reference_writes + 1
        self.ask(reference_m=reference_pu * STROKE_M, reference_writes=writes)
        path = []
        for _ in range(cycles):
            self.cycle.once()
            path.append(self.valve.indicated_m / STROKE_M)
        return np.array(path)


@cache
def _identified(period_s: float) -> Loop:
    return Loop(period_s).identify()


def identified(period_s: float = 0.05) -> Loop:
    """Return a loop of one's own; the one that it is copied from is identified once."""
    return deepcopy(_identified(period_s))


@pytest.mark.parametrize("period_s", [0.01, 0.2])
def test_small_steps_land_at_any_period_and_excursions_become_as_short_as_they_can_be(period_s: float) -> None:
    loop = identified(period_s)
    law = loop.decision.static_law
    assert abs(law.slope.value - SLOPE_PA_PER_M) < 3 * law.slope.std
    assert law.slope.std < 1e-3 * SLOPE_PA_PER_M
    at, beyond = 0.6, []
    loop.step_to(at)
    for step_pu in STEPS_PU:
        before, at = at, at + step_pu
        path = loop.step_to(at)
        assert abs(path[-1] - at) < 1e-3
        beyond.append(max(min(before, at) - path.min(), path.max() - max(before, at)))
    assert max(beyond) < 1.8 * LEAST
    assert max(beyond[-TAUGHT:]) < 1.15 * LEAST


@pytest.mark.parametrize(
    ("effect", "up_pa", "down_pa"),
    [
        ({"name": "preload", "force_n": 600.0}, FRICTION_PA + 9302.3, FRICTION_PA - 9302.3),
        ({"name": "asymmetric_friction", "asymmetry": 0.15}, 1.15 * FRICTION_PA, 0.85 * FRICTION_PA),
    ],
    ids=["preload", "asymmetry"],
)
def test_each_direction_has_its_own_friction(effect: dict[str, object], up_pa: float, down_pa: float) -> None:
    loop = Loop(0.05, effect).identify()
    law = loop.decision.static_law
    assert law.up.value == pytest.approx(up_pa, rel=3e-3)
    assert law.down.value == pytest.approx(down_pa, rel=3e-3)
    assert loop.decision.applied.ratios == law.ratios
    for at in (0.6, 0.603, 0.55):
        assert abs(loop.step_to(at)[-1] - at) < 1e-3


@pytest.mark.parametrize("viscous_ns_per_m", few_always([140.0, 260.0]), ids=["zeta 0.26", "zeta 0.49"])
def test_a_stem_that_swings_past_its_balance_lands_where_it_shall(viscous_ns_per_m: float) -> None:
    loop = Loop(0.05)
    loop.valve.change(viscous_ns_per_m=viscous_ns_per_m)
    loop.identify()
    law = loop.decision.static_law
    omega = (VALVE.spring_n_per_m / VALVE.mass_kg) ** 0.5
    zeta = viscous_ns_per_m / (2 * VALVE.mass_kg * omega)
    r = exp(-pi * zeta / (1 - zeta * zeta) ** 0.5)
    assert law.swing == pytest.approx(r / (1 + r), abs=0.01)
    assert abs(law.slope.value - SLOPE_PA_PER_M) < 3 * law.slope.std
    assert abs(law.up.value - FRICTION_PA) < 0.01 * FRICTION_PA
    assert abs(law.down.value - FRICTION_PA) < 0.01 * FRICTION_PA
    for at in (0.6, 0.603, 0.55, 0.7, 0.69):
        assert abs(loop.step_to(at)[-1] - at) < 1e-3


def test_friction_that_grows_over_the_travel_is_corrected_where_slides_land() -> None:
    loop = Loop(0.05, {"name": "position_friction", "growth": 0.3, "travel_m": STROKE_M}).identify()
    assert loop.decision.static_law.residual_m > 5e-3 * STROKE_M
    for at in (0.5, 0.503, 0.8, 0.79):
        assert abs(loop.step_to(at, cycles=300)[-1] - at) < 1e-3


def test_within_the_dead_band_nothing_moves() -> None:
    loop = Loop(0.05, dead_band=0.005).identify()
    loop.step_to(0.6)
    command_pa = loop.decision.command_pa
    loop.step_to(0.604)
    assert loop.decision.command_pa == command_pa


def test_an_excursion_beyond_the_limit_is_not_made_and_said() -> None:
    loop = Loop(0.05, excursion_limit=0.01).identify()
    loop.step_to(0.6)
    path = loop.step_to(0.61)
    assert np.ptp(path) < 1e-3
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_BEYOND_LIMIT


def test_under_a_reference_that_flickers_it_comes_to_rest() -> None:
    """Scatter like the dead band: once to its middle, if at all, then nothing."""
    loop = identified()
    loop.step_to(0.6)
    commands = []
    for flicker in np.random.default_rng(2).normal(0.0, 5e-4, 120):
        loop.step_to(0.6006 + float(flicker), cycles=10)
        commands.append(loop.decision.command_pa)
    assert len(set(commands)) <= 2
    assert abs(loop.valve.indicated_m / STROKE_M - 0.6006) < 5e-4


def test_excursions_keep_their_interval() -> None:
    loop = Loop(0.02, excursion_interval_s=24.0).identify()
    loop.step_to(0.7)
    loop.step_to(0.6, cycles=1300)
    assert abs(loop.step_to(0.605)[-1] - 0.605) < 1e-3
    waiting = loop.step_to(0.61, cycles=1000)  # longer than its rest is refined
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_WAITS
    assert np.ptp(waiting) < 1e-3
    assert abs(loop.step_to(0.61, cycles=200)[-1] - 0.61) < 1e-3


def test_excursions_cost_no_more_than_the_budget_of_a_day() -> None:
    """A day's travel may be spent at once: after two excursions there is nothing left for a third."""
    loop = Loop(0.2, excursion_budget_strokes_per_day=0.5).identify()
    loop.step_to(0.6)
    moved = [np.ptp(loop.step_to(at)) > LEAST for at in (0.604, 0.608, 0.612, 0.616)]
    assert moved == [True, True, False, False]
    assert loop.decision.inhibit_reason is InhibitReason.EXCURSION_BUDGET_SPENT
    assert abs(loop.step_to(0.7)[-1] - 0.7) < 1e-3, "a move that needs no excursion costs nothing"


def test_friction_is_known_no_better_than_a_stem_that_sticks_short_behind_a_slow_pressure_lets_it() -> None:
    """Its friction rises below 1 mm/s: all slides stick short alike, and no residual tells."""
    loop = Loop(0.02, {"name": "ip_lag", "time_constant_s": 0.1}, stribeck_velocity_m_per_s=1e-3).identify()
    law = loop.decision.static_law
    assert law.valid
    for found in (law.up, law.down):
        assert 0.005 * FRICTION_PA < found.value - FRICTION_PA < 2.0 * found.std
        assert found.std < 0.03 * FRICTION_PA


def test_a_loop_left_alone_does_nothing() -> None:
    loop = identified()
    loop.step_to(0.6)
    loop.step_to(0.604)
    commands = set()
    for _ in range(int(60.0 / loop.period_s)):
        loop.cycle.once()
        commands.add(loop.decision.command_pa)
    assert len(commands) == 1


def test_a_ramp_is_followed_by_slides_that_land_ahead_of_it_and_its_end_is_reached() -> None:
    """A sawtooth of half a slide either way, but for the first and the last, and hardly more travel than the ramp's."""
    loop = identified()
    loop.step_to(0.5)
    errors, paths = [], []
    for reference_pu in np.linspace(0.5, 0.8, 61):
        paths.append(loop.step_to(float(reference_pu), cycles=10))
        errors.append(paths[-1][-1] - reference_pu)
    assert np.abs(errors).max() < 1.1 * LEAST
    assert np.sqrt(np.mean(np.square(errors))) < 1.3 * LEAST / sqrt(12)
    assert np.abs(np.diff(np.concatenate(paths))).sum() < 0.3 + 3 * LEAST
    assert abs(loop.step_to(0.8)[-1] - 0.8) < 1e-3


def test_two_slides_follow_a_slow_ramp_only_when_they_save_more_than_they_cost() -> None:
    """0.13 % a second: two slides every 2 s had the stem away most of the time, 50 strokes for one."""
    loop = identified(0.1)
    for at in (0.5, *(2 * (0.503, 0.5, 0.497, 0.5))):  # break-away is learnt
        loop.step_to(at, cycles=60)
    references = np.repeat(0.5 + 0.04 / 60 * np.arange(60), 5)
    path = np.concatenate([loop.step_to(float(each), cycles=5) for each in references[::5]])
    assert np.abs(np.diff(path)).sum() < 0.04 + 4 * 2 * 1.3 * LEAST
    least_rms = LEAST / np.sqrt(12.0)  # what a stem leaves that can only jump by LEAST
    assert np.sqrt(np.mean(np.square(path - references))) < 1.3 * least_rms
    assert abs(loop.step_to(0.54)[-1] - 0.54) < 1e-3


def test_noise_of_a_reference_is_not_chased_and_what_stays_of_it_is_reached() -> None:
    loop = identified()
    loop.step_to(0.6)
    for noise in np.random.default_rng(0).normal(0.0, 2e-3, 40):
        path = loop.step_to(0.6 + float(noise), cycles=10)
    assert np.ptp(path) < 1e-3
    assert loop.decision.inhibit_reason is InhibitReason.REFERENCE_COMES
    assert abs(loop.step_to(0.603)[-1] - 0.603) < 1e-3


def test_steps_to_and_fro_within_the_scan_of_a_dcs_are_each_reached_once() -> None:
    """The last of them stands: the stem does not leave it for the middle of those before."""
    loop = identified(0.02)
    for at in (0.5, 0.4, 0.55, 0.45):
        assert abs(loop.step_to(at, cycles=50)[-1] - at) < 1e-3
    path = loop.step_to(0.6, cycles=350)
    assert np.abs(np.diff(path)).sum() < 0.16
    assert abs(path - 0.6)[25:].max() < 1e-3


STUCK_N = 20e3
"""More than the spring and any pressure allowed overcome."""
NEW_HEALTH = Health(HealthSettings.of(HealthTable(), STROKE_M))


def stuck_at(loop: Loop, reference_pu: float, seconds: float = 20.0) -> list[float]:
    """Return the pressures, Pa, that a reference draws from a stem that nothing breaks loose, and set it free again."""
    loop.valve.change(static_n=STUCK_N, coulomb_n=STUCK_N)
    loop.step_to(reference_pu, cycles=0)
    given_pa = [loop.decision.command_pa]
    for _ in range(round(seconds / loop.period_s)):
        loop.cycle.once()
        if loop.decision.command_pa != given_pa[-1]:
            given_pa.append(loop.decision.command_pa)
    return given_pa


def free(loop: Loop) -> None:
    loop.valve.change(static_n=VALVE.static_n, coulomb_n=VALVE.coulomb_n)


@pytest.mark.parametrize(
    "control",
    few_always([{}, {"excursion_limit": 0.08}, {"excursion_interval_s": 5.0}]),
    ids=["as shipped", "a short excursion", "an interval"],
)
def test_a_stem_that_nothing_breaks_loose_is_stuck_whichever_bound_is_met_first(control: dict[str, Any]) -> None:
    loop = Loop(0.05, **control).identify()
    loop.step_to(0.5, cycles=400)
    given_pa = stuck_at(loop, 0.6)
    assert loop.decision.inhibit_reason is InhibitReason.STUCK
    assert ne107_condition(loop.decision, NEW_HEALTH).cause is Ne107Cause.STUCK
    assert 3 < len(given_pa) < SlideThresholds().most_slides, "tried, and not until the number of slides ends it"
    held = set(given_pa[-1:])
    for _ in range(round(30.0 / loop.period_s)):
        loop.cycle.once()
        held.add(loop.decision.command_pa)
    assert len(held) == 1
    path = loop.step_to(0.3, cycles=400)
    assert np.ptp(path) < 1e-3
    assert loop.decision.command_pa < given_pa[0], "the next reference is tried"
    assert loop.decision.inhibit_reason is InhibitReason.STUCK


def test_a_stem_that_comes_free_goes_to_its_reference_and_is_as_movable_as_before() -> None:
    loop = identified()
    for at in (0.5, 0.503, 0.6, 0.597, 0.5):
        loop.step_to(at)
    stuck_at(loop, 0.6)
    free(loop)
    path = loop.step_to(0.6, cycles=200)
    assert path.max() < 0.601, "not where the last push would have brought it"
    assert abs(path[-1] - 0.6) < 1e-3
    assert loop.decision.inhibit_reason is InhibitReason.NOTHING
    for at in (0.55, 0.553, 0.8, 0.5, 0.503):
        path = loop.step_to(at)
        assert abs(path[-1] - at) < 1e-3
    assert path.max() < 0.503 + 1.15 * LEAST


def test_a_stem_held_for_small_moves_is_tried_again_and_lands_where_it_shall() -> None:
    """Stuck for references a per cent away: pressures alone do not move it when it comes free, the next tries do."""
    loop = identified()
    loop.step_to(0.5)
    loop.step_to(0.503)
    stuck_at(loop, 0.513)
    assert loop.decision.inhibit_reason is InhibitReason.STUCK
    free(loop)
    assert abs(loop.step_to(0.513, cycles=1400)[-1] - 0.513) < 1e-3, "two slides come back a minute"
    assert not loop.decision.inhibit_reason


TYPED = {"b_over_c_pa_per_m": -SLOPE_PA_PER_M, "k_over_c_pa": -FRICTION_PA}
"""A law that says nothing of static friction: the first margin is a guess, 2.7 % of the stroke."""


def typed_loop(margin_pu: float) -> Loop:
    loop = Loop(0.05, typed=TYPED)
    loop.valve.change(static_n=VALVE.coulomb_n + margin_pu * STROKE_M * VALVE.spring_n_per_m)
    loop.step_to(0.5, cycles=400)
    return loop


@pytest.mark.parametrize(("margin_pu", "seed"), few_always([(0.09, 4), (0.12, 4), (0.15, 1), (0.15, 5)]))
def test_a_healthy_stem_is_not_stuck_where_only_a_guess_says_that_it_should_have_slid(
    margin_pu: float, seed: int
) -> None:
    """Its margin is three to five times the guess, and references come before a move has ended."""
    loop = typed_loop(margin_pu)
    rng = np.random.default_rng(seed)
    why, at = set(), 0.5
    for step_pu in rng.choice((0.003, 0.02, 0.05, 0.1, 0.3), 14) * rng.choice((-1, 1), 14):
        at += step_pu if 0.25 < at + step_pu < 0.85 else -step_pu
        loop.step_to(float(at), cycles=int(rng.choice((60, 400))))
        why.add(loop.decision.inhibit_reason)
    assert InhibitReason.STUCK not in why


def test_nor_is_one_between_whose_references_two_masters_go_to_and_fro() -> None:
    """Each slide of 3 % is longer than the guess and holds; none longer is given, for the other reference comes."""
    loop = typed_loop(0.09)
    why = set()
    for _ in range(12):
        for at in (0.5, 0.53):
            loop.step_to(at, cycles=20)
            why.add(loop.decision.inhibit_reason)
    assert InhibitReason.STUCK not in why


def test_a_stuck_stem_is_told_where_only_a_guess_is_known_and_the_reference_is_near() -> None:
    """A band that widened with slides that held would end the move before a bound has shown it."""
    loop = typed_loop(0.05)
    given_pa = stuck_at(loop, 0.503, seconds=40.0)
    assert loop.decision.inhibit_reason is InhibitReason.STUCK
    assert len(given_pa) < SlideThresholds().most_slides


def test_the_staircase_stays_in_its_window_and_leaves_what_it_found_when_it_fails() -> None:
    """A stem that never moves: the pressure goes to its limits and back, and nothing is applied."""
    loop = Loop(0.05)
    loop.valve.change(static_n=1e6, coulomb_n=1e6)
    loop.identify(within_s=3000.0)
    assert loop.decision.applied.ratios is None
    assert loop.decision.state is not State.S3_IDENTIFY
    assert loop.decision.fault is Fault.NONE
