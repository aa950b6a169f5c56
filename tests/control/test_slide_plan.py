"""Which slides bring a stem to its reference: by hand."""

from dataclasses import replace

import pytest

from config.codes import InhibitReason
from positioner.control.laws.slides.plan import Plan
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_memory import Anchor
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import MIDDLE, BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import VISIBLE
from tests.control.scripted_stem import SETTINGS, SLOPE_PA_PER_M, STROKE_M

FRICTION_PA = 20e3
KNOWN, LONG, SHORT = (Interval(0.99 * each, each, seen=True) for each in (5.6e-3, 10e-3, 5e-3))
PLAN = Plan(
    bounds=SETTINGS,
    balance=Balance(ratios=Ratios(-SLOPE_PA_PER_M, -FRICTION_PA), landings=(), held=(), stroke_m=STROKE_M),
    distances=BreakawayDistance(KNOWN, KNOWN, KNOWN, KNOWN),
    local=MIDDLE,
    anchor=Anchor(0.0595, 1),
    from_m=0.0595,
    target_m=0.06,
    quantum_m=0.0,
    preslides=True,
    surely=False,
)
TURNING_IS_SHORT = replace(PLAN, distances=BreakawayDistance(LONG, LONG, SHORT, SHORT))


def test_an_excursion_goes_by_the_shorter_way_round() -> None:
    """By its side it would go on by 1 % of the stroke; round the other it turns, by half of that."""
    first, other = TURNING_IS_SHORT.excursions(begun=False)
    assert (first.direction, other.direction) == (-1, 1)
    assert first.by_m == pytest.approx(0.06 - 5.5e-3)
    assert first.beyond_m == pytest.approx(5e-3), "half a millimetre of it is the way between"


@pytest.mark.parametrize(("begun", "direction"), [(False, -1), (True, 1)])
def test_the_shorter_way_round_leaves_what_lies_between_stem_and_reference_least(begun: bool, direction: int) -> None:
    """A stem that a slide of the move has left there is off the way already."""
    plan = replace(TURNING_IS_SHORT, from_m=0.057, anchor=Anchor(0.057, 1))
    assert plan.excursions(begun=begun)[0].direction == direction


def test_the_way_back_has_room_for_what_sensor_and_device_round() -> None:
    assert PLAN.back_m(-1) == pytest.approx(1.02 * 5.6e-3)
    rough = replace(PLAN, quantum_m=1e-4, bounds=replace(SETTINGS, command_step_pa=400.0))
    assert rough.back_m(-1) == pytest.approx(1.02 * 5.6e-3 + 0.5e-4 + 200.0 / SLOPE_PA_PER_M)
    tiny = replace(rough, distances=BreakawayDistance(*(4 * [Interval(0.9e-4, 1e-4, seen=True)])))
    seen_m = VISIBLE * STROKE_M + rough.rounded_m
    assert tiny.back_m(-1) == pytest.approx(seen_m), "one that only has to be seen is seen, however it is rounded"


def test_each_bound_bars_an_excursion() -> None:
    up, _down = PLAN.excursions(begun=False)
    assert PLAN.barred(up) is InhibitReason.NOTHING
    near = replace(PLAN, bounds=replace(SETTINGS, excursion_limit_m=1e-3))
    assert near.barred(up) is InhibitReason.EXCURSION_BEYOND_LIMIT
    far = replace(PLAN, from_m=PLAN.target_m + 5e-3, bounds=replace(SETTINGS, excursion_limit_m=8e-3))
    around = next(each for each in far.excursions(begun=False) if each.by_m > far.from_m)
    assert around.by_m - far.target_m > 8e-3 > around.by_m - far.from_m
    assert far.barred(around) is InhibitReason.NOTHING, "what counts is how far beyond the move it goes"
    beyond = replace(PLAN, target_m=0.0985)
    assert {beyond.barred(each) for each in beyond.excursions(begun=False)} >= {InhibitReason.EXCURSION_BEYOND_LIMIT}
    low = replace(PLAN, target_m=(FRICTION_PA - 1e3) / SLOPE_PA_PER_M, from_m=0.027, anchor=None)
    assert {low.barred(each) for each in low.excursions(begun=False)} == {InhibitReason.LAW_BEYOND_LIMITS}


@pytest.mark.parametrize(
    ("position_m", "lands_m"),
    [(0.0605, 0.06), (0.062, 0.06), (0.0645, 0.06 - (1.02 * 5.6e-3 - 4.5e-3)), (0.066, 0.06)],
    ids=["hardly away", "it stays", "it goes to the other side", "it comes back"],
)
def test_what_is_held_if_an_excursion_is_interrupted_brings_the_stem_as_near_as_it_can(
    position_m: float, lands_m: float
) -> None:
    assert PLAN.back_pa(1, position_m, 0.0) == pytest.approx(PLAN.balance.pressure_pa(lands_m, -1))


def test_a_way_longer_than_an_excursion_may_be_is_not_asked_for_where_a_shorter_one_may_do() -> None:
    """Up it held 5 %, and 60 % broke it loose; an excursion may be 50 %, twice 10 % is tried first."""
    wide = Interval(5e-3, 60e-3, seen=True)
    plan = replace(PLAN, distances=BreakawayDistance(*(4 * [wide])), surely=True)
    assert plan.way_m(1) == pytest.approx(20e-3)
    assert replace(plan, bounds=replace(SETTINGS, excursion_limit_m=15e-3)).way_m(1) == pytest.approx(10e-3)
