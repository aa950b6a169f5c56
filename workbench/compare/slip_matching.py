"""Which slips of the stem the model makes too: matched, missed, and spurious ones.

A slip finds its match in one of the same direction that goes on within 40 % of the median time between slips. Noise
cuts a slow slide into pieces, so pieces may share a match, and small ones, below 20 sigma, are neither missed nor
spurious. Times and ends are compared only for slips that are nearest to each other; the ends where both rest.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from config.recording import Column
from config.results.result import Brief
from signals.moves import Slip

MATCH_SHARE = 0.4
"""Of the median time between slips: a match goes on within it."""
CLEAR = 20.0
"""Standard deviations of the noise that a slip travels before it counts as missed or spurious."""
MATCHED_SAMPLES = 3
"""A match goes on within these in any case."""


@dataclass(frozen=True, slots=True)
class MatchedSlip:
    """A measured slip and the model's: how much later, s, and how much farther in its direction, m, the model goes."""

    time_s: float
    direction: int
    reversal: bool
    late_s: float
    farther_m: float


@dataclass(frozen=True, slots=True, repr=False)
class SlipEvents(Brief):
    """Slips matched, and the times of those that the model misses, and of its spurious ones."""

    matched: tuple[MatchedSlip, ...]
    missed_s: tuple[float, ...]
    spurious_s: tuple[float, ...] = field(metadata={"json": "invented_s"})


def match_slips(
    time_s: Column,
    measured: tuple[Sequence[Slip], Column],
    simulated: tuple[Sequence[Slip], Column],
    noise_m: float,
) -> SlipEvents:
    """Match the slips of an unbroken stretch, each given with the positions, m, (n,), they were found in."""
    (ours, measured_m), (theirs, simulated_m) = measured, simulated
    begins = time_s[[each.first for each in ours]] if ours else time_s[:1]
    between_s = float(np.median(np.diff(begins))) if begins.size > 1 else float(time_s[-1] - time_s[0])
    within_s = max(MATCH_SHARE * between_s, MATCHED_SAMPLES * float(np.median(np.diff(time_s))))
    pairs = []
    for i, slip in enumerate(ours):
        partner = _nearest(time_s, slip, theirs, within_s)
        if partner is not None and _nearest(time_s, partner, ours, within_s) is slip:
            row = min(max(slip.last, partner.last), time_s.size - 1)
            pairs.append(
                MatchedSlip(
                    float(time_s[slip.first]),
                    slip.direction,
                    i > 0 and ours[i - 1].direction != slip.direction,
                    float(time_s[partner.first] - time_s[slip.first]),
                    slip.direction * float(simulated_m[row] - measured_m[row]),
                )
            )
    clear_m = CLEAR * noise_m
    missed = [each for each in ours if each.travel_m > clear_m and _nearest(time_s, each, theirs, within_s) is None]
    spurious = [each for each in theirs if each.travel_m > clear_m and _nearest(time_s, each, ours, within_s) is None]
    return SlipEvents(tuple(pairs), _times(time_s, missed), _times(time_s, spurious))


def _nearest(time_s: Column, slip: Slip, others: Sequence[Slip], within_s: float) -> Slip | None:
    """Return the slip of the same direction that begins nearest, of those under way within a time; None without one.

    The others follow each other in time: of thousands only the few that may be under way are looked at.
    """
    begin = bisect_left(others, time_s[slip.first] - within_s, key=lambda each: float(time_s[each.last]))
    end = bisect_right(others, time_s[slip.last] + within_s, key=lambda each: float(time_s[each.first]))
    near = [each for each in others[begin:end] if each.direction == slip.direction]
    return min(near, key=lambda each: abs(each.first - slip.first), default=None)


def _times(time_s: Column, found: Sequence[Slip]) -> tuple[float, ...]:
    return tuple(float(time_s[each.first]) for each in found)
