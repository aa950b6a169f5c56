"""Short slides behind a slow I/P: they jump, and what they were sent is learnt from where they landed."""

import numpy as np
import pytest

from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import landing_pa, sliding_pa
from positioner.estimation.landings.short_slides import ALIKE, Sent, beyond_m, jumped_m, sent

STROKE_M, SLOPE, F_C = 0.1, 800e3, 20e3
MARGIN_M = 1e-3
RATIOS = Ratios(-SLOPE, -F_C)


def jumps_m(sent_m: float) -> float:
    """How much farther the valve of these tests goes: all that is sent a little too short jumps by the margin."""
    return 0.5 * max(0.0, 1.25 * MARGIN_M - sent_m)


def slide(from_m: float, sent_m: float, direction: int) -> SlideOutcome:
    lands_m = from_m + direction * (sent_m + jumps_m(sent_m))
    command_pa = SLOPE * (from_m + direction * sent_m) + direction * F_C
    return SlideOutcome(0.0, direction, from_m, command_pa, lands_m, 1e-6, moved=True, landing=True)


def asked_m(from_m: float, way_m: float, direction: int, landings: list[SlideOutcome]) -> float:
    """Return how far a slide that is to go a way is sent, m."""
    pa = sliding_pa(from_m, from_m + direction * way_m, direction, RATIOS, landings, STROKE_M)
    return direction * (pa - direction * F_C) / SLOPE - direction * from_m


LONG = [slide(x, way_m, s) for x, way_m in ((0.03, 0.02), (0.04, 0.03), (0.06, 0.025), (0.07, 0.02)) for s in (1, -1)]


@pytest.mark.parametrize("direction", [1, -1])
def test_a_short_slide_lands_after_a_few_where_all_were_sent_too_far(direction: int) -> None:
    landings, missed_m = list(LONG), []
    for x in np.linspace(0.03, 0.07, 10):  # each elsewhere: no landing is near the next
        asked = asked_m(float(x), 1.1 * MARGIN_M, direction, landings)
        landings.insert(0, slide(float(x), asked, direction))
        missed_m.append(abs(landings[0].position_m - x) - 1.1 * MARGIN_M)
    assert missed_m[0] > 0.07 * MARGIN_M
    assert abs(missed_m[-1]) < 0.02 * MARGIN_M
    for x, way_m in ((0.05, 0.02), (0.04, 0.03), (0.06, 0.015)):
        off_m = asked_m(x, way_m, direction, landings) - way_m
        assert abs(off_m) < 0.067 * MARGIN_M, "long ones go nearly as before"
    other = asked_m(0.05, 1.1 * MARGIN_M, -direction, landings)
    assert other == pytest.approx(1.1 * MARGIN_M, rel=0.02), "and so those the other way"


def test_without_short_slides_a_slide_is_sent_where_it_is_to_land() -> None:
    for s in (1, -1):
        straight_pa = landing_pa(0.05, s, RATIOS, LONG, STROKE_M)
        assert sliding_pa(0.05 - s * MARGIN_M, 0.05, s, RATIOS, LONG, STROKE_M) == pytest.approx(straight_pa, abs=1.0)


def test_what_is_sent_too_short_says_nothing_of_a_way_well_beyond() -> None:
    """It jumped by the margin from half of it: a slide of the margin and a half goes no farther than it is sent."""
    jumped = [Sent(0.5 * MARGIN_M, 0.5 * MARGIN_M)] * 5
    assert beyond_m(1.5 * MARGIN_M, jumped) < 0.01 * MARGIN_M
    assert jumped_m(0.5 * MARGIN_M, jumped) > 0.4 * MARGIN_M


def test_one_slide_alone_is_not_quite_believed_and_many_are() -> None:
    one, many = [Sent(1.0, 0.1)], [Sent(1.0, 0.1)] * 20
    assert 0.05 < jumped_m(1.0, one) < 0.08
    assert 0.09 < jumped_m(1.0, many) < 0.1
    assert jumped_m(np.exp(ALIKE), one) < 0.9 * jumped_m(1.0, one)


def test_a_slide_is_taken_for_one_that_was_sent_as_far_as_its_pressure_says() -> None:
    up = slide(0.05, 0.8 * MARGIN_M, 1)
    off_pa = up.command_pa - (SLOPE * up.position_m + F_C)
    (found,) = sent([(up, off_pa)], SLOPE)
    assert found.sent_m == pytest.approx(0.8 * MARGIN_M)
    assert found.beyond_m == pytest.approx(jumps_m(0.8 * MARGIN_M))
