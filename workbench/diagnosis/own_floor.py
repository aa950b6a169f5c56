"""The error that no model undercuts, where the stem is driven by its measured pressure.

What a repeated command does not repeat is the pressure's doing, too, and that is measured. What no model of the stem
explains is what the residuals of one do not repeat, for what it lacks comes again with the command:

    floor = max(sigma, rms(r(t + T) - r(t)) / sqrt 2)       r residual, T the time after which the command repeats

so that a model may lack much and tell it all the same. Without a repetition the floor is the sensor's noise, sigma.
"""

from dataclasses import replace

import numpy as np

from workbench.data.held_out import Part, Split, residual_m
from workbench.data.noise_floor import repeat_lag
from workbench.fit.fit_result import Fit


def with_own_floor(parts: Split, base: Fit) -> Split:
    """Return the record with the floor of a stem that is driven by its measured pressure.

    Args:
        parts: of the record, fitted and held out.
        base: fitted from the measured pressure on; it may lack something.
    """
    train, test = (_with_repeatability(each, base) for each in (parts.train, parts.test))
    floors_m = [each.record.floor_m for each in (train, test) if each.record.floor_m is not None]
    return replace(parts, train=train, test=test, floor_m=max(floors_m, default=None))


def _with_repeatability(part: Part, base: Fit) -> Part:
    if part.record.repeatability_m is None:
        return part
    first, end = max(part.record.segments, key=lambda each: each[1] - each[0])
    lag = repeat_lag(part.record.command_pa[first:end])
    if lag is None:
        return part
    left_m = residual_m(part, base.indicated_m(part.record))[first:end]
    difference_m = left_m[lag:] - left_m[:-lag]
    finite = np.isfinite(difference_m)
    repeated_m = float(np.sqrt(np.mean(difference_m[finite] ** 2) / 2.0)) if finite.any() else None
    return replace(part, record=replace(part.record, repeatability_m=repeated_m))
