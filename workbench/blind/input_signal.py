"""A command that makes a sticking valve show what it is.

    u_open(x) = (k_s x + F_c) / A,   u_close(x) = (k_s x - F_c) / A >= 0     the stem slides through x, opening, closing

A record is a passage, another, and the first again: how well the valve repeats itself is measured by the last. The
moves go up and down by turns, far enough to leave the dead band 2 F_c / A, every kind of them once in either direction:

    step          answered by lags, dead time and limits of flow; the first move, after which the past is forgotten
    ramp          the level of friction all along the travel
    creep         small stairs, of which several make one break-away: stick-slip
    staircase     steps of different heights
    interrupted   a restart in the same direction, which takes up no play
    sawtooth      small reversals, some inside the dead band and some beyond

with rests of different lengths between them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from config.recording import Column
from config.valve_file import ValveParameters

FIRST_PASSAGE_SHARE = 0.26
"""Part of the record that is the first passage, and again the last."""
MOVES_OF_FIRST = 4
FIRST_REST_SHARE = 0.04
"""Part of the first passage before its first move."""
CLOSED, OPEN = (0.05, 0.3), (0.65, 0.97)
"""Parts of the stroke between which the moves go."""
LENGTHS = (0.6, 1.6)
"""Range of the moves' lengths, relative to each other."""
REST_SHARES = (0.05, 0.35)
"""Range of the rest that ends a move, part of it."""


@dataclass(frozen=True, slots=True)
class Leg:
    """From one command to another, Pa, in a number of samples; dead band and break-away excess (F_s - F_c) / A, Pa."""

    begin_pa: float
    end_pa: float
    count: int
    band_pa: float
    excess_pa: float


Move = Callable[[Leg, np.random.Generator], Column]


def excitation(valve: ValveParameters, generator: np.random.Generator, count: int) -> Column:
    """Return the commands, Pa, (count,); the first and the last passage begin with the valve closed.

    Args:
        valve: what is known of the valve: how far the commands go.
        generator: draws levels, lengths and the order of the moves.
        count: number of samples, some hundred at least.
    """
    gentle = (ramp, creep, staircase, interrupt_leg, sawtooth)
    opening = [step, *(gentle[i] for i in generator.permutation(len(gentle)))]
    closing = [(step, *gentle)[i] for i in generator.permutation(1 + len(gentle))]
    moves = [move for pair in zip(opening, closing, strict=True) for move in pair]
    band_pa = 2.0 * valve.coulomb_n / valve.diaphragm_area_m2
    excess_pa = (valve.static_n - valve.coulomb_n) / valve.diaphragm_area_m2
    home_pa = closing_pa(valve, CLOSED[0] * valve.stroke_m)
    levels = [home_pa, *(_level_pa(valve, generator, opens=i % 2 == 0) for i in range(len(moves) - 1)), home_pa]
    early = round(FIRST_PASSAGE_SHARE * count)
    rest = round(FIRST_REST_SHARE * early)
    counts = [
        *_share_samples(generator, early - rest, MOVES_OF_FIRST),
        *_share_samples(generator, count - 2 * early, len(moves) - MOVES_OF_FIRST),
    ]
    legs = [Leg(*ends, n, band_pa, excess_pa) for ends, n in zip(pairwise(levels), counts, strict=True)]
    parts = [_rest_after(move, leg, generator) for move, leg in zip(moves, legs, strict=True)]
    first = [np.full(rest, home_pa), *parts[:MOVES_OF_FIRST]]
    return np.concatenate([*first, *parts[MOVES_OF_FIRST:], *first])


def lead_in(command_pa: Column, count: int) -> Column:
    """Return the commands, Pa, at most `count`, that precede the last passage: after them the first begins alike."""
    repeated = command_pa.size - round(FIRST_PASSAGE_SHARE * command_pa.size)
    return command_pa[max(0, repeated - count) : repeated]


def opening_pa(valve: ValveParameters, position_m: float) -> float:
    """Return u_open, Pa."""
    return (valve.spring_n_per_m * position_m + valve.coulomb_n) / valve.diaphragm_area_m2


def closing_pa(valve: ValveParameters, position_m: float) -> float:
    """Return u_close, Pa; never below the atmosphere."""
    return max(0.0, (valve.spring_n_per_m * position_m - valve.coulomb_n) / valve.diaphragm_area_m2)


