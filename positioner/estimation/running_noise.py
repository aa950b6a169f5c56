"""White noise of the position, measured while the stem does whatever it does.

The third difference of a smooth signal is small of third order in the step, that of white noise is not:

    d_k = x_k - 3 x_(k-1) + 3 x_(k-2) - x_(k-3),    var d = (1 + 9 + 9 + 1) σ^2 = 20 σ^2

A median takes no note of the few samples at a jerk: |d| has the median 0.6745 sqrt(20) σ over a block of samples, and
σ is the median of the blocks. Rounding that hides the noise at rest shows once the stem moves.
"""

from statistics import median

import numpy as np

from positioner.estimation.array import Array

_MEDIAN_OF_THIRD_DIFFERENCE = 0.6744897502 * 20**0.5


class PositionNoise:
    """Standard deviation of the position's white noise, block by block."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget every block."""
        self._blocks: list[float] = []

    def add(self, position_m: Array) -> None:
        """Take a block of at least four positions, evenly sampled or nearly so."""
        differences = np.abs(np.diff(position_m, 3))
        self._blocks.append(float(np.median(differences)) / _MEDIAN_OF_THIRD_DIFFERENCE)

    def add_all(self, position_m: Array, length: int) -> None:
        """Take all the whole blocks of that length that a record has."""
        count = len(position_m) // length
        blocks = np.abs(np.diff(position_m[: count * length].reshape(count, length), 3, axis=1))
        self._blocks += (np.median(blocks, axis=1) / _MEDIAN_OF_THIRD_DIFFERENCE).tolist()

    @property
    def std_m(self) -> float:
        """Standard deviation in m; 0 before the first block."""
        return median(self._blocks) if self._blocks else 0.0
