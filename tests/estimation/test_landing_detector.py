"""Which rests are landings: on a stem made by hand that answers each command at once, or not."""

import math
from collections.abc import Callable

import pytest

from positioner.estimation.landings.landing_detector import Answers, LandingDetector, SlideOutcome
from positioner.estimation.landings.seen_time import SeenTime

STROKE_M = 0.1
PERIOD_S = 0.02
HOLD_S = 2.0


def outcomes(
    *moves: tuple[float, float], path: Callable[[float, float, float], float] | None = None, hold_s: float = HOLD_S
) -> list[SlideOutcome]:
    """Return what the detector says of commands, Pa, under each of which the stem goes to a position, m."""
    detector = LandingDetector(STROKE_M)
    found, time_s, before_m = [], 0.0, moves[0][1]
    for command_pa, to_m in moves:
        for sample in range(round(hold_s / PERIOD_S)):
            elapsed_s = sample * PERIOD_S
            position_m = before_m if not sample else path(elapsed_s, before_m, to_m) if path else to_m
            outcome = detector.update(time_s, position_m, command_pa, float("nan"))
            found += [] if outcome is None else [outcome]
            time_s += PERIOD_S
        before_m = to_m
    return found


def test_a_slide_that_ends_in_rest_is_a_landing() -> None:
    up, down = outcomes((50e3, 0.05), (60e3, 0.06), (20e3, 0.04))
    assert (up.direction, up.command_pa) == (1, 60e3)
    assert [up.from_m, up.position_m] == pytest.approx([0.05, 0.06])
    assert (down.direction, down.landing) == (-1, True)


def test_a_stem_that_holds_has_not_moved() -> None:
    (held,) = outcomes((50e3, 0.05), (52e3, 0.05))
    assert (held.moved, held.landing) == (False, False)


def test_a_stop_is_no_landing() -> None:
    onto_the_stop, _ = outcomes((50e3, 0.05), (0.0, 0.0), (5e3, 0.0))
    assert (onto_the_stop.moved, onto_the_stop.landing) == (True, False)


def test_a_stem_that_moves_against_the_command_has_not_landed() -> None:
    """A push that gave way to a braked hold: the stem ran on upward under a lower pressure."""
    (braked,) = outcomes((50e3, 0.05), (45e3, 0.056))
    assert not braked.landing


def test_a_stem_that_answers_late_is_waited_for() -> None:
    """Dead time of 2 s: longer than is waited for at first, so the first answer finds a stem called at rest."""

    def late(elapsed_s: float, before_m: float, to_m: float) -> float:
        return to_m if elapsed_s > 2.0 else before_m

    held, *then = outcomes((50e3, 0.05), (60e3, 0.06), (70e3, 0.07), (80e3, 0.08), path=late, hold_s=6.0)
    assert not held.moved
    assert [(each.landing, each.command_pa) for each in then] == [(True, 60e3), (True, 70e3), (True, 80e3)]


def test_a_stem_set_free_long_after_the_command_is_not_waited_for_so_long_again() -> None:
    """It sat for 40 s; the next step is answered at once, and judged within two seconds."""

    def freed(elapsed_s: float, before_m: float, to_m: float) -> float:
        return to_m if to_m != 0.06 or elapsed_s > 40.0 else before_m

    held, landed = outcomes((50e3, 0.05), (60e3, 0.06), (70e3, 0.07), path=freed, hold_s=50.0)
    assert not held.moved
    assert (landed.landing, landed.command_pa) == (True, 70e3)
    assert landed.time_s - 100.0 < 2.0


@pytest.mark.parametrize(("answer_s", "waited_s"), [(0.1, 0.6), (1.5, 2.5)], ids=["at once", "at a limited rate"])
def test_a_large_step_says_how_long_large_steps_take(answer_s: float, waited_s: float) -> None:
    """Small steps took 0.3 s each. By their rate a step ten times as large would take 3 s; it may, or it may not."""

    def after(elapsed_s: float, before_m: float, to_m: float) -> float:
        took_s = answer_s if abs(to_m - before_m) > 0.02 else 0.3
        return before_m + (to_m - before_m) * min(1.0, elapsed_s / took_s)

    *_, held = outcomes((40e3, 0.04), (41e3, 0.043), (42e3, 0.046), (52e3, 0.07), (42e3, 0.07), path=after, hold_s=4.0)
    assert not held.moved
    assert held.time_s - 4 * 4.0 < waited_s


