"""The staircase of S3, step by step."""

from dataclasses import replace
from typing import Any

import pytest

from positioner.control.staircase_excitation import Staircase, StaircaseLimits
from positioner.estimation.landings.landing_detector import SlideOutcome
from tests.control.test_slide_law import SLOPE_PA_PER_M, STROKE_M

LIMITS = StaircaseLimits(0.1 * STROKE_M, 0.9 * STROKE_M, minimum_pa=0.0, maximum_pa=420e3, stroke_m=STROKE_M)


def outcome(direction: int, from_m: float, to_m: float) -> SlideOutcome:
    return SlideOutcome(0.0, direction, from_m, 1.0, to_m, 1e-6, from_m != to_m, from_m != to_m)


def test_steps_grow_until_the_stem_breaks_loose() -> None:
    stairs = Staircase(10e3).stepped(0.03, LIMITS)
    first_pa = stairs.step_pa
    assert stairs.direction == 1
    assert first_pa == pytest.approx(0.02 * 420e3)
    stairs = stairs.counted(outcome(1, 0.03, 0.03), LIMITS).stepped(0.03, LIMITS)
    assert stairs.step_pa == pytest.approx(1.3 * first_pa)
    assert stairs.level_pa == pytest.approx(10e3 + 2.3 * first_pa)


def test_the_staircase_turns_round_before_it_leaves_the_window() -> None:
    stairs = replace(Staircase(80e3, direction=1, slide_m=0.01), rise_pa=5e3)
    assert stairs.counted(outcome(1, 0.075, 0.085), LIMITS).stepped(0.085, LIMITS).direction == -1
    assert stairs.counted(outcome(1, 0.065, 0.075), LIMITS).stepped(0.075, LIMITS).direction == 1


UNDER_WAY = Staircase(80e3, direction=1, slide_m=0.002, high_pa=1.6e3, slope_pa_per_m=0.8e6)
"""Its last slide went 2 mm, under a rise of 1.6 kPa."""


def test_a_stem_whose_packing_gave_way_has_not_been_broken_loose() -> None:
    """After 8 kPa it should have gone 10 mm; it went 1 mm, by a step worth 5 mm. The slope stays."""
    stairs = replace(UNDER_WAY, rise_pa=8e3, step_pa=4e3).counted(outcome(1, 0.05, 0.051), LIMITS)
    assert (stairs.low_pa, stairs.rise_pa, stairs.ups, stairs.slope_pa_per_m) == (8e3, 8e3, 0, 0.8e6)


def test_a_stem_that_goes_as_far_as_its_last_step_has_slid_however_much_took_friction_up() -> None:
    """It gave way at a turn; the rise then took friction up, before it slid by 2.5 mm, of 2 kPa."""
    stairs = replace(UNDER_WAY, rise_pa=19e3, step_pa=1.8e3).counted(outcome(1, 0.05, 0.0525), LIMITS)
    assert (stairs.low_pa, stairs.rise_pa, stairs.ups, stairs.slope_pa_per_m) == (0.0, 0.0, 1, 0.8e6)


def test_a_rise_does_not_leap() -> None:
    """An eighth of the window would be five times the last slide; the slope may be that of a packing."""
    assert UNDER_WAY.stepped(0.05, LIMITS).step_pa == pytest.approx(3 * 1.6e3)


def test_the_first_slide_after_a_turn_does_not_close_the_staircase() -> None:
    turned = replace(UNDER_WAY, closing=True, slide_m=0.0, turns=3)
    first = turned.counted(outcome(1, 0.05, 0.052), LIMITS)
    assert not first.closed
    assert replace(first, rise_pa=1.6e3).counted(outcome(1, 0.052, 0.054), LIMITS).closed


def held_after(rise_pa: float, stairs: Staircase) -> Staircase:
    """Return a staircase whose level went on by a rise, and the stem showed nothing."""
    stairs = replace(stairs, lowest_pa=stairs.level_pa, highest_pa=stairs.level_pa + rise_pa)
    return stairs.counted(outcome(1, 0.05, 0.05), LIMITS)


@pytest.mark.parametrize(
    ("known", "bound_pa"),
    [
        ({}, SLOPE_PA_PER_M * STROKE_M),
        ({"most_turn_pa": 40e3}, 1.5 * 40e3 + 8.4e3),
        ({"most_turn_pa": 40e3, "most_up_pa": 5e3, "most_down_pa": 90e3}, 1.5 * 5e3 + 8.4e3),
        ({"most_turn_pa": 40e3, "most_up_pa": 5e3, "slide_m": 0.0, "turns": 2}, 1.5 * 40e3 + 8.4e3),
    ],
    ids=["the spring over the stroke", "no slide this way yet", "going on", "turning"],
)
def test_a_stem_has_to_answer_what_has_moved_it_before(known: dict[str, Any], bound_pa: float) -> None:
    stairs = replace(UNDER_WAY, slope_pa_per_m=SLOPE_PA_PER_M, **known)
    assert not held_after(bound_pa - 1.0, stairs).unanswered(LIMITS)
    assert held_after(bound_pa + 1.0, stairs).unanswered(LIMITS)


def test_what_gives_way_has_answered_and_before_anything_has_moved_all_is_searched_once() -> None:
    far = replace(UNDER_WAY, most_up_pa=5e3, lowest_pa=0.0, highest_pa=80e3)
    assert far.unanswered(LIMITS)
    assert not far.counted(outcome(1, 0.05, 0.0503), LIMITS).unanswered(LIMITS)
    stairs = Staircase(80e3)
    while not stairs.unanswered(LIMITS):
        assert stairs.turns < 2
        stairs = stairs.counted(outcome(stairs.direction, 0.05, 0.05), LIMITS).stepped(0.05, LIMITS)
    assert (stairs.lowest_pa, stairs.highest_pa) == (LIMITS.minimum_pa, LIMITS.maximum_pa)


def test_a_stem_at_a_stop_need_not_answer() -> None:
    """The stop bears whatever is more than it takes to get there."""
    at_stop = outcome(1, 0.08, 0.1)._replace(landing=False)
    stairs = replace(UNDER_WAY, most_turn_pa=5e3, lowest_pa=80e3, highest_pa=80e3).counted(at_stop, LIMITS)
    assert not replace(stairs.stepped(0.1, LIMITS), slide_m=0.0).unanswered(LIMITS)
