"""Is the stem at rest, where, and how well is that known?

Samples are taken in blocks of n. A block whose mean agrees with the mean of the blocks before it,

    abs(m_block - m) <= 3 sigma sqrt(1/n + 1/N) + floor

is added to it (N grows, up to a limit: then the mean forgets), else the stem has moved and the block stands alone.
sigma^2 is the variance within the blocks, averaged over blocks at rest. Blocks are as long as the noise asks for: two
of them know the position to the resolution wanted,

    2 n = sigma^2 / resolution^2, within 6 and 60
"""

from dataclasses import dataclass
from math import inf, sqrt

SHORTEST_BLOCK, LONGEST_BLOCK = 3, 30
MOST_SAMPLES = 200
AGREEMENT = 3.0
POOLED = 0.1
"""Weight of a new block in the variance, once many blocks are in it."""


@dataclass(frozen=True, slots=True)
class RestEstimate:
    """What is known of the stem's rest; m, m^2."""

    resolution_m: float
    mean_m: float = 0.0
    count: int = 0
    """Samples in the mean; 0 until a block is complete."""
    variance_m2: float = 0.0
    blocks: int = 0
    """That the variance was taken from."""
    block_count: int = 0
    block_sum: float = 0.0
    block_squares: float = 0.0
    block_zero_m: float = 0.0

    @property
    def length(self) -> int:
        """Samples of a block."""
        if not self.blocks:
            return LONGEST_BLOCK // 3
        asked = 0.5 * self.variance_m2 / (self.resolution_m * self.resolution_m)
        return min(max(SHORTEST_BLOCK, int(asked) + 1), LONGEST_BLOCK)

    @property
    def known(self) -> bool:
        """Whether the stem has been at rest for two blocks."""
        return self.count >= 2 * self.length

    @property
    def std_m(self) -> float:
        """Standard deviation of one sample."""
        return sqrt(self.variance_m2)

    @property
    def error_m(self) -> float:
        """Standard deviation of the mean."""
        return self.std_m / sqrt(self.count) if self.count else inf

    def updated(self, position_m: float) -> "RestEstimate":
        """Return what is known after a sample."""
        zero_m = position_m if self.block_count == 0 else self.block_zero_m
        off_m = position_m - zero_m
        n = self.block_count + 1
        total, squares = self.block_sum + off_m, self.block_squares + off_m * off_m
        if n < self.length:
            return RestEstimate(
                self.resolution_m,
                self.mean_m,
                self.count,
                self.variance_m2,
                self.blocks,
                n,
                total,
                squares,
                zero_m,
            )
        mean_off_m = total / n
        variance = max(0.0, (squares - n * mean_off_m * mean_off_m) / (n - 1))
        return self._with_block(zero_m + mean_off_m, variance, n)

    def _with_block(self, block_m: float, block_variance: float, n: int) -> "RestEstimate":
        if not self.count:
            return RestEstimate(self.resolution_m, block_m, n, self.variance_m2, self.blocks)
        noise_m2 = max(self.variance_m2, block_variance if not self.blocks else 0.0)
        allowed_m = AGREEMENT * sqrt(noise_m2 * (1 / n + 1 / self.count)) + 0.25 * self.resolution_m
        if abs(block_m - self.mean_m) > allowed_m:
            return RestEstimate(self.resolution_m, block_m, n, self.variance_m2, self.blocks)
        weight = max(POOLED, 1 / (self.blocks + 1))
        variance = self.variance_m2 + weight * (block_variance - self.variance_m2)
        count = min(self.count + n, MOST_SAMPLES)
        return RestEstimate(
            self.resolution_m, self.mean_m + (block_m - self.mean_m) * n / count, count, variance, self.blocks + 1
        )

    def restarted(self) -> "RestEstimate":
        """Return what is known of a stem that may have moved: the noise."""
        return RestEstimate(self.resolution_m, variance_m2=self.variance_m2, blocks=self.blocks)
