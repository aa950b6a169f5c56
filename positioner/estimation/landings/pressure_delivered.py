"""Is the pressure measured at a rest the one that was commanded, as far as the two have belonged together before?

    p = o + m u        over the rests so far: m the median of the slopes between any two of them (Theil and Sen),
                       o the median of what that leaves
    |p - o - m u| <= max(5 % m max|u|, 6 sigma) + 20 % m (how far u lies beyond all before)

A register of another scale, an I/P that is off its zero or a sensor that is: all that is m and o, and says nothing. A
supply that has fallen gives less than was asked for: where the stem rests then is no landing of the command. A pressure
that does not rise with the command is none of the actuator's, and tells nothing.
"""

from collections import deque
from math import isnan

import numpy as np

FEWEST_RESTS, MOST_RESTS = 4, 40
"""Rests: before there are so many nothing is known; so many are remembered."""
ALIKE, SCATTERED, BEYOND = 0.05, 6.0, 0.2


class PressureDelivered:
    """The commands at rests and the pressures measured there, the last ones."""

    def __init__(self) -> None:
        self._pairs_pa: deque[tuple[float, float]] = deque(maxlen=MOST_RESTS)

    def add(self, command_pa: float, pressure_pa: float) -> None:
        """Take what belongs together, Pa; NaN: it is not measured."""
        if not isnan(pressure_pa):
            self._pairs_pa.append((command_pa, pressure_pa))

    def agrees(self, command_pa: float, pressure_pa: float) -> bool:
        """Whether a pressure measured at a rest can be the one commanded, Pa; where nothing is known, it can."""
        if isnan(pressure_pa) or len(self._pairs_pa) < FEWEST_RESTS:
            return True
        u, p = np.array(self._pairs_pa).T
        one, other = np.triu_indices(u.size, 1)
        apart = u[one] != u[other]
        slopes = (p[other] - p[one])[apart] / (u[other] - u[one])[apart]
        m = float(np.median(slopes)) if slopes.size else 0.0
        if m <= 0.0:
            return True
        left_pa = p - m * u
        o = float(np.median(left_pa))
        sigma_pa = 1.4826 * float(np.median(np.abs(left_pa - o)))
        beyond_pa = max(0.0, command_pa - float(u.max()), float(u.min()) - command_pa)
        allowed_pa = max(ALIKE * m * float(np.abs(u).max()), SCATTERED * sigma_pa) + BEYOND * m * beyond_pa
        return abs(pressure_pa - o - m * command_pa) <= allowed_pa
