"""Is the stem moving, and which way: the derivative estimate held against its own standard deviation.

At rest the slope v of the window (`derivatives`) is noise of standard deviation σ_v. Motion begins when it stands out
of that noise and of a threshold, and ends when it falls under the threshold or turns round:

    begins   |v| > threshold + 5 σ_v         ends   |v| < threshold, or the sign changes

While the stem moves one way the slope cannot change its sign, and over a window of standstill it is zero: so the end is
detected at the latest one window after it was. The beginning is then found in the positions themselves.
"""

import numpy as np

from positioner.estimation.array import Array

CERTAIN = 5.0
"""Standard deviations by which a velocity stands out: once in some million windows by chance."""


class MotionDetector:
    """Direction of motion, sample by sample.

    Args:
        threshold_m_per_s: velocity below which the stem counts as stopped.
    """

    def __init__(self, threshold_m_per_s: float) -> None:
        self._threshold = threshold_m_per_s
        self.direction = 0

    def stop(self) -> None:
        """Forget the motion, as when the record is broken."""
        self.direction = 0

    def update(self, slope_m_per_s: float, std_m_per_s: float) -> int:
        """Take a slope and its standard deviation; return +1 up, -1 down, 0 not known to move."""
        if self.direction:
            if self.direction * slope_m_per_s < self._threshold:
                self.direction = 0
        elif abs(slope_m_per_s) > self._threshold + CERTAIN * std_m_per_s:
            self.direction = 1 if slope_m_per_s > 0 else -1
        return self.direction


def motion_start(position_m: Array, direction: int, noise_m: float) -> int:
    """Return the index at which a motion, direction +1 or -1, began within a window, (N,), m, that ends in it.

    It is the last sample that does not yet stand out of the window's extreme, which noise alone puts some two to
    three standard deviations beyond the resting place.
    """
    travel = direction * position_m
    return int(np.flatnonzero(travel <= travel.min() + (CERTAIN + 1) * noise_m)[-1])
