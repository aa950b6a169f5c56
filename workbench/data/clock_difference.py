"""Whether the clocks of command and position differ, so that the stem is seen to move before it is told to.

    ... u_a, u_b, u_c | u_d ...        levels of a held command; s_b = sgn(u_b - u_a), s_c, s_d its changes
                   ^ the stem leaves its place, direction w

A stem that leaves under u_c does what that change asked for, or one before. Where two changes went one way and the next
goes the other, s_b = s_c = -s_d, it therefore goes on, w = s_c, however late it is; w = s_d turns before the command
does. In a closed loop the command follows the stem, but against it: it turns because the stem has gone on, w = s_c. So
where nearly all such turns are made by the stem first, and by the same time, one of the two clocks is off. A move
between two samples is n samples before a change between two: early by n - 1 to n + 1 periods.

A slip goes the way that the command went since the slip before, however late it is. Where many go against that, what
was commanded is not what drives the stem.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from config.recording import Column
from signals.moves import slips

HELD = 3
"""Samples for which a command is held before it turns: those of a loop that is faster than they are show any order."""
FEWEST_TURNS = 6
"""Turns that tell."""
NEARLY_ALL = 0.9
"""Share of the turns that the stem makes first, and of these of those that are early by the same time."""
THE_SAME = 1
"""Samples by which they may differ from their median."""
AGAINST, FEWEST_SLIPS = 0.2, 10
"""Share of the slips that go against what the command did since the one before; slips that tell: of none it is half."""
Rows = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Early:
    """By how much a stem moves before its command, s, at least and at most, and in how many of the turns that tell."""

    least_s: float
    most_s: float
    early: int
    turns: int

    @property
    def advice(self) -> str:
        """Say what to do about it."""
        return "Record both by one clock, or shift one of the columns by that, and diagnose again"

    @property
    def sentence(self) -> str:
        """Say so."""
        by = f"{self.least_s:.3g} to {self.most_s:.3g} s" if self.least_s else f"up to {self.most_s:.3g} s"
        return (
            f"the stem turns before its command in {self.early} of {self.turns} turns, by {by}: their two clocks "
            "differ by that, and by what the stem is late besides"
        )


@dataclass(frozen=True, slots=True)
class Unled:
    """How many of the slips go against what the command did since the one before: it does not drive the stem."""

    against: int
    turns: int

    @property
    def sentence(self) -> str:
        """Say so."""
        return (
            f"the stem goes against its command in {self.against} of {self.turns} slips: the command is not what drove "
            "it, counts the other way, or has a clock of its own"
        )

    @property
    def advice(self) -> str:
        """Say what to do about it."""
        return "Record what drives the stem beside it, by one clock, and diagnose again"


Doubt = Early | Unled
"""Why no verdict may rest on a recording."""


def unled(command: Column, position_m: Column, scale_m: float, segments: tuple[tuple[int, int], ...]) -> Unled | None:
    """Return how often the stem goes against its command, as late as suits it best; None where it hardly does.

    It may be late by as much as slips lie apart. None, too, where too few slips tell.
    """
    rows, ways, begins = [], [], []
    for first, end in segments:
        found = slips(position_m[first:end], scale_m)
        rows += [(first + before.last, first + slip.last) for before, slip in pairwise(found)]
        ways += [each.direction for each in found[1:]]
        begins += [first] * len(found[1:])
    if len(rows) < FEWEST_SLIPS:
        return None
    ends, way, begin = np.array(rows), np.array(ways), np.array(begins)
    latest = int(np.median(ends[:, 1] - ends[:, 0]))
    if latest < 2 * HELD:  # a loop faster than its samples shows any order
        return None
    told = []
    for late in range(latest + 1):
        before, after = (command[np.maximum(ends[:, each] - late, begin)] for each in (0, 1))
        went = np.sign(after - before)
        told.append((float(np.mean(went == -way)), int(np.sum(went == -way))))
    share, against = min(told)
    return Unled(against, len(rows)) if share > AGAINST else None


def early(
    time_s: Column, command: Column, position_m: Column, scale_m: float, segments: tuple[tuple[int, int], ...]
) -> Early | None:
    """Return by how much the stem moves before its command; None where it does not, or too few turns tell.

    Args:
        time_s: s, (samples,).
        command: what was asked of it, a pressure or a set point, (samples,).
        position_m: m, (samples,), NaN where it does not count.
        scale_m: what tells motion from rest, m.
        segments: ranges of rows, half open, without a gap.
    """
    found = [_turns(command[first:end], position_m[first:end], scale_m) for first, end in segments]
    turns = sum(count for count, _ in found)
    samples = np.concatenate([each for _, each in found])
    if turns < FEWEST_TURNS or samples.size < NEARLY_ALL * turns:
        return None
    middle = float(np.median(samples))
    if np.mean(np.abs(samples - middle) <= THE_SAME) < NEARLY_ALL:
        return None
    period_s = float(np.median(np.concatenate([np.diff(time_s[first:end]) for first, end in segments])))
    return Early((middle - 1.0) * period_s, (middle + 1.0) * period_s, samples.size, turns)


def _turns(command: Column, position_m: Column, scale_m: float) -> tuple[int, Rows]:
    """Return how many turns of a segment tell, and by how many samples the stem makes them first, (those,)."""
    found = slips(position_m, scale_m)
    leaves = np.array([each.first + 1 for each in found], dtype=np.int64)
    ways = np.array([each.direction for each in found], dtype=np.int64)
    changes = 1 + np.flatnonzero(np.diff(command))
    way = np.sign(np.diff(command)[changes - 1])
    following = np.searchsorted(changes, leaves, side="right")
    known = (following >= 2) & (following < changes.size)
    leaves, ways, following = leaves[known], ways[known], following[known]
    turn = (way[following - 1] == way[following - 2]) & (way[following] != way[following - 1])
    turn &= changes[following] - changes[following - 1] >= HELD
    leaves, following = leaves[turn], following[turn]
    first = ways[turn] == way[following]
    return leaves.size, (changes[following] - leaves)[first]