def test_what_something_else_has_moved_is_no_landing() -> None:
    detector = LandingDetector(STROKE_M)
    found = []
    for sample in range(400):
        found.append(detector.update(sample * PERIOD_S, 0.05 if sample < 200 else 0.06, 50e3, float("nan")))
    assert not any(found)
    assert detector.rest is not None
    assert detector.rest.position_m == pytest.approx(0.06)


def test_a_stem_rests_for_nobody_before_the_pressure_has_arrived() -> None:
    detector, period_s, waits_s = LandingDetector(0.1), 0.02, 3.0
    for i in range(100):
        detector.update(i * period_s, 0.05, 50e3, math.nan)
    assert detector.rest is not None
    begins_s = 100 * period_s
    for i in range(round(waits_s / period_s)):
        assert detector.update(begins_s + i * period_s, 0.05, 55e3, math.nan, arrived=False) is None
        assert detector.rest is None
    outcomes = [
        detector.update(begins_s + waits_s + i * period_s, 0.05, 55e3, math.nan, arrived=True) for i in range(120)
    ]
    (held,) = (each for each in outcomes if each is not None)
    assert not held.moved
    assert held.time_s - begins_s - waits_s >= 1.0, "a stem that has never answered may yet"


@pytest.mark.parametrize("dark_s", [0.0, 8.0, 600.0])
@pytest.mark.parametrize("gone_at", [1, 5, 20])
def test_an_answer_is_as_long_as_it_was_seen_to_be(dark_s: float, gone_at: int) -> None:
    """A stem behind a lag of 0.1 s; so many samples after the command nobody sees it for a while."""
    detector, period_s = LandingDetector(0.1), 0.02
    now_s, position_m = 0.0, 0.03
    for _ in range(100):
        now_s += period_s
        detector.update(now_s, position_m, 50e3, math.nan)
    moved_s = 0.0
    for sample in range(400):
        step_s = period_s + (dark_s if sample == gone_at else 0.0)
        now_s, moved_s = now_s + step_s, moved_s + step_s
        detector.update(now_s, position_m + 0.01 * (1.0 - math.exp(-moved_s / 0.1)), 60e3, math.nan)
    assert 0.0 < detector.answers.longest_s < 1.5
    assert detector.rest is not None


def test_a_loop_that_becomes_slower_is_seen_again() -> None:
    clock, now_s = SeenTime(), 0.0
    for period_s in (0.01, 0.1):
        for _ in range(60):
            now_s += period_s
            shown_s = clock.at(now_s)
    later_s = clock.at(now_s + 0.1)
    assert later_s - shown_s == pytest.approx(0.1)


def test_a_stem_sent_out_and_back_is_waited_for_as_long_as_the_longer_way_takes() -> None:
    """The pressure is somewhere between the two commands: it has no farther to come back than from one of them."""
    detector, now_s, dt_s = LandingDetector(0.1), 0.0, 0.02
    detector.answers = Answers(longest_s=0.1, slowness_s_per_pa=3e-5, large_pa=50e3)

    def seen(positions_m: list[float], command_pa: float) -> float:
        """Return for how long the stem was seen before its rest was known, s."""
        nonlocal now_s
        begun_s, waited_s = now_s, math.inf
        for position_m in positions_m:
            now_s += dt_s
            detector.update(now_s, position_m, command_pa, math.nan)
            waited_s = min(waited_s, now_s - begun_s if detector.rest is not None else math.inf)
        return waited_s

    seen([0.05] * 100, 50e3)
    assert seen([0.05 + 5e-4 * i for i in range(10)], 100e3) == math.inf
    assert 1.9 < seen([0.055] * 300, 50e3) < 2.5, "1.5 times 50 kPa at 27 us/Pa; there and back would be twice that"
