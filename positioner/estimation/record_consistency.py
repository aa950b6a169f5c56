"""Is the whole record that of the valve that was fitted to a part of it?

A sensor that jumps looks like a stem that turned round: the motion is cut there, the part after it is fitted to the
noise, and the part before it, which says otherwise, is too short to be fitted. So each stretch of motion between two
rests is followed whole, from the rest before it, by the fitted response (`stem_response`):

    r_i = x_i - (g X_g + q X_q + x_0 X_0)_i,    abs(r_i), abs(r_i - r_(i-1)) <= 4 allowed + abs(x'_i) h

allowed is what the fit's own residual may be; x' h, how far the stem goes in a period, is what the instants of samples
and commands leave open. A stem with Coulomb friction cannot turn round without a rest, unless the pressure falls by
2 F_c meanwhile, and then the response ends there.

    drift     x_i = response + d t      a shift that grows is another model of the same motion: where the record fits
                                        it better, with another b/c or k/c, the first is not believed

Smaller than x' h in the first milliseconds, or than what d is known to, a jump or a drift cannot be told.
"""

from math import exp

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.likelihood import LikelihoodFit
from positioner.estimation.motion_preparation import prepared
from positioner.estimation.motion_segment import MotionSegment
from positioner.estimation.stem_response import responses

CERTAIN = 4.0
"""Times what residuals may be, beyond which one is no chance."""
IN_A_ROW = 2
"""Samples: one alone is a spike, which no fit of hundreds hangs on."""


def contradicts(stretch: MotionSegment, fit: LikelihoodFit, allowed_m: float, *, held: bool) -> bool:
    """Return whether a whole stretch of motion contradicts a fit to a part of it.

    Args:
        stretch: from the rest before it to the one after it.
        fit: of a part of the record.
        allowed_m: by which its own residuals may be off.
        held: how the pressure goes between the samples.
    """
    motion = prepared(stretch, held=held)
    tau, mu, g, q = exp(fit.p[0]), exp(fit.p[1]), float(fit.p[2]), float(fit.p[3])
    X_g, X_q, X_0, X_1 = responses(motion.time_s, motion.pressure_pa, motion.direction, tau, mu, held=held)
    left = motion.position_m - (g * X_g + q * X_q)[1:]
    if motion.free_velocity:
        begins = np.column_stack((X_0[1:], X_1[1:]))
        left = left - begins @ np.linalg.lstsq(begins, left)[0]
        way = np.abs(np.diff(motion.position_m, prepend=motion.position_m[0]))
    else:
        left = left - motion.rest_m * X_0[1:]
        way = np.abs(np.diff(g * X_g + q * X_q + motion.rest_m * X_0))
    open_m = CERTAIN * allowed_m + _largest_near(way)
    off = np.abs(left) > open_m
    jumped = np.abs(np.diff(left)) > open_m[1:]
    return bool((off[1:] & off[:-1]).any() or _stays(left, jumped, open_m))


def _largest_near(way: Array) -> Array:
    """Return the longest way in a period at each sample or beside it."""
    padded = np.concatenate((way[:1], way, way[-1:]))
    return np.asarray(np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:]))


def _stays(left: Array, jumped: "np.typing.NDArray[np.bool_]", open_m: Array) -> bool:
    """Return whether what was left jumped, and did not come back."""
    for at in np.flatnonzero(jumped):
        before, after = left[max(0, at - IN_A_ROW) : at + 1], left[at + 1 : at + 1 + IN_A_ROW]
        if len(after) and abs(float(np.median(after)) - float(np.median(before))) > open_m[at + 1]:
            return True
    return False
