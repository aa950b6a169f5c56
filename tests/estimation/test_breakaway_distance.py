"""How far a stem must be sent to break loose, as slides teach it."""

from math import inf

import numpy as np
import pytest

from positioner.estimation.landings.breakaway_distance import CLOSE, BreakawayDistance, Interval, Went

KNOWN = Interval(1.0e-3, 1.1e-3, seen=True)
ALL = BreakawayDistance(KNOWN, KNOWN, KNOWN, KNOWN)


def settled(interval: Interval, true_m: float, moves: int) -> Interval:
    """Return an interval after moves, each of as many slides as it takes to break loose."""
    for _ in range(moves):
        way_m = interval.likely_m
        while way_m < true_m:
            interval = interval.holding(way_m)
            way_m = interval.sure_m
        interval = interval.breaking(way_m)
    return interval


@pytest.mark.parametrize("seed", range(50))
def test_from_wherever_it_begins_it_comes_to_the_truth_within_a_tenth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    true_m, guess_m = (float(np.exp(rng.uniform(np.log(1e-4), np.log(1e-2)))) for _ in range(2))
    begin = Interval(broke_m=guess_m, seen=bool(rng.integers(2)))
    found = settled(begin, true_m, 25)
    assert true_m <= found.likely_m <= CLOSE**2 * true_m
    assert found.held_m < true_m


@pytest.mark.parametrize("factor", [0.6, 0.8, 1.5, 3.0])
def test_friction_that_changes_is_followed(factor: float) -> None:
    """Less of it in time alone: a shorter way is tried again as what held fades."""
    moves = 12 if factor > 1.0 else 1500
    found = settled(settled(Interval(broke_m=4e-3, seen=True), 2e-3, 10), factor * 2e-3, moves)
    assert factor * 2e-3 <= found.likely_m <= CLOSE**2 * factor * 2e-3


def test_a_way_that_held_by_luck_is_tried_again() -> None:
    found = KNOWN.holding(1.1e-3)
    assert (found.seen, found.sure_m > 1.1e-3) == (False, True)
    assert settled(found, 1.05e-3, 6).likely_m <= CLOSE * 1.1e-3


def test_what_is_guessed_is_given_up_at_once() -> None:
    held = Interval(broke_m=2e-3).holding(3e-3)
    assert (held.held_m, held.seen) == (3e-3, False)
    assert held.likely_m > 3e-3


@pytest.mark.parametrize("sent_m", [9e-3, 10e-3, 11e-3])
def test_what_is_far_longer_than_broke_loose_says_nothing_wherever_it_was_sent(sent_m: float) -> None:
    went = Went(sent_m, 10e-3, moved=True, arrived=sent_m == 10e-3)
    assert KNOWN.taught(went, turning=True) == KNOWN


def test_what_held_is_followed_by_no_more_than_twice_as_much() -> None:
    assert Interval(0.9e-3, 45e-3, seen=True).likely_m == pytest.approx(1.8e-3)


@pytest.mark.parametrize(
    ("went", "turning", "held_m", "broke_m"),
    [
        (Went(1.05e-3, 1.05e-3, moved=True, arrived=True), False, 0.999e-3, 1.05e-3),
        (Went(1.05e-3, 0.0, moved=False, arrived=False), False, 1.05e-3, 1.2e-3),
        (Went(1.05e-3, 1.15e-3, moved=True, arrived=False), False, 0.999 * 1.05e-3, 1.15e-3),
        (Went(1.05e-3, 0.7e-3, moved=True, arrived=False), True, 1.05e-3, 1.2e-3),
        (Went(1.05e-3, 0.7e-3, moved=True, arrived=False), False, 1.0e-3, 1.2e-3),
    ],
    ids=["arrived", "held", "jumped", "a packing gave way", "friction has grown"],
)
def test_what_a_slide_taught(went: Went, turning: bool, held_m: float, broke_m: float) -> None:
    found = Interval(1.0e-3, 1.2e-3, seen=True).taught(went, turning=turning)
    assert found.held_m == pytest.approx(held_m)
    assert found.broke_m == pytest.approx(broke_m)


def test_what_is_missing_is_the_next_of_kins_if_that_agrees() -> None:
    one = BreakawayDistance(onward_up=Interval(5e-3, 5.5e-3, seen=True))
    assert one.at(1, turning=True) == one.at(-1, turning=True) == one.onward_up
    held = BreakawayDistance(one.onward_up, turning_up=Interval(6e-3))
    assert held.at(1, turning=True) == Interval(6e-3), "it holds longer ones"
    broke = BreakawayDistance(one.onward_up, turning_up=Interval(broke_m=5.2e-3, seen=True))
    assert broke.at(1, turning=True) == Interval(4e-3, 5.2e-3, seen=True), "what holds one nearly holds its kin"
    long = BreakawayDistance(one.onward_up, turning_up=Interval(broke_m=30e-3, seen=True))
    assert long.at(1, turning=True) == Interval(4e-3, 5.5e-3, seen=True), "a long slide says less"


def test_turning_that_is_shorter_than_going_on_is_found_though_nothing_of_it_has_held() -> None:
    """A play that is taken up, or a packing that hardly gives way: what held the other way on says little."""
    both = BreakawayDistance(onward_down=Interval(1.87e-3, 2.01e-3, seen=True))
    for _ in range(12):
        way_m = both.at(-1, turning=True).likely_m
        went = Went(way_m, way_m * (way_m >= 1.36e-3), moved=way_m >= 1.36e-3, arrived=way_m >= 1.36e-3)
        both = both.taught(-1, went, turning=True, local=1.0)
    assert 1.36e-3 <= both.at(-1, turning=True).likely_m <= CLOSE**2 * 1.36e-3


def test_it_goes_over_the_travel_as_friction_over_slope_and_comes_back() -> None:
    assert ALL.at(1, turning=False, local=0.7).broke_m == pytest.approx(0.7 * 1.1e-3)
    went = Went(0.72e-3, 0.72e-3, moved=True, arrived=True)
    back = ALL.taught(1, went, turning=False, local=0.7)
    assert back.onward_up.broke_m == pytest.approx(0.72e-3 / 0.7)
    assert back.onward_down == KNOWN


def test_where_nothing_is_known_nothing_is_made_up() -> None:
    assert BreakawayDistance().at(1, turning=True).broke_m == inf
