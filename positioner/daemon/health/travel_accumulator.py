"""The travel accumulator: how far the stem has gone and how often it turned round, noise left out.

    reference point p, dead band e:    |x - p| <= e: nothing
                                       |x - p| >  e: travel += |x - p|;  p = x
    a reversal is a count whose direction is not the last one's

While the stem goes one way the counts telescope to what it went. At a reversal, what lies between the last count and
the end is lost there and back: e on the average, 2 e at the most. Noise at rest counts nothing as long as it stays
within e of p, which is itself a noisy sample: e = max(the configured one, 12 σ). A million samples of white noise
spread over 10 σ.

σ is followed by the median m of |x_k - 2 x_(k-1) + x_(k-2)|, whose variance is 6 σ^2, so m = 0.6745 sqrt(6) σ:
m grows by 2 % when a sample is above it, shrinks by 2 % when it is not. It starts high, so that nothing is counted
before the noise is known. A moving stem raises it little at the rates of a bus; e is 5 % of the stroke at the most, so
that noise above 0.4 % of the stroke does count.
"""

from bisect import bisect_right

SPANS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 0.9)
"""Upper edges of how far the stem goes from one turn to the next, shares of the stroke; the last bin is beyond."""
STEP = 1.02
"""By how much one sample changes the median followed."""
SIGMAS = 12.0
_BAND_PER_MEDIAN = SIGMAS / (0.6744897502 * 6**0.5)
LARGEST_BAND = 0.05
"""Of the stroke: what noise may widen the dead band to."""
SMALLEST = 1e-9
"""Of the stroke: where the median followed stops to shrink."""


class TravelAccumulator:
    """Written by the cycle thread, a sample at a time. Lengths in m."""

    def __init__(self, stroke_m: float, dead_band_m: float) -> None:
        self.travel_m = 0.0
        self.reversals = 0
        self._dead_band_m = dead_band_m
        self._largest_m = max(LARGEST_BAND * stroke_m, dead_band_m)
        self._smallest_m = SMALLEST * stroke_m
        self._median_m = self._largest_m / _BAND_PER_MEDIAN
        self._last_m = self._one_before_m = self._point_m = 0.0
        self._direction = 0
        self._span_m = 0.0
        self.spans = [0] * (len(SPANS) + 1)
        self._stroke_m = stroke_m
        self._seen = 0

    @property
    def band_m(self) -> float:
        """The dead band in force."""
        return min(max(self._dead_band_m, _BAND_PER_MEDIAN * self._median_m), self._largest_m)

    def enter(self, position_m: float) -> None:
        """Take a good sample, which is a number."""
        if self._seen < 2:
            self._begin(position_m)
            return
        bend_m = position_m - 2.0 * self._last_m + self._one_before_m
        self._one_before_m, self._last_m = self._last_m, position_m
        median_m = self._median_m
        if bend_m > median_m or -bend_m > median_m:
            self._median_m = median_m * STEP
        elif median_m > self._smallest_m:
            self._median_m = median_m / STEP
        moved_m = position_m - self._point_m
        if moved_m > self._dead_band_m or -moved_m > self._dead_band_m:
            self._move(moved_m, position_m)

    def _begin(self, position_m: float) -> None:
        if not self._seen:
            self._point_m = position_m
        self._one_before_m, self._last_m = self._last_m, position_m
        self._seen += 1

    def _move(self, moved_m: float, position_m: float) -> None:
        if abs(moved_m) <= self.band_m:
            return
        direction = 1 if moved_m > 0 else -1
        self.travel_m += abs(moved_m)
        if direction == -self._direction:
            self.reversals += 1
            self.spans[bisect_right(SPANS, self._span_m / self._stroke_m)] += 1
            self._span_m = 0.0
        self._span_m += abs(moved_m)
        self._direction = direction
        self._point_m = position_m
