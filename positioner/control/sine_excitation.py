"""The excitation of S3: enough to move the stem, and never constant.

    u(t) = alpha + beta sin(omega (t - t_0))      (25), from t_0, the entry into S3

alpha must exceed F_s/A, or the stem may not move; a constant input (beta = 0) leaves c unidentifiable (seed, 3.2).
The whole sine must lie within the pressure limits: a clipped sine is refused, not repaired.
"""

import math
from dataclasses import dataclass

from config.codes import InhibitReason


@dataclass(frozen=True, slots=True)
class SineExcitation:
    """An excitation as asked for: Pa, Pa, rad/s."""

    alpha_pa: float
    beta_pa: float
    omega_rad_per_s: float

    def pressure_pa(self, elapsed_s: float) -> float:
        """Return u at a time since the entry into S3, in s."""
        return self.alpha_pa + self.beta_pa * math.sin(self.omega_rad_per_s * elapsed_s)

    def problem(self, minimum_pa: float, maximum_pa: float, breakaway_pa: float | None) -> InhibitReason:
        """Return what inhibits it: pressure limits in Pa, F_s/A in Pa where that is known."""
        if self.beta_pa <= 0.0:
            return InhibitReason.AMPLITUDE_ZERO
        if breakaway_pa is not None and self.alpha_pa <= breakaway_pa:
            return InhibitReason.ALPHA_BELOW_BREAKAWAY
        if self.alpha_pa - self.beta_pa < minimum_pa or self.alpha_pa + self.beta_pa > maximum_pa:
            return InhibitReason.EXCITATION_BEYOND_LIMITS
        return InhibitReason.NOTHING
