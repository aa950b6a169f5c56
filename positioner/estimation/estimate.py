"""What the identification hands on: each value with its standard deviation, and valid or why not."""

from dataclasses import dataclass, replace
from enum import IntEnum
from math import nan


class Reason(IntEnum):
    """Why an estimate is not valid; 0 when it is. The numbers are served in a register: never renumber."""

    VALID = 0
    NOT_STARTED = 1
    NOT_ASKED = 2
    WAITING_FOR_MOTION = 3
    WINDOW_TOO_SHORT = 4
    MOTION_ENDED = 5
    RECORD_BROKEN = 6
    ILL_CONDITIONED = 7
    NOISE_DOMINATES = 8
    TOO_UNCERTAIN = 9
    PARAMETERS_MISSING = 10
    A_POSITIVE = 11
    B_NOT_NEGATIVE = 12
    C_NOT_POSITIVE = 13
    K_NOT_NEGATIVE = 14
    B_OVER_C_NOT_NEGATIVE = 15
    K_OVER_C_NOT_NEGATIVE = 16
    IMPLAUSIBLE_CHANGE = 17
    COMMANDS_MISSED = 18
    MASS_NOT_IDENTIFIABLE = 19
    MODEL_DOES_NOT_FIT = 20

    @property
    def text(self) -> str:
        """The reason in plain words."""
        return _TEXTS[self]


_TEXTS = {
    Reason.VALID: "valid",
    Reason.NOT_STARTED: "identification has not been started",
    Reason.NOT_ASKED: "this estimate was not asked for",
    Reason.WAITING_FOR_MOTION: "the stem has not been seen to move yet",
    Reason.WINDOW_TOO_SHORT: "the stem moves, but not for long enough yet",
    Reason.MOTION_ENDED: "the stem stopped or turned round before it had moved for long enough",
    Reason.RECORD_BROKEN: "the samples had a gap or their clock jumped back; waiting for a new stretch of motion",
    Reason.ILL_CONDITIONED: "pressure or position varied too little while the stem moved to tell a, b and c apart",
    Reason.NOISE_DOMINATES: (
        "noise of the sensors, or what lies between the samples, outweighs what tells a, b and c apart: biased"
    ),
    Reason.TOO_UNCERTAIN: "the standard deviation is larger than allowed",
    Reason.PARAMETERS_MISSING: "friction needs a, b and c, and none have been identified yet",
    Reason.A_POSITIVE: "a came out positive: viscous friction would drive the stem",
    Reason.B_NOT_NEGATIVE: "b did not come out negative: the spring would push the stem away from rest",
    Reason.C_NOT_POSITIVE: "c did not come out positive: pressure would pull the stem back",
    Reason.K_NOT_NEGATIVE: "k did not come out negative: Coulomb friction would drive the stem",
    Reason.B_OVER_C_NOT_NEGATIVE: "b/c did not come out negative: more pressure would hold the stem lower",
    Reason.K_OVER_C_NOT_NEGATIVE: "k/c did not come out negative: friction would drive the stem",
    Reason.IMPLAUSIBLE_CHANGE: "the value is too far from the one in use",
    Reason.COMMANDS_MISSED: "commands were missed in a gap of the samples: a, b and c singly hang on each of them",
    Reason.MASS_NOT_IDENTIFIABLE: (
        "the motion does not tell the mass: pressure changes, or samples follow, too slowly; "
        "only b/c and k/c can be known"
    ),
    Reason.MODEL_DOES_NOT_FIT: "the motion is not that of the model: the residuals outweigh the sensor's noise",
}


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its standard deviation, SI units; both NaN when there is none."""

    value: float
    std: float
    reason: Reason

    @property
    def valid(self) -> bool:
        """Whether the value may be used."""
        return self.reason is Reason.VALID


def none(reason: Reason) -> Estimate:
    """Return the estimate of which only is known why there is none."""
    return Estimate(nan, nan, reason)


NO_BREAKAWAY = none(Reason.WAITING_FOR_MOTION)
"""Nothing has been seen to break away yet."""


@dataclass(frozen=True, slots=True)
class Estimates:
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

    @property
    def law_ready(self) -> bool:
        """Whether both numbers of the control law are valid."""
        return self.b_over_c.valid and self.k_over_c.valid

    def only(self, *, parameters: bool, friction: bool) -> "Estimates":
        """Return what was asked for: a, b, c and b/c; k and k/c."""
        unasked = none(Reason.NOT_ASKED)
        kept = self
        if not parameters:
            kept = replace(kept, a=unasked, b=unasked, c=unasked, b_over_c=unasked)
        return kept if friction else replace(kept, k=unasked, k_over_c=unasked)

    @property
    def doubt(self) -> float:
        """Sum of the variances, relative, of the numbers of the control law that were asked for."""
        asked = [each for each in (self.b_over_c, self.k_over_c) if each.reason is not Reason.NOT_ASKED]
        return sum((each.std / each.value) ** 2 for each in asked)

    @property
    def acceptable(self) -> bool:
        """Whether each number of the control law that was asked for, one at least, is valid."""
        asked = [each for each in (self.b_over_c, self.k_over_c) if each.reason is not Reason.NOT_ASKED]
        return bool(asked) and all(each.valid for each in asked)


def no_estimates(reason: Reason) -> Estimates:
    """Return estimates of which only is known why there are none."""
    nothing = none(reason)
    return Estimates(nothing, nothing, nothing, nothing, nothing, nothing, progress=0.0, time_s=nan, breakaway=nothing)
