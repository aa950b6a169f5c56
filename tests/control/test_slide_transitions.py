"""The law of slides as a machine of states, on stems drawn at random: properties, whatever the stem."""

from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from config.codes import InhibitReason
from positioner.control.laws.slides import transitions
from positioner.control.laws.slides.plan import Plan
from positioner.control.laws.slides.slide_law import SlideLaw
from positioner.control.laws.slides.slide_memory import SlideMemory
from positioner.control.laws.slides.slide_states import Idle, Out, Presliding, Sliding
from positioner.control.laws.slides.transitions import TABLE
from tests.cases import few_always
from tests.control.scripted_stem import SETTINGS, SLOPE_PA_PER_M, STEP_S, STROKE_M, ScriptedStem, drawn_stems

COUNT, MOVES = 6, 12
SEEDS = few_always(range(5))
"""Of the stems drawn: other ones each."""


def references(stem: ScriptedStem, moves: int = MOVES) -> list[float]:
    """Return references, m: steps of 0.1 to 10 % of the stroke, evenly in the logarithm."""
    at, asked = 0.5, []
    for _ in range(moves):
        size = float(np.exp(stem.rng.uniform(np.log(1e-3), np.log(0.1))) * stem.rng.choice((-1, 1)))
        at = at + size if 0.3 < at + size < 0.75 else at - size
        asked.append(at * STROKE_M)
    return asked


@pytest.mark.parametrize("seed", SEEDS)
def test_a_move_ends_at_its_reference_within_its_slides_and_bounds_and_slides_teach_to_take_fewer(seed: int) -> None:
    """No more slides than a move has; never beyond pressure, limit and travel; no limit cycle.

    In the end it takes two, where one would not break loose, and more where scatter, or what lies between, asks for it.
    """
    later = []
    for stem in drawn_stems(COUNT, seed=10 * seed):
        limit_m, most = stem.settings.excursion_limit_m, stem.settings.thresholds.most_slides
        for number, reference_m in enumerate(references(stem, 30)):
            given = stem.moved_to(reference_m)
            later += [given] if number >= 15 else []
            assert given <= most
            assert abs(stem.position_m - reference_m) < 1e-3 * STROKE_M
            assert isinstance(stem.memory.state, Idle)
            if number % 3 == 0:
                assert left_alone(stem, reference_m) == {stem.memory.command_pa}
        assert all(0.0 <= each <= stem.settings.maximum_pa for each in stem.commands_pa)
        assert all(abs(each.position_m - 0.5 * STROKE_M) < 0.25 * STROKE_M + limit_m for each in stem.landings)
        assert stem.memory.distances is not None
        for interval in (stem.memory.distances.at(s, turning=True) for s in (1, -1)):
            assert interval.broke_m > 0.95 * stem.turning_m - 3.0 * stem.scatter_m
    assert np.mean(later) <= 2.3


