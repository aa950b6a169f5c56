"""What the identification hands on: each value with its standard deviation, and the reason if it is not valid."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from math import nan

from config.codes import Refusal, Sampling
from config.results.result import Brief


class Directions(Enum):
    """Directions in which the stem was seen to slide: of any other, friction is not known.

    Attributes:
        unseen: the direction in which it was not, +1 up, -1 down; 0: there is none.
    """

    UP = 1
    DOWN = -1
    BOTH = 0

    def __init__(self, seen: int) -> None:
        self.unseen = -seen

    def __or__(self, other: "Directions") -> "Directions":
        """Return those of both."""
        return self if self is other else Directions.BOTH


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its standard deviation, SI units; both NaN when there is none."""

    value: float
    std: float
    reason: Refusal

    @property
    def valid(self) -> bool:
        """Whether the value may be used."""
        return self.reason is Refusal.VALID


def no_estimate(reason: Refusal) -> Estimate:
    """Return an estimate without a value, for a reason."""
    return Estimate(nan, nan, reason)


NO_BREAKAWAY = no_estimate(Refusal.WAITING_FOR_MOTION)
"""No break-away measured yet."""


@dataclass(frozen=True, slots=True, repr=False)
class Estimates(Brief):
    """All of them.

    Attributes:
        a: -F_v / m, in 1/s.
        b: -k_s / m, in 1/s^2.
        c: A / m, in m/(s^2 Pa).
        k: -F_c / m, in m/s^2.
        b_over_c: -k_s / A, in Pa/m.
        k_over_c: -F_c / A, in Pa.
        progress: of the window that is being filled, 0 to 1.
        time_s: of the last sample used, by the device's clock; NaN when none was.
        breakaway: F_s / A, in Pa; from where the stem broke away, which only a whole record shows.
        directions: in which the stem moved: of the other, k and k/c say nothing.
        sampling: of the device, as it was found out.
    """

    a: Estimate
    b: Estimate
    c: Estimate
    k: Estimate
    b_over_c: Estimate
    k_over_c: Estimate
    progress: float
    time_s: float
    breakaway: Estimate = NO_BREAKAWAY
    directions: Directions = Directions.BOTH
    sampling: Sampling = Sampling.UNKNOWN

    @property
    def law_ready(self) -> bool:
        """Whether both numbers of the control law are valid."""
        return self.b_over_c.valid and self.k_over_c.valid

    def only(self, *, parameters: bool, friction: bool) -> "Estimates":
        """Return what was asked for: a, b, c and b/c; k and k/c."""
        unasked = no_estimate(Refusal.NOT_ASKED)
        kept = self
        if not parameters:
            kept = replace(kept, a=unasked, b=unasked, c=unasked, b_over_c=unasked)
        return kept if friction else replace(kept, k=unasked, k_over_c=unasked)

    @property
    def relative_variance(self) -> float:
        """Sum of the variances, relative, of the numbers of the control law that were asked for."""
        asked = [each for each in (self.b_over_c, self.k_over_c) if each.reason is not Refusal.NOT_ASKED]
        return sum((each.std / each.value) ** 2 for each in asked)

    @property
    def acceptable(self) -> bool:
        """Whether each number of the control law that was asked for, one at least, is valid."""
        asked = [each for each in (self.b_over_c, self.k_over_c) if each.reason is not Refusal.NOT_ASKED]
        return bool(asked) and all(each.valid for each in asked)


def no_estimates(reason: Refusal) -> Estimates:
    """Return estimates without values, for a reason."""
    nothing = no_estimate(reason)
    return Estimates(nothing, nothing, nothing, nothing, nothing, nothing, progress=0.0, time_s=nan, breakaway=nothing)


def refusals_said(reasons: Mapping[str, Refusal]) -> list[str]:
    """Return a line for each reason for which estimates, by their names, are refused.

    >>> refusals_said({"a": Refusal.NOT_ASKED, "b": Refusal.VALID, "c": Refusal.NOT_ASKED})
    ['refused (a, c): this estimate was not asked for']
    """
    refused = dict.fromkeys(reason for reason in reasons.values() if reason is not Refusal.VALID)
    return [
        f"refused ({', '.join(name for name in reasons if reasons[name] is each)}): {each.text}" for each in refused
    ]
