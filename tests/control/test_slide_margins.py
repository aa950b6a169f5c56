"""The shortest slide that breaks loose, as slides teach it."""

import pytest

from positioner.estimation.landings.slide_margins import CLOSE, RAISE, Margin

KNOWN = Margin(held_m=2.1e-3, broke_m=2.4e-3)


def settled(margin: Margin, true_m: float, moves: int) -> Margin:
    """Return a margin after moves, each of as many slides as it takes to break loose."""
    for _ in range(moves):
        while margin.way_m < true_m:
            margin = margin.after_holding(margin.way_m)
        margin = margin.after_breaking(margin.way_m)
    return margin


def test_a_way_between_held_and_broke_is_tried_until_they_are_close() -> None:
    found = settled(Margin(held_m=1e-3, broke_m=4e-3), 2.3e-3, 6)
    assert 2.3e-3 <= found.way_m <= 2.3e-3 * CLOSE
    assert found.held_m < 2.3e-3


def test_a_way_that_held_by_luck_makes_the_margin_longer_for_the_move_only() -> None:
    margin = KNOWN.after_holding(2.5e-3)
    assert margin.way_m > 2.5e-3
    assert margin.sure_m == RAISE * 2.5e-3
    assert settled(margin, 2.3e-3, 5).way_m <= CLOSE * 2.4e-3


def test_ways_that_hold_again_are_believed() -> None:
    """Friction has grown by half."""
    found = settled(KNOWN, 3.4e-3, 8)
    assert 3.4e-3 <= found.way_m <= 3.4e-3 * CLOSE


def test_what_is_far_longer_than_broke_loose_says_nothing() -> None:
    assert KNOWN.after_breaking(10e-3) == KNOWN


def test_what_is_guessed_or_has_held_since_has_not_been_seen_to_break_loose() -> None:
    guess = Margin(broke_m=2.4e-3, guessed=True)
    assert (guess.seen_m, guess.after_holding(2.5e-3).seen_m, guess.after_holding(1e-3).seen_m) == (0.0, 0.0, 0.0)
    assert guess.after_breaking(2e-3).seen_m == 2e-3
    assert guess.after_breaking(3e-3).seen_m == 0.0, "it may be shorter yet"
    assert (KNOWN.seen_m, KNOWN.after_holding(2.5e-3).seen_m) == (2.4e-3, 0.0)


def test_a_jump_bounds_the_margin_from_both_sides_but_not_where_shorter_ways_have_landed() -> None:
    jumped = Margin(0.0, 2.0).after_jumping(0.7, 0.85)
    assert (jumped.held_m, jumped.broke_m) == (0.7, 0.85)
    assert 0.7 < jumped.way_m < 0.85
    landed = Margin(0.4, 0.6).after_jumping(0.7, 0.85)
    assert landed == Margin(0.7, 0.85, held_before_m=0.4), "believed for the move"
    assert landed.after_breaking(0.85).held_m == pytest.approx(0.4, rel=2e-3)
