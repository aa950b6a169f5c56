"""The last N samples of the record, with the derivatives found at each, side by side in memory, oldest first."""

# np.median loads numpy.ma when it is first called: 20 ms, which no cycle has.
import numpy as np
import numpy.ma

from positioner.estimation.array import Array
from positioner.estimation.derivatives import SHORTEST

COLUMNS = 5
_TURNS = 8
"""The record is moved back to the front of its memory once in this many times its length."""


class SampleWindow:
    """A ring of samples that is always contiguous in memory.

    Args:
        window_s: the time it holds; N follows from the median period of its first samples.
    """

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self.clear()

    def clear(self) -> None:
        """Forget every sample, and the period."""
        self.length = SHORTEST
        self._sized = False
        self._data = np.zeros((COLUMNS, _TURNS * SHORTEST))
        self._end = self._count = 0
        self._last_s = np.nan

    def _size(self) -> None:
        period_s = float(np.median(np.diff(self.time_s)))
        self.length = max(SHORTEST, round(self._window_s / period_s) + 1)
        data = np.zeros((COLUMNS, _TURNS * self.length))
        data[:, : self._count] = self._data[:, : self._count]
        self._data, self._sized = data, True

    def append(self, time_s: float, position_m: float, pressure_pa: float) -> None:
        """Take a sample; beyond N the oldest is forgotten."""
        if self._end == self._data.shape[1]:
            kept = self.length - 1
            self._data[:, :kept] = self._data[:, -kept:]
            self._end = kept
        data, end = self._data, self._end  # value by value: a row at once costs twice as much
        data[0, end], data[1, end], data[2, end] = time_s, position_m, pressure_pa
        data[3, end] = data[4, end] = np.nan
        self._end, self._last_s = end + 1, time_s
        self._count = min(self._count + 1, self.length)
        if self._count == SHORTEST and not self._sized:
            self._size()

    def set_derivatives(self, velocity_m_per_s: float, acceleration_m_per_s2: float) -> None:
        """Note the derivatives at the latest sample."""
        data, last = self._data, self._end - 1
        data[3, last], data[4, last] = velocity_m_per_s, acceleration_m_per_s2

    def breaks(self, time_s: float) -> bool:
        """Whether a sample cannot follow: its clock did not advance, or a whole record of samples is missing."""
        if not self._count:
            return False
        step = time_s - self._last_s
        if step <= 0 or self._count == 1:
            return step <= 0
        held_s = self._last_s - float(self._data[0, self._end - self._count])
        return step > self.length * held_s / (self._count - 1)

    @property
    def full(self) -> bool:
        """Whether N samples are there."""
        return self._count == self.length

    @property
    def count(self) -> int:
        """Number of samples held."""
        return self._count

    @property
    def time_s(self) -> Array:
        """Time stamps, (N,), s, oldest first."""
        return self._data[0, self._end - self._count : self._end]

    @property
    def position_m(self) -> Array:
        """Positions, (N,), m, oldest first."""
        return self._data[1, self._end - self._count : self._end]

    @property
    def pressure_pa(self) -> Array:
        """Pressures, (N,), Pa, oldest first."""
        return self._data[2, self._end - self._count : self._end]

    def oldest(self) -> tuple[float, float, float, float, float]:
        """Return time, position, pressure, velocity and acceleration of the oldest sample, SI units."""
        t, x, u, v, a = self._data[:, self._end - self._count].tolist()
        return t, x, u, v, a
