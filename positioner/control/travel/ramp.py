"""A ramp of the reference: it changes no faster than a rate, one for each direction.

r_n = r_(n-1) + min(max(y - r_(n-1), -v_down dt), v_up dt)
"""

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True, slots=True)
class Ramp:
    """v_up and v_down of the stem, m/s; infinite: none."""

    up_m_per_s: float = inf
    down_m_per_s: float = inf

    def after(self, before_m: float, target_m: float, lasted_s: float) -> float:
        """Return r after some time, s.

        >>> Ramp(0.25, 0.5).after(0.0, 1.0, 0.5), Ramp(0.25, 0.5).after(1.0, 0.0, 0.5)
        (0.125, 0.75)
        """
        if target_m > before_m:
            return min(target_m, before_m + self.up_m_per_s * lasted_s) if lasted_s > 0.0 else before_m
        return max(target_m, before_m - self.down_m_per_s * lasted_s) if lasted_s > 0.0 else before_m