def _level_pa(valve: ValveParameters, generator: np.random.Generator, *, opens: bool) -> float:
    slides_pa, span = (opening_pa, OPEN) if opens else (closing_pa, CLOSED)
    return slides_pa(valve, generator.uniform(*span) * valve.stroke_m)


def _share_samples(generator: np.random.Generator, count: int, parts: int) -> list[int]:
    """Share samples out to the parts of a passage."""
    ends = np.cumsum(generator.uniform(*LENGTHS, parts))
    return [int(each) for each in np.diff(np.round(count * ends / ends[-1]), prepend=0.0)]


def _rest_after(move: Move, leg: Leg, generator: np.random.Generator) -> Column:
    """Make the move in a part of the leg's samples, and rest at its end; never below the atmosphere."""
    moving = round((1.0 - generator.uniform(*REST_SHARES)) * leg.count)
    made = move(replace(leg, count=moving), generator)
    return np.concatenate([made, np.full(leg.count - moving, leg.end_pa)]).clip(min=0.0)


def _through(points_pa: Sequence[float] | Column, at: Sequence[float] | Column, count: int) -> Column:
    """Return straight lines through points at parts 0 to 1 of the move; the first sample is past its beginning."""
    return np.interp(np.arange(1, count + 1) / count, at, points_pa)


def step(leg: Leg, _: np.random.Generator) -> Column:
    """Jump; Pa, (leg.count,)."""
    return np.full(leg.count, leg.end_pa)


def ramp(leg: Leg, _: np.random.Generator) -> Column:
    """Go straight; Pa, (leg.count,)."""
    return _through([leg.begin_pa, leg.end_pa], [0.0, 1.0], leg.count)


def creep(leg: Leg, generator: np.random.Generator) -> Column:
    """Jump on the way, then go on by eleven stairs of a part of the break-away excess, or a little more.

    Pa, (leg.count,).
    """
    way_pa = leg.end_pa - leg.begin_pa
    stair_pa = min(generator.uniform(0.3, 1.5) * leg.excess_pa, 0.05 * abs(way_pa))
    stairs_pa = leg.end_pa - np.sign(way_pa) * stair_pa * np.arange(11, -1, -1)
    return np.asarray(stairs_pa[np.arange(leg.count) * stairs_pa.size // leg.count])


def staircase(leg: Leg, generator: np.random.Generator) -> Column:
    """Jump by four to seven stairs of different heights; Pa, (leg.count,)."""
    heights = np.cumsum(generator.uniform(0.3, 1.7, generator.integers(4, 8)))
    stairs = leg.begin_pa + (leg.end_pa - leg.begin_pa) * heights / heights[-1]
    return np.asarray(stairs[np.arange(leg.count) * stairs.size // leg.count])


def interrupt_leg(leg: Leg, generator: np.random.Generator) -> Column:
    """Go straight with two rests on the way, late enough for the stem to be moving; Pa, (leg.count,)."""
    places = np.sort(generator.uniform(0.6, 0.9, 2))
    waits = generator.uniform(0.1, 0.3, 2)
    levels = leg.begin_pa + (leg.end_pa - leg.begin_pa) * np.array([0.0, *np.repeat(places, 2), 1.0])
    moving = (1.0 - waits.sum()) * np.diff([0.0, *places, 1.0])
    at = np.cumsum([0.0, moving[0], waits[0], moving[1], waits[1], moving[2]])
    return _through(levels, at / at[-1], leg.count)


def sawtooth(leg: Leg, generator: np.random.Generator) -> Column:
    """Go there by three teeth, turning back after each by a part of the dead band or a little more than it.

    Pa, (leg.count,).
    """
    ahead = leg.begin_pa + (leg.end_pa - leg.begin_pa) * np.array([0.75, 0.9, 1.0])
    back = ahead - np.sign(leg.end_pa - leg.begin_pa) * generator.uniform(0.3, 1.4, 3) * leg.band_pa
    points = np.array([leg.begin_pa, *np.column_stack([ahead, back]).ravel(), leg.end_pa])
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(points)))])
    return _through(points, travelled / travelled[-1], leg.count)