def test_a_move_has_fourteen_slides_and_two_more_each_minute_however_far_off_they_land(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each slide lands farther off than the last, to the other side: in the end nothing but their number ends it."""
    given, later = [], []
    for stem in drawn_stems(COUNT):
        misses_m = [5e-4 * (-1.3) ** n * STROKE_M for n in range(1000)]
        monkeypatch.setattr(stem, "scattered_m", iter(misses_m).__next__)
        for reference_m in references(stem, 6):
            given.append(stem.moved_to(reference_m))
            stem.now_s += 60.0
            later.append(stem.moved_to(reference_m))
    assert max(given) == 14
    assert max(later) == 2


def left_alone(stem: ScriptedStem, reference_m: float) -> set[float]:
    """Return the commands of a stem in the hours after its move: of a copy, for break-away is known less well then."""
    alone, commands_pa = deepcopy(stem), set()
    for _ in range(20):
        alone.now_s += 600.0
        alone.once(reference_m)
        commands_pa.add(alone.memory.command_pa)
    return commands_pa


@pytest.mark.parametrize("seed", SEEDS)
def test_a_stem_that_nothing_breaks_loose_is_stuck_and_one_that_comes_free_goes_to_its_reference(seed: int) -> None:
    for stem in drawn_stems(COUNT, seed=10 * seed + 2):
        for reference_m in references(stem):
            stem.moved_to(reference_m)
        stem.settings = replace(stem.settings, excursion_limit_m=0.2 * STROKE_M)
        stem.stuck, before = True, stem.memory.distances
        stands_m = stem.position_m
        away_m = stands_m + (0.15 if stands_m < 0.5 * STROKE_M else -0.15) * STROKE_M
        assert stem.moved_to(away_m) <= stem.settings.thresholds.most_slides
        assert stem.memory.stuck_at_m is not None
        assert stem.memory.inhibit_reason() is InhibitReason.STUCK
        assert stem.memory.distances == before, "what they seem to teach is not believed"
        stem.once(away_m - 0.01 * STROKE_M)
        assert isinstance(stem.memory.state, Sliding)
        assert stem.memory.inhibit_reason() is InhibitReason.STUCK, "while another reference is tried, too"
        stem.come_free()
        stem.moved_to(away_m)
        assert abs(stem.position_m - away_m) < 2e-3 * STROKE_M
        assert stem.memory.inhibit_reason() is InhibitReason.NOTHING


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_interrupts_a_move_holds_what_it_is_given_and_is_taken_over_without_a_bump(seed: int) -> None:
    for stem in drawn_stems(COUNT, seed=10 * seed + 3):
        asked = references(stem)
        for number, reference_m in enumerate(asked):
            for _ in range(number % 4):
                stem.once(reference_m)
            state = stem.memory.state
            held_pa = SlideLaw(stem.settings, stem.memory).interrupted_pa(stem.memory.command_pa)
            assert 0.0 <= held_pa <= stem.settings.maximum_pa
            stem.interrupted(held_pa)
            stem.interrupted(held_pa)
            if isinstance(state, Out):
                assert abs(stem.position_m - reference_m) < 2.0 * stem.turning_m + 5e-3 * STROKE_M, "it comes back"
            stem.once(stem.position_m)
            assert stem.memory.command_pa == held_pa, "on its reference nothing is done"
            assert stem.memory.row is None
            stem.moved_to(reference_m)
            assert abs(stem.position_m - reference_m) < 1e-3 * STROKE_M


def soft_stems(seed: int) -> Iterator[ScriptedStem]:
    """Yield stems whose packings are 20 to 50 times as stiff as their springs."""
    for stem in drawn_stems(COUNT, seed=seed):
        gives = stem.rng.uniform(0.02, 0.05) / SLOPE_PA_PER_M
        stem.gives_m_per_pa, stem.turning_m = float(gives), stem.onward_m + gives * (stem.up_pa + stem.down_pa)
        yield stem


@pytest.mark.parametrize("seed", SEEDS)
def test_a_packing_that_gives_way_takes_small_moves_without_a_slide(seed: int) -> None:
    """Where it is tried the stem ends on its reference by that alone, in most moves."""
    ways = Counter[tuple[type, type]]()
    for stem in soft_stems(seed=10 * seed + 7):
        for number, reference_m in enumerate(references(stem, 30)):
            stem.now_s += 10.0 * 3 ** (number % 2)  # no ramp
            stem.moved_to(reference_m)
            assert abs(stem.position_m - reference_m) < 1e-3 * STROKE_M
        ways.update(stem.states)
    begun = ways[Idle, Presliding]
    assert begun > COUNT
    assert ways[Presliding, Idle] > 0.8 * begun


def test_every_rule_of_the_table_is_followed_and_no_other_way_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    followed = Counter[str]()

    def counted(rule: transitions.Rule) -> transitions.Rule:
        def follow(plan: Plan) -> SlideMemory | None:
            after = rule.follow(plan)
            if after is not None:
                followed[rule.when] += 1
                assert type(after.state) in (rule.to or (type(plan.memory.state),))
                stuck = InhibitReason.STUCK if after.stuck_at_m is not None else None
                assert after.inhibit_reason() in (*rule.why, stuck)
            return after

        return rule._replace(follow=follow)

    monkeypatch.setattr(transitions, "MOVING", tuple(counted(each) for each in transitions.MOVING))
    monkeypatch.setattr(transitions, "AT_REST", tuple(counted(each) for each in transitions.AT_REST))
    for stem in (*drawn_stems(COUNT, seed=4), *soft_stems(seed=4)):
        walked(stem)
    assert {each.when for each in TABLE} == set(followed)


def walked(stem: ScriptedStem) -> None:
    """Let a stem be asked for all that a site asks for."""
    for reference_m in references(stem):
        stem.moved_to(reference_m)
    at_m = stem.position_m
    stem.settings = replace(stem.settings, excursion_interval_s=3600.0)
    stem.moved_to(at_m + 0.0015 * STROKE_M)
    stem.moved_to(at_m)
    stem.settings = replace(stem.settings, excursion_interval_s=0.0, budget_m_per_s=1e-12)
    stem.moved_to(at_m + 0.0015 * STROKE_M)
    stem.moved_to(at_m)
    stem.settings = replace(stem.settings, budget_m_per_s=0.0, excursion_limit_m=1e-4 * STROKE_M)
    stem.moved_to(at_m - 0.0025 * STROKE_M)
    stem.settings = replace(stem.settings, excursion_limit_m=0.5 * STROKE_M, dead_band_m=1e-9)
    stem.moved_to(at_m + 0.003 * STROKE_M)
    stem.settings = SETTINGS
    for reference_m in stem.position_m + STROKE_M * np.array((0.001, 0.002, 0.003, 0.004, 0.005)):
        stem.once(float(reference_m))  # a ramp
    stem.now_s += 10.0
    stem.moved_to(at_m)
    target_m = stem.position_m + 0.002 * STROKE_M
    while not isinstance(stem.memory.state, Out):
        stem.now_s += 10.0
        stem.once(target_m)
        target_m += 0.002 * STROKE_M
    out = stem.memory.state
    stem.moving(target_m, out.slide.to_m)
    stem.moving(target_m, out.slide.to_m)
    stem.moving(0.2 * STROKE_M, 0.5 * STROKE_M)
    stem.moving(0.2 * STROKE_M, 0.5 * STROKE_M, InhibitReason.NOT_AT_REST)
    assert stem.memory.inhibit_reason() is InhibitReason.NOT_AT_REST
    stem.stuck = True
    stem.once(0.6 * STROKE_M)
    stem.interrupted(stem.memory.command_pa)
    for reference_m in (0.6 * STROKE_M, 0.5 * STROKE_M, 0.7 * STROKE_M, 0.3 * STROKE_M):
        stem.moved_to(reference_m)


def test_what_is_spent_of_a_day_comes_back_with_time() -> None:
    """A day's travel may be spent at once: then small moves wait for it, and long ones do not."""
    stem = next(drawn_stems(1, seed=5))
    for reference_m in references(stem, 20):
        stem.moved_to(reference_m)
    spent_m = 6.0 * stem.turning_m
    stem.settings = replace(stem.settings, budget_m_per_s=spent_m / 86400.0)
    stem.now_s += 1e7
    reasons, at_m = [], stem.position_m
    for number in range(6):
        at_m += 0.002 * STROKE_M * (-1) ** number
        stem.moved_to(at_m)
        reasons.append(stem.memory.inhibit_reason())
    assert reasons[0] is InhibitReason.NOTHING
    assert InhibitReason.EXCURSION_BUDGET_SPENT in reasons
    stem.moved_to(0.35 * STROKE_M if at_m > 0.5 * STROKE_M else 0.65 * STROKE_M)
    stem.now_s += 86400.0
    at_m = stem.position_m + 0.002 * STROKE_M
    stem.moved_to(at_m)
    assert abs(stem.position_m - at_m) < 1e-3 * STROKE_M


def test_the_commands_of_a_ramp_come_no_faster_than_slides_do() -> None:
    """References every half second: one slide a way, none to and fro."""
    stem = next(drawn_stems(1, seed=6))
    for reference_m in references(stem, 20):
        stem.moved_to(reference_m)
    begin_m, travel_m = stem.position_m, 0.0
    way = 1 if begin_m < 0.5 * STROKE_M else -1
    positions = [begin_m]
    for step in range(int(30 / STEP_S)):
        stem.once(begin_m + way * 0.2 * STROKE_M * (step + 1) / 60)
        positions.append(stem.position_m)
    travel_m = sum(abs(b - a) for a, b in pairwise(positions))
    assert travel_m < 0.2 * STROKE_M + 4.0 * stem.onward_m
