"""A low-pass of the reference.

    y_n = y_(n-1) + (1 - exp(-dt / T)) (r - y_(n-1))          y = r as soon as |r - y| <= eps

Without eps y would come ever nearer to r and never be there, and the law would be asked for ever smaller moves.
"""

from dataclasses import dataclass
from math import expm1


@dataclass(frozen=True, slots=True)
class LowPass:
    """T, s (0: none), and eps, m."""

    time_constant_s: float = 0.0
    near_m: float = 0.0

    def after(self, before_m: float, target_m: float, lasted_s: float) -> float:
        """Return y after some time, s.

        >>> LowPass(1.0, 1e-5).after(0.0, 0.01, 0.0), LowPass(1.0, 1e-5).after(0.0, 0.01, 10.0)
        (0.0, 0.01)
        """
        if self.time_constant_s == 0.0:
            return target_m
        left_m = (before_m - target_m) * (1.0 + expm1(-lasted_s / self.time_constant_s))
        return target_m if abs(left_m) <= self.near_m else target_m + left_m
