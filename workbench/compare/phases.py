"""What the stem is doing, sample by sample, from the measurement.

near stops   within 2 % of the stroke of a stop that the valve file has (effect end_stop)
reversal     from the first slip of a new direction to the start of the next slip
slipping up, slipping down, stuck                   the rest
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from config.valve_file import ValveFile
from signals.moves import Slip

PHASES = ("stuck", "slipping up", "slipping down", "reversal", "near stops")
STUCK, UP, DOWN, REVERSAL, NEAR_STOPS = range(len(PHASES))
NEAR_STOP_STROKE_SHARE = 0.02
"""Of the stroke: nearer to a stop the stem is near it."""


def phases(position_m: Column, found: Sequence[Slip], valve: ValveFile) -> NDArray[np.int64]:
    """Return the phase of each sample of an unbroken stretch, an index into PHASES, (n,) as the positions, m."""
    phase = np.full(position_m.size, STUCK, np.int64)
    for each in found:
        phase[each.first + 1 : each.last + 1] = UP if each.direction > 0 else DOWN
    for i, slip in enumerate(found):
        if i and slip.direction != found[i - 1].direction:
            phase[slip.first : found[i + 1].first if i + 1 < len(found) else None] = REVERSAL
    for lower_m, upper_m in _stops(valve):
        margin_m = NEAR_STOP_STROKE_SHARE * valve.valve.stroke_m
        phase[(position_m < lower_m + margin_m) | (position_m > upper_m - margin_m)] = NEAR_STOPS
    return phase


def _stops(valve: ValveFile) -> list[tuple[float, float]]:
    tables = [each.parameters for each in valve.effect if each.name == "end_stop"]
    return [(each["lower_m"], each["lower_m"] + each["travel_m"]) for each in tables]
