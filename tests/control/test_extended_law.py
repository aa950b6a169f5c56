"""The law of slides with an extended valve: small steps on valves that no straight law describes land at once."""

from dataclasses import replace

import pytest

from benchmarks.extended_valve import STROKE_M, Course, Loop, typical
from config.codes import InhibitReason
from config.extended_valve import ExtendedValve, Inverse
from config.valve_file import ValveFile
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.estimation.landings.extended_balance import straight_law
from sim.composition import Composition
from sim.static_inverse import extended_valve
from tests.cases import few_always
from tests.sim.library import EFFECTS, SEED, library, theta_with

COURSE = Course(steps=15, period_s=0.02, step_s=1.3, seed=0)


def switched_on(name: str) -> tuple[Composition, ExtendedValve]:
    """Return the seed's valve with an effect, and what is known of it."""
    table = typical(EFFECTS[name])
    values = [float(each) for each in table.parameters.values()]
    composition = replace(library(), theta=theta_with(EFFECTS[name], values))
    return composition, extended_valve(ValveFile(valve=SEED.valve, effect=(table,)), name)


@pytest.mark.parametrize(
    "name", few_always(["pressure_friction", "backlash", "spring_hardening", "sensor_nonlinearity"], 2)
)
def test_the_stem_lands_where_the_reference_is_without_an_identification(name: str) -> None:
    composition, extended = switched_on(name)
    assert COURSE.outcome(composition, extended).rms < 1e-4


def test_the_first_slide_to_a_place_lands_there() -> None:
    composition, extended = switched_on("flow_force")
    loop = Loop(composition, extended, COURSE.period_s, seed=0)
    for share in (0.45, 0.62, 0.5):
        before = loop.cycle.snapshot.decision.command_pa
        loop.step_to(share * STROKE_M)
        assert loop.stand(1.5) == pytest.approx(share * STROKE_M, abs=1e-4 * STROKE_M)
        assert loop.cycle.snapshot.decision.command_pa != before


def test_a_reference_beyond_a_known_stop_ends_there_and_teaches_nothing() -> None:
    """By what the wall was missed the law went wherever it was sent: the valve shut, and stayed so."""
    composition, extended = switched_on("end_stop")
    _, stop_m = extended.stops_m
    assert stop_m == pytest.approx(0.85 * STROKE_M)
    loop = Loop(composition, extended, COURSE.period_s, seed=0)
    for share, lands_m in ((0.5, 0.5 * STROKE_M), (0.95, stop_m), (0.6, 0.6 * STROKE_M), (0.83, 0.83 * STROKE_M)):
        loop.step_to(share * STROKE_M)
        assert loop.stand(1.5) == pytest.approx(lands_m, abs=1e-3 * STROKE_M)
        beyond = share * STROKE_M > stop_m
        ended = InhibitReason.TRIM_ENDED if beyond else InhibitReason.NOTHING
        assert loop.cycle.snapshot.decision.inhibit_reason is ended
        assert loop.cycle.snapshot.decision.command_pa <= extended.landing_pa(share * STROKE_M, 1) + 1e3


def test_break_away_is_the_valves_own_over_its_travel() -> None:
    _, extended = switched_on("position_friction")
    balance = Balance(ratios=straight_law(extended), landings=(), held=(), stroke_m=STROKE_M, valve=extended)
    first = balance.first_distances(None)
    for share in (0.2, 0.8):
        for s in (1, -1):
            there = first.at(s, turning=True, local=balance.local(share * STROKE_M))
            assert there.sure_m == pytest.approx(1.02 * extended.margin_m(share * STROKE_M, s), rel=1e-6)


def test_lead_makes_a_slow_pressure_fast_enough() -> None:
    composition, extended = switched_on("ip_lag")
    short = replace(COURSE, step_s=1.25)
    assert short.outcome(composition, extended).rms < 1e-3
    unled = replace(extended, inverse=Inverse())
    assert short.outcome(composition, unled).rms > 1e-2


def test_what_is_held_when_the_daemon_leaves_is_no_lead() -> None:
    composition, extended = switched_on("ip_lag")
    loop = Loop(composition, extended, COURSE.period_s, seed=0)
    loop.step_to(0.6 * STROKE_M)
    for _ in range(50):
        loop.cycle.once()
        controller = loop.controller
        if controller.command_pa != controller.left_pa:
            break
    assert controller.command_pa > controller.left_pa + 1e3
    assert controller.left_pa == pytest.approx(extended.landing_pa(0.6 * STROKE_M, 1), rel=1e-3)
