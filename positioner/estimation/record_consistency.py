"""Is the whole record that of the valve that was fitted to a part of it?

A sensor that jumps looks like a stem that turned round: the motion is cut there, the part after it is fitted to the
noise, and the part before it, which says otherwise, is too short to be fitted. So each stretch of motion between two
rests is followed whole, from the rest before it, by the fitted response (`stem_response`):

    r_i = x_i - (g X_g + q X_q + x_0 X_0)_i,    abs(r_i), abs(r_i - r_(i-1)) <= 4 allowed + abs(x'_i) L_i + g D_i

allowed is what the fit's own residual may be. The rest is what lateness leaves open, for a cycle may be late, and then
neither the sample nor the command between two samples is known to the period:

    L_i    the longest interval about sample i, or the one in which the motion began: the stem goes x' L in it
    D_i    sum of changes of the pressure over intervals longer than a period, forgotten with τ

Where the pressure rises over several samples, x_0 and v_0 are fitted where the stem is first seen in motion. They must
be what a rest leads to, in direction s, but for what lateness leaves open:

    s (x_0 - x_rest) >= -x' L - g D,    s v_0 >= -x'

A stem with Coulomb friction cannot turn round without a rest, unless the pressure falls by 2 F_c meanwhile, and then
the response ends there.

A jump that is smaller than x' L in the first milliseconds cannot be told. A drift is no matter of single samples:
`batch` fits it beside the model.
"""

from dataclasses import replace
from math import exp

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.likelihood import LikelihoodFit
from positioner.estimation.motion_preparation import PreparedMotion, prepared
from positioner.estimation.motion_segment import MotionSegment
from positioner.estimation.stem_response import responses

CERTAIN = 4.0
"""Times what residuals may be, beyond which one is no chance."""
IN_A_ROW = 2
"""Samples: one alone is a spike, which no fit of hundreds hangs on."""
FIRST_MOVING_SAMPLES = 10
"""Samples that tell how fast a stem is after it has left its rest."""
LATE = 1.5
"""Times the median interval: a longer one has hidden a command."""


def contradicts(stretch: MotionSegment, fit: LikelihoodFit, allowed_m: float, *, held: bool) -> bool:
    """Return whether a whole stretch of motion contradicts a fit to a part of it.

    Args:
        stretch: from the rest before it to the one after it.
        fit: of a part of the record.
        allowed_m: by which its own residuals may be off.
        held: how the pressure goes between the samples.
    """
    motion = _begun_as_fitted(prepared(stretch, held=held), fit)
    tau, mu, g, q = exp(fit.p[0]), exp(fit.p[1]), float(fit.p[2]), float(fit.p[3])
    X_g, X_q, X_0, X_1 = responses(motion.time_s, motion.pressure_pa, motion.direction, tau, mu, held=held)
    left = motion.position_m - (g * X_g + q * X_q)[1:]
    if motion.free_velocity:
        beginning = np.column_stack((X_0[1:], X_1[1:]))
        x_0, v_0 = np.linalg.lstsq(beginning, left)[0].tolist()
        left = left - beginning @ (x_0, v_0)
        if stretch.begins and _leaves_no_rest(stretch, motion, x_0, v_0, g, allowed_m * _deviations(beginning)):
            return True
    else:
        left = left - motion.rest_m * X_0[1:]
    followed = motion.position_m - left
    way = np.abs(np.diff(followed, prepend=followed[0] if motion.free_velocity else motion.rest_m))
    open_m = CERTAIN * allowed_m + _open_by_lateness_m(motion, way, g, tau)
    off = np.abs(left) > open_m
    jumped = np.abs(np.diff(left)) > open_m[1:]
    return bool((off[1:] & off[:-1]).any() or _stays(left, jumped, open_m))


def _deviations(columns: Array) -> Array:
    """Return the standard deviations of what columns are weighed with, for residuals of 1."""
    return np.asarray(np.sqrt(np.diag(np.linalg.pinv(columns.T @ columns))))


def _leaves_no_rest(
    stretch: MotionSegment, motion: PreparedMotion, x_0: float, v_0: float, g: float, std: Array
) -> bool:
    """Return whether a motion whose beginning was not seen cannot have begun from the rest before it.

    Args:
        stretch: with that rest.
        motion: from where it is first seen.
        x_0, v_0: fitted there, m and m/s.
        g: of the fit, m/Pa.
        std: of the two.
    """
    s, rest_m = stretch.direction, float(stretch.position_m[: stretch.begins].mean())
    steps, first = np.diff(motion.time_s)[1 : FIRST_MOVING_SAMPLES + 1], motion.position_m[: FIRST_MOVING_SAMPLES + 1]
    speed = abs(float(np.median(np.diff(first) / steps))) if len(steps) else 0.0
    late_m = speed * float(steps.max(initial=0.0)) + g * float(
        _hidden_changes_pa(motion)[: FIRST_MOVING_SAMPLES + 1].sum()
    )
    back_m, back_m_per_s = -s * (x_0 - rest_m), -s * v_0
    return back_m > CERTAIN * float(std[0]) + late_m or back_m_per_s > CERTAIN * float(std[1]) + speed


def _begun_as_fitted(motion: PreparedMotion, fit: LikelihoodFit) -> PreparedMotion:
    """Return a motion begun at the instant that the fit has found in the gap in which it began."""
    first_s, second_s = motion.time_s[:2]
    begun = [each for each in fit.start_s if first_s < each < second_s]
    if motion.free_velocity or not begun:
        return motion
    return replace(motion, time_s=np.append(begun[0], motion.time_s[1:]))


def _open_by_lateness_m(motion: PreparedMotion, way: Array, g: float, tau: float) -> Array:
    """Return how far the stem may be off for samples and commands that are late, abs(x') L + g D, m: (n,)."""
    steps = np.maximum(np.diff(motion.time_s), 1e-9)
    late_s = _largest_near(steps)
    if not motion.free_velocity:
        late_s = np.maximum(late_s, steps[0])
    changes = _hidden_changes_pa(motion)
    open_pa, kept = np.zeros_like(changes), 0.0
    for at, (change, step) in enumerate(zip(changes.tolist(), steps.tolist(), strict=True)):
        kept = kept * exp(-step / tau) + change
        open_pa[at] = kept
    return np.asarray(_largest_near(way / steps) * late_s + g * open_pa)


def _hidden_changes_pa(motion: PreparedMotion) -> Array:
    """Return the changes of the pressure over intervals that hide when they came, Pa: (n,)."""
    steps = np.diff(motion.time_s)
    changes = np.abs(np.diff(motion.pressure_pa)) * (steps > LATE * float(np.median(steps)))
    changes[0] = 0.0  # when that came is fitted, and of its instant x' says what is open
    return np.asarray(changes)


def _largest_near(values: Array) -> Array:
    """Return the largest of each value and those beside it."""
    padded = np.concatenate((values[:1], values, values[-1:]))
    return np.asarray(np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:]))


def _stays(left: Array, jumped: "np.typing.NDArray[np.bool_]", open_m: Array) -> bool:
    """Return whether what was left jumped, and did not come back."""
    for at in np.flatnonzero(jumped):
        before, after = left[max(0, at - IN_A_ROW) : at + 1], left[at + 1 : at + 1 + IN_A_ROW]
        if len(after) and abs(float(np.median(after)) - float(np.median(before))) > open_m[at + 1]:
            return True
    return False
