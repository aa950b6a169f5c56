"""Which slides bring a stem to its reference: by hand."""

from dataclasses import replace

import pytest

from config.codes import InhibitReason
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.plan import Plan
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.slide_memory import Anchor, Move, SlideMemory
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import VISIBLE
from tests.control.scripted_stem import SETTINGS, SLOPE_PA_PER_M, STROKE_M

FRICTION_PA = 20e3
KNOWN, LONG, SHORT = (Interval(0.99 * each, each, seen=True) for each in (5.6e-3, 10e-3, 5e-3))


def plan(
    memory: SlideMemory,
    *,
    from_m: float = 0.0595,
    target_m: float = 0.06,
    quantum_m: float = 0.0,
    bounds: SlideBounds = SETTINGS,
) -> Plan:
    """Return a plan from one place to another, m, by what is remembered."""
    balance = Balance(ratios=Ratios(-SLOPE_PA_PER_M, -FRICTION_PA), landings=(), held=(), stroke_m=STROKE_M)
    now = Now(
        now_s=0.0,
        position_m=from_m,
        rest=None,
        quantum_m=quantum_m,
        reference_m=target_m,
        balance=balance,
        bounds=bounds,
    )
    return Plan(now, memory, from_m)


def knowing(onward: Interval, turning: Interval, landed: int = 0) -> SlideMemory:
    """Return the memory of a stem whose last slide went up."""
    return SlideMemory(
        command_pa=0.0,
        move=Move(SETTINGS.thresholds.most_slides, landed=landed),
        distances=BreakawayDistance(onward, onward, turning, turning),
        anchor=Anchor(0.0595, 1),
    )


MEMORY = knowing(KNOWN, KNOWN)


def test_an_excursion_goes_by_the_shorter_way_round() -> None:
    """By its side it would go on by 1 % of the stroke; round the other it turns, by half of that."""
    first, other = plan(knowing(LONG, SHORT)).excursions()
    assert (first.direction, other.direction) == (-1, 1)
    assert first.by_m == pytest.approx(0.06 - 5.5e-3)
    assert first.beyond_m == pytest.approx(5e-3), "half a millimetre of it is the way between"


@pytest.mark.parametrize(("landed", "direction"), [(0, -1), (1, 1)])
def test_the_shorter_way_round_leaves_what_lies_between_stem_and_reference_least(landed: int, direction: int) -> None:
    """A stem that a slide of the move has left there is off the way already."""
    assert plan(knowing(LONG, SHORT, landed=landed), from_m=0.057).excursions()[0].direction == direction


def test_the_way_back_has_room_for_what_sensor_and_device_round() -> None:
    assert plan(MEMORY).back_m(-1) == pytest.approx(1.02 * 5.6e-3)
    told_in_steps = replace(SETTINGS, command_step_pa=400.0)
    rough = plan(MEMORY, quantum_m=1e-4, bounds=told_in_steps)
    assert rough.back_m(-1) == pytest.approx(1.02 * 5.6e-3 + 0.5e-4 + 200.0 / SLOPE_PA_PER_M)
    short = Interval(0.9e-4, 1e-4, seen=True)
    tiny = plan(knowing(short, short), quantum_m=1e-4, bounds=told_in_steps)
    seen_m = VISIBLE * STROKE_M + rough.rounded_m
    assert tiny.back_m(-1) == pytest.approx(seen_m), "one that only has to be seen is seen, however it is rounded"


def test_each_bound_bars_an_excursion() -> None:
    up, _down = plan(MEMORY).excursions()
    assert plan(MEMORY).barred(up) is InhibitReason.NOTHING
    near = plan(MEMORY, bounds=replace(SETTINGS, excursion_limit_m=1e-3))
    assert near.barred(up) is InhibitReason.EXCURSION_BEYOND_LIMIT
    far = plan(MEMORY, from_m=0.065, bounds=replace(SETTINGS, excursion_limit_m=8e-3))
    around = next(each for each in far.excursions() if each.by_m > 0.065)
    assert around.by_m - 0.06 > 8e-3 > around.by_m - 0.065
    assert far.barred(around) is InhibitReason.NOTHING, "what counts is how far beyond the move it goes"
    beyond = plan(MEMORY, target_m=0.0985)
    assert {beyond.barred(each) for each in beyond.excursions()} >= {InhibitReason.EXCURSION_BEYOND_LIMIT}
    low = plan(replace(MEMORY, anchor=None), target_m=(FRICTION_PA - 1e3) / SLOPE_PA_PER_M, from_m=0.027)
    assert {low.barred(each) for each in low.excursions()} == {InhibitReason.LAW_BEYOND_LIMITS}


@pytest.mark.parametrize(
    ("position_m", "lands_m"),
    [(0.0605, 0.06), (0.062, 0.06), (0.0645, 0.06 - (1.02 * 5.6e-3 - 4.5e-3)), (0.066, 0.06)],
    ids=["hardly away", "it stays", "it goes to the other side", "it comes back"],
)
def test_what_is_held_if_an_excursion_is_interrupted_brings_the_stem_as_near_as_it_can(
    position_m: float, lands_m: float
) -> None:
    there = plan(MEMORY, from_m=position_m)
    assert there.back_pa(1, 0.0) == pytest.approx(there.now.balance.pressure_pa(lands_m, -1))


def test_a_way_longer_than_an_excursion_may_be_is_not_asked_for_where_a_shorter_one_may_do() -> None:
    """Up it held 5 %, and 60 % broke it loose; an excursion may be 50 %, twice 10 % is tried first."""
    wide = Interval(5e-3, 60e-3, seen=True)
    held = replace(knowing(wide, wide), move=Move(SETTINGS.thresholds.most_slides, held=True))
    assert plan(held).way_m(1) == pytest.approx(20e-3)
    assert plan(held, bounds=replace(SETTINGS, excursion_limit_m=15e-3)).way_m(1) == pytest.approx(10e-3)
