"""The dead band: the error at rest that is left alone.

    d = d_0                                          [control] dead_band = a number
    d = max(d_least, 3 sigma, j / 2), at most 2 %     [control] dead_band = "auto"

    j = (F_s - F_c) / k_s                            how far the stem jumps when it breaks loose, m; where F_s is not
                                                     known, the shortest slide that was seen: it jumps no farther

sigma is the noise of the position, of the rests so far. j counts for a law that commands all the while: one that wants
less than half a jump hunts for ever. A law of single steps places the stem within a jump, and is given sigma alone.
"""

from dataclasses import dataclass

from config.daemon_file import LEAST_DEAD_BAND
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimate

WIDEST_DEAD_BAND_SHARE = 0.02
"""Of the stroke: more is no positioner."""
DEVIATIONS = 3.0
"""Of the noise: one sample in 400 lies farther off."""
HALF = 0.5
"""Of a jump."""


@dataclass(frozen=True, slots=True)
class DeadBand:
    """m; `adapts` to what is identified."""

    stroke_m: float
    fixed_m: float | None = None
    jumps: bool = False
    """Whether the law commands all the while, so that a jump counts."""

    def in_force_m(
        self, noise_m: float, breakaway: Estimate, ratios: Ratios | None, longest_jump_m: float = 0.0
    ) -> float:
        """Return d, m, by what is known.

        Args:
            noise_m: of the position.
            breakaway: F_s / A.
            ratios: in use.
            longest_jump_m: where F_s is not known, by the shortest slide that was seen; 0: none was.
        """
        if self.fixed_m is not None:
            return self.fixed_m
        jump_m = self._jump_m(breakaway, ratios, longest_jump_m) if self.jumps else 0.0
        wanted_m = max(LEAST_DEAD_BAND * self.stroke_m, DEVIATIONS * noise_m, HALF * jump_m)
        return min(wanted_m, WIDEST_DEAD_BAND_SHARE * self.stroke_m)

    @staticmethod
    def _jump_m(breakaway: Estimate, ratios: Ratios | None, longest_m: float) -> float:
        if ratios is None or not breakaway.valid:
            return longest_m
        return max(breakaway.value + ratios.k_over_c, 0.0) / -ratios.b_over_c
