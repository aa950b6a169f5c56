"""White noise of the position, measured block by block while the stem does whatever it does.

The mathematics is that of the record's estimator (`signals.noise`): the median of |third difference| over each block,
the median over the blocks. Here the blocks come one after another, each a window of the running record, and there are
never all samples at once.
"""

from bisect import insort

import numpy as np

from positioner.estimation.array import Array
from signals.noise import noise_by_median


class PositionNoise:
    """Standard deviation of the position's white noise, block by block.

    Attributes:
        std_m: standard deviation in m; 0 before the first block.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget every block."""
        self._blocks: list[float] = []  # from the least on: S3 may take ten minutes
        self.std_m = 0.0

    def add(self, position_m: Array) -> None:
        """Take a block of positions, (N,), N >= 4, m, evenly sampled or nearly so."""
        blocks, half = self._blocks, (len(self._blocks) + 1) // 2
        insort(blocks, float(noise_by_median(np.diff(position_m, 3))))
        self.std_m = (blocks[half] + blocks[-1 - half]) / 2.0
