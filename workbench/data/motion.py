"""How fast the stem goes, sample by sample, the same for a measurement and a simulation.

v_i = (x_(i+w) - x_(i-w)) / (t_(i+w) - t_(i-w)),  w = 2      x'' by local parabolas over nine samples
"""

import numpy as np

from config.recording import Column

REACH = 2  # samples to either side of which a velocity is made
PARABOLA_ROWS = 9
"""Samples of a local parabola, from which accelerations come."""


def velocity_m_per_s(time_s: Column, position_m: Column) -> Column:
    """Return the velocity at each sample, m/s, (n,); NaN next to what is not a number, 0 at the ends.

    Args:
        time_s: s, (n,).
        position_m: m, (n,).
    """
    velocity = np.zeros(position_m.size)
    w = REACH
    velocity[w:-w] = (position_m[2 * w :] - position_m[: -2 * w]) / (time_s[2 * w :] - time_s[: -2 * w])
    return velocity


def acceleration_m_per_s2(position_m: Column, period_s: float) -> Column:
    """Return the acceleration at each sample, m/s^2, (n,), by local parabolas; at the ends that of the outermost one.

    Args:
        position_m: m, (n,), at least `PARABOLA_ROWS` samples.
        period_s: between samples, s.
    """
    from scipy.signal import savgol_filter  # takes as long to load as all else together

    acceleration: Column = savgol_filter(position_m, PARABOLA_ROWS, 2, deriv=2, delta=period_s)
    return acceleration
