"""What the stem is doing, sample by sample, from the measurement; and how its slips match the model's.

    near stops   within 2 % of the stroke of a stop that the valve file has (effect end_stop)
    reversal     from the first slip of a new direction to the start of the next slip
    slipping up, slipping down, stuck                   the rest

A slip is matched with the nearest one of the same direction within 40 % of the median time between slips.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from config.valve import ValveFile
from workbench.motion import Slip, directions

PHASES = ("stuck", "slipping up", "slipping down", "reversal", "near stops")
STUCK, UP, DOWN, REVERSAL, NEAR_STOPS = range(len(PHASES))
NEAR = 0.02
WITHIN = 0.4
MATCHED_SAMPLES = 3


@dataclass(frozen=True, slots=True)
class Matched:
    """A measured slip and the model's: how much later, s, and farther, m, the model's is."""

    time_s: float
    direction: int
    reversal: bool
    late_s: float
    farther_m: float
    ends_farther_m: float
    """How far beyond the measured end, in the direction of motion, the model's ends."""


@dataclass(frozen=True, slots=True)
class SlipEvents:
    """Slips matched, and the times of those that the model misses and invents."""

    matched: tuple[Matched, ...]
    missed_s: tuple[float, ...]
    invented_s: tuple[float, ...]


def phases(position_m: Column, noise_m: float, found: Sequence[Slip], valve: ValveFile) -> NDArray[np.int64]:
    """Return the phase of each sample of an unbroken stretch, an index into PHASES."""
    way = directions(position_m, noise_m)
    phase = np.select([way > 0, way < 0], [UP, DOWN], STUCK).astype(np.int64)
    for i, slip in enumerate(found):
        if i and slip.direction != found[i - 1].direction:
            phase[slip.first : found[i + 1].first if i + 1 < len(found) else None] = REVERSAL
    for lower_m, upper_m in _stops(valve):
        margin_m = NEAR * valve.valve.stroke_m
        phase[(position_m < lower_m + margin_m) | (position_m > upper_m - margin_m)] = NEAR_STOPS
    return phase


def _stops(valve: ValveFile) -> list[tuple[float, float]]:
    tables = [each.parameters for each in valve.effect if each.name == "end_stop"]
    return [(each["lower_m"], each["lower_m"] + each["travel_m"]) for each in tables]


def matched(time_s: Column, measured: Sequence[Slip], simulated: Sequence[Slip]) -> SlipEvents:
    """Match the slips of an unbroken stretch."""
    if not measured or not simulated:
        return SlipEvents((), _times(time_s, measured), _times(time_s, simulated))
    begins = np.array([time_s[each.first] for each in measured])
    between_s = float(np.median(np.diff(begins))) if len(measured) > 1 else float(time_s[-1] - time_s[0])
    within_s = max(WITHIN * between_s, MATCHED_SAMPLES * float(np.median(np.diff(time_s))))
    left = list(simulated)
    pairs, missed = [], []
    for i, slip in enumerate(measured):
        near = [each for each in left if each.direction == slip.direction and _apart(time_s, each, slip) <= within_s]
        if not near:
            missed.append(slip)
            continue
        partner = min(near, key=lambda each, slip=slip: abs(time_s[each.first] - time_s[slip.first]))  # type: ignore[misc]
        left.remove(partner)
        pairs.append(
            Matched(
                float(time_s[slip.first]),
                slip.direction,
                i > 0 and measured[i - 1].direction != slip.direction,
                float(time_s[partner.first] - time_s[slip.first]),
                partner.travel_m - slip.travel_m,
                slip.direction * (partner.to_m - slip.to_m),
            )
        )
    return SlipEvents(tuple(pairs), _times(time_s, missed), _times(time_s, left))


def _apart(time_s: Column, one: Slip, other: Slip) -> float:
    return abs(float(time_s[one.first] - time_s[other.first]))


def _times(time_s: Column, found: Sequence[Slip]) -> tuple[float, ...]:
    return tuple(float(time_s[each.first]) for each in found)
