"""How the reference comes: what is left to the references to come, and what is not."""

from collections.abc import Iterable

import pytest

from positioner.control.laws.slides.reference_course import ReferenceCourse

SCAN_S, WAY_M = 0.5, 5e-3


def written(values_m: Iterable[float], every_s: float = SCAN_S) -> tuple[ReferenceCourse, float]:
    """Return the course of references, m, and when the last came."""
    first_m, *later_m = values_m
    course, now_s = ReferenceCourse(first_m, 0.0), 0.0
    for index, value_m in enumerate(later_m, 1):
        now_s = index * every_s
        course = course.after(now_s, value_m)
    return course, now_s


NOISE_M = (0.0600, 0.0602, 0.0599, 0.0603, 0.0601)
RAMP_M = tuple(0.06 + 5e-4 * i for i in range(5))


def test_steps_that_stand_are_corrected_at_once() -> None:
    course, now_s = written(NOISE_M, every_s=2.0)
    assert course.rests(now_s)
    assert not course.takes_back(now_s, 1e-4, WAY_M, 0.0)


def test_a_slow_ramp_is_left_to_come_until_an_excursion_saves_more_than_it_costs() -> None:
    """0.1 mm every 20 s are no steps; what they leave is corrected where e^3 > 3/2 m^2 T v, or when they have ended."""
    course, now_s = written([0.06 + 1e-4 * i for i in range(6)], every_s=20.0)
    assert course.rests(now_s)
    at_most_m = (1.5 * WAY_M**2 * 0.5 * 1e-4 / 20.0) ** (1 / 3)
    assert course.takes_back(now_s, 0.99 * at_most_m, WAY_M, 0.5)
    assert not course.takes_back(now_s, 1.01 * at_most_m, WAY_M, 0.5)
    assert not course.takes_back(now_s + 30.5, 0.9 * at_most_m, WAY_M, 0.5)
    for unlike_m in ((0.06, 0.0601, 0.0602, 0.0601, 0.0602, 0.0603), (0.06, 0.061, 0.0611, 0.062, 0.0621, 0.063)):
        course, now_s = written(unlike_m, every_s=20.0)
        assert not course.takes_back(now_s, 0.9 * at_most_m, WAY_M, 0.5)
    course, now_s = written([0.06 + 1e-4 * i for i in range(6)], every_s=1800.0)
    assert not course.takes_back(now_s, 1e-4, WAY_M, 0.5), "each stands for half an hour: they are no ramp"


def test_a_ramp_that_goes_farther_than_a_slide_is_followed_by_single_slides_ahead_of_it() -> None:
    """They land half a way ahead; no excursion is made, ahead of the reference or behind it."""
    course, now_s = written([0.06 + 5e-4 * i for i in range(7)])
    assert course.goes_far(WAY_M)
    assert course.lead_m(now_s, WAY_M) == pytest.approx(0.5 * WAY_M)
    assert course.lead_m(now_s, WAY_M, 0.2) == pytest.approx(0.5 * WAY_M + 1e-4), "it goes on by 1 mm/s"
    assert course.takes_back(now_s, 0.99 * WAY_M, WAY_M, 0.5)
    assert course.takes_back(now_s, -0.99 * WAY_M, WAY_M, 0.5)
    assert not course.takes_back(now_s + 0.8, 0.99 * WAY_M, WAY_M, 0.5), "it has ended"
    short, now_s = written([0.06 + 5e-4 * i for i in range(5)])
    assert not short.goes_far(WAY_M)
    turned = course.after(now_s + 0.5, 0.0625)
    assert not turned.goes_far(WAY_M)


def test_errors_of_a_few_changes_are_left_until_the_reference_rests() -> None:
    course, now_s = written(NOISE_M)
    assert course.change_m == pytest.approx(2.75e-4)
    lasting_m = 3.0 * 2.75e-4 + 2e-4  # one of the last references was nearer by 0.2 mm
    assert course.takes_back(now_s, 0.99 * lasting_m, WAY_M, 0.0)
    assert not course.takes_back(now_s, 1.01 * lasting_m, WAY_M, 0.0)
    assert course.takes_back(now_s + 0.7, 8e-4, WAY_M, 0.0)
    assert not course.takes_back(now_s + 0.8, 8e-4, WAY_M, 0.0)


def test_the_same_reference_again_is_none() -> None:
    course, now_s = written((*NOISE_M, NOISE_M[-1], NOISE_M[-1]))
    assert course.rests(now_s)


@pytest.mark.parametrize("s", [1, -1])
def test_a_ramp_is_led_by_half_a_way_and_carries_what_it_reaches(s: int) -> None:
    course, now_s = written(0.06 + s * (each - 0.06) for each in RAMP_M)
    assert course.trend == s
    assert course.lead_m(now_s, WAY_M) == pytest.approx(s * 2.5e-3)
    assert course.lead_m(now_s, 0.1) == pytest.approx(s * 4e-3), "no farther than eight references"
    assert course.takes_back(now_s, s * 2.4e-3, WAY_M, 0.0)
    assert course.takes_back(now_s, -s * 3.9e-3, WAY_M, 0.0), "it comes to the stem"
    assert not course.takes_back(now_s, -s * 4.1e-3, WAY_M, 0.0)
    assert course.takes_back(now_s, s * 5.7e-3, 0.02, 0.0), "as much as single slides leave, 20 mm/sqrt(12)"
    assert not course.takes_back(now_s, s * 5.8e-3, 0.02, 0.0), "too slow to carry it"
    assert course.lead_m(now_s + 0.8, WAY_M) == 0.0, "it has ended"


def test_three_changes_make_a_trend_and_one_ends_it() -> None:
    course, now_s = written((0.06, 0.061, 0.0605, 0.0610, 0.0615))
    assert course.trend == 0
    course = course.after(now_s + SCAN_S, 0.0620)
    assert course.trend == 1
    assert course.after(now_s + 2 * SCAN_S, 0.0615).trend == 0


def test_a_ramp_is_left_until_two_slides_cost_less_than_they_save() -> None:
    """By hand, 53.3 um/s, m = 3 mm: m/sqrt(12), or, away for 20 s: (3/2 9 mm^2 20 s 53.3 um/s)^(1/3) = 2.433 mm."""
    course, now_s = written(0.06 + 0.02667e-3 * i for i in range(5))
    for least_m, away_s in ((0.866e-3, 0.0), (0.866e-3, 0.5), (2.433e-3, 20.0)):
        assert course.takes_back(now_s, 0.99 * least_m, 3e-3, away_s)
        assert not course.takes_back(now_s, 1.01 * least_m, 3e-3, away_s)
