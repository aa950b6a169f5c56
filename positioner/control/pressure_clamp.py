"""The clamp of the control core: every pressure that is kept within limits goes through it.

    clamped(u) = min(max(u, u_min), u_max)      of a finite u; of any other there is none (NaN)

`min(max(u, lo), hi)` alone lets NaN through, and makes a limit of infinity: a law that divides by zero would open the
valve. What is none here the controller refuses in one place: it holds the last command, and that is a fault of the
daemon's own (`Fault.COMMAND_NOT_FINITE`).
"""

from math import isfinite, nan
from numbers import Real


def clamped(pressure_pa: float, least_pa: float, most_pa: float) -> float:
    """Return the pressure within two limits that is nearest to one, Pa; NaN where that is not finite.

    >>> clamped(2.0, 0.0, 1.0), clamped(float("inf"), 0.0, 1.0)
    (1.0, nan)
    """
    return min(max(pressure_pa, least_pa), most_pa) if isfinite(pressure_pa) else nan


def number_of(asked: object) -> float:
    """Return what a law gives for a pressure, Pa; NaN where it is no number, as of a text.

    >>> number_of(1), number_of("1")
    (1.0, nan)
    """
    return float(asked) if isinstance(asked, Real) else nan
