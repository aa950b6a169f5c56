"""Identification from a whole record at once: find its motions, fit them by maximum likelihood, check the result.

The daemon's refinement and `positioner estimate` are this one function. It refuses what is too uncertain, as `validity`
does for the integrals; `acceptance` decides what the law uses. What is not known is not guessed:

- how the pressure goes between the samples, when nobody says: held (the value at a sample is that of the interval
  before it), held ahead (of the interval after it) or linear; each is fitted and the likeliest taken;
- when a device samples that holds its pressure: before a command acts, or after (`[device] sampling`). The first sample
  of a stem that leaves its rest at a jump of the pressure tells. Both are fitted; what is said stands, unless the other
  is a thousand times likelier. Where they are not told apart, var += max(0, (θ - θ_other)^2 - var_other);
- whether stamps that jitter are when the samples were taken, or when they arrived of samples taken evenly: the stem
  moves by more than its sensor's noise within a tenth of a period of its jerk. Both are fitted, the likelier taken;
- a, b, c and k hang on μ = m/k_s, g and q do not. When the standard deviation of ln μ exceeds what is allowed, or more
  than three quarters of what is known of it hangs on a single sample, the mass is not identifiable: a, b, c, k are
  refused singly, b/c = -1/g and k/c = q/g stand on their own;
- a fit whose residuals are more than white noise of the sensor's size is no model of the motion: nothing is valid. An
  actuator that lags behind a command taken for its pressure shows here. So does sampling that leaves out how the stem
  moves: the noise, measured from sample to sample, then comes out as large as the moves, and no residual may pass half
  a per cent of them. Correlated residuals of whatever size widen every standard deviation by sqrt((1 + ρ) / (1 - ρ)),
  ρ the correlation of neighbours, when ρ is significant;
- where no jump of the pressure begins a motion, its first milliseconds are the drop from F_s to F_c, whose course the
  model leaves out. The mass must then be identifiable from what follows after five of the stem's time constants.

Neither a preload nor a sensor that drifts is part of the model, and yet a motion under one can be fitted to the noise,
with b/c off by half. So the motions are fitted again with each beside the model. Where that explains them as well, with
another b/c or, of a drift, k/c, beyond both standard deviations, nothing is valid. What a drift would change makes
every estimate less sure, beyond the deviation with which that is known:

    var += max(0, (θ - θ_drift)^2 - var_drift)

A device on its own clock lets a command act somewhere between two samples. With Δu the change of the pressure from one
to the next, Δu = α + β x where the motion has settled,

    var(b/c) += (β/2)^2,    var(k/c) += (α/2)^2

and when the jump acted that began a motion is known to half a sample, too. a, b, c and k hang on that: half of what
they differ by between the two conventions, which are a sample apart, is open.

Break-away: F_s/A lies between the largest force at which the stem rested and the force at which it left,
both u + (b/c) x in the direction of the motion. A held pressure jumps from one to the other; several events leave what
their intervals share (`breakaway_force`).
"""

from dataclasses import dataclass, replace
from functools import reduce
from math import inf, log, nan, sqrt
from operator import or_

import numpy as np

from config.codes import Refusal, Sampling
from config.results.result import Brief
from positioner.estimation.array import Array
from positioner.estimation.breakaway_force import from_interval, intersection, with_validity
from positioner.estimation.estimates import Directions, Estimate, Estimates, no_estimate, no_estimates
from positioner.estimation.likelihood import LikelihoodFit, fit_motions
from positioner.estimation.linear_problem import Prior
from positioner.estimation.motion_preparation import CLEAR, Beside
from positioner.estimation.motion_segment import MotionSegment
from positioner.estimation.record_consistency import contradicts
from positioner.estimation.segmentation import Segmentation, find_motions, whole_stretch
from signals.noise import position_noise_m

MOST_STRETCHES = 8
"""The farthest motions of a record are fitted together; more add little and cost much."""
SIGNIFICANT = 4.0
"""Correlation of the residuals in its own standard deviations, beyond which they are not white."""
MISFIT = 1.6
"""Ratio of the residuals to white noise beyond which the model does not fit."""
LARGEST_LEVERAGE = 0.75
"""Share of one sample in what is known of the mass, beyond which nothing would show that this sample is wrong."""
SETTLED = 5.0
"""Time constants after which nothing is left of how a motion began."""
FEWEST_LATER = 12
LEAST_JITTER, LARGEST_JITTER = 0.005, 0.4
"""Of time stamps about an even grid, shares of the period, between which they may be those of samples taken evenly."""
INSTANT = 0.5
"""Of the time from one sample to the next, known of when a command acts."""
TRAVELLED = 20.0
"""Standard deviations of the noise: a stem that was in places farther apart has moved, however slowly."""
DETECTED_WITHIN = 3
"""Samples after which a stem that left its rest has measurably done so."""
LARGEST_RESIDUAL = 5e-3
"""Share of the travel above which residuals that are not white are a misfit, whatever noise was measured."""
DECISIVE = log(1000.0)
"""Logarithm of how much likelier a fit must be than another."""
FINEST_M = 1e-12
"""Of residuals: what is smaller is rounding."""
APART = 3.0
"""Standard deviations beyond which two values of b/c are different ones."""
ENOUGH_FOR_WHITE = 60
"""Residuals whose neighbours tell whether they are white."""
UNSEEN = 1e-3
"""Of what the stem sweeps: where the noise is unknown, what differs by less is no motion."""
LEAST_MISFIT = 2e-4
"""Share of the travel below which residuals are no misfit worth the name."""


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """How a record is identified.

    Attributes:
        noise_std_m: of the position; None: measured.
        pressure_noise_std_pa: of the pressure.
        pressure_held: held or linear between the samples; None: the likelier.
        sampling: of a held pressure, as it is said to be; `UNKNOWN`: the pressures are those of the interval before.
        moving_threshold_m_per_s: velocity below which the stem counts as stopped.
        largest_relative_std: up to which an estimate is valid.
    """

    noise_std_m: float | None = None
    pressure_noise_std_pa: float = 0.0
    pressure_held: bool | None = None
    sampling: Sampling = Sampling.UNKNOWN
    moving_threshold_m_per_s: float = 1e-3
    largest_relative_std: float = 0.05


@dataclass(frozen=True, slots=True, repr=False)
class BatchResult(Brief):
    """Result of the identification from a record.

    Attributes:
        estimates: with standard deviations and reasons.
        fit: behind them; None when nothing could be fitted.
        pressure: how it was taken between the samples: "held", "held ahead" or "linear".
        sampling: of the device, where that could be told.
        evened: whether the time stamps were taken to jitter about samples taken evenly.
        noise_std_m: of the position, as given or measured; None: unknown.
        segments: how many motions were fitted.
        left_out: how many were found and not fitted.
        condition: of the information matrix of (ln τ, ln μ, ln g, ln q), scaled to a unit diagonal.
        contradicted: whether the rest of the record, or another fit to it, contradicts the fit.
        open_share: (6,), of θ, by which it hangs on how the pressure goes between samples and on a drift.
    """

    estimates: Estimates
    fit: LikelihoodFit | None
    pressure: str
    evened: bool
    noise_std_m: float | None
    segments: int
    left_out: int
    condition: float
    sampling: Sampling = Sampling.UNKNOWN
    contradicted: bool = False
    open_share: Array | None = None


def identify(
    time_s: Array, position_m: Array, pressure_pa: Array, settings: BatchSettings, prior: Prior | None = None
) -> BatchResult:
    """Identify the valve from a record, by the maximum likelihood of `likelihood`.

    Args:
        time_s: (N,), strictly increasing time stamps.
        position_m: (N,); NaN counts as missing.
        pressure_pa: (N,); NaN counts as missing.
        settings: how it is done.
        prior: what is known beforehand.

    Returns:
        The estimates and how they were found; where nothing could be fitted, without a fit and with the reason.
    """
    whole = np.isfinite(time_s) & np.isfinite(position_m) & np.isfinite(pressure_pa)
    t, x, u = time_s[whole], position_m[whole], pressure_pa[whole]
    noise_std_m = position_noise_m(x, u) if settings.noise_std_m is None else settings.noise_std_m
    hypotheses = [
        _fitted(t, x, interpolation, pressures, noise_std_m, settings, prior)
        for interpolation, pressures in _interpolations(u, settings)
    ]
    best = _likeliest(hypotheses, settings)
    even_s = even_instants(t) if best.fit is not None else None
    if even_s is not None and best.fit is not None:
        again = _fitted(
            even_s, x, best.interpolation, best.pressure_pa, noise_std_m, settings, prior, near=best.fit.p[:2]
        )
        best = min((best, replace(again, evened=True)), key=_residual_m)
    if best.fit is None:
        reason = _why_nothing(best, x, noise_std_m)
        nothing = no_estimates(reason)
        return BatchResult(nothing, None, best.interpolation, False, noise_std_m, 0, best.segmentation.too_short, nan)
    others = [each.fit for each in hypotheses if each.interpolation != best.interpolation]
    told_apart = all(_clearly_better(best.fit, each) for each in others)
    drifting = _fitted_beside(best, Beside.DRIFT, prior)
    as_likely = [each for each in others if settings.sampling and not _clearly_better(best.fit, each)]
    open_std = np.hypot(_open_std(best.fit, [*as_likely, drifting]), _open_by_instants(best, others, settings))
    stamps_s = even_s if best.evened and even_s is not None else t
    contradicted = _contradicted(best, stamps_s, x, noise_std_m, settings)
    together = _refusal_of_all(best, drifting, noise_std_m, settings)
    if contradicted and together is Refusal.VALID:
        together = Refusal.MODEL_DOES_NOT_FIT
    estimates = _estimates(best, settings, float(t[-1]), open_std, together)
    return BatchResult(
        estimates=replace(estimates, breakaway=_breakaway(best, estimates, settings.largest_relative_std)),
        fit=best.fit,
        pressure=best.interpolation,
        evened=best.evened,
        noise_std_m=noise_std_m,
        segments=len(best.chosen),
        left_out=best.segmentation.too_short + len(best.segmentation.segments) - len(best.chosen),
        condition=condition(best.fit),
        sampling=_SAMPLING[best.interpolation] if settings.sampling and told_apart else Sampling.UNKNOWN,
        contradicted=contradicted or together in _EXPLAINED_OTHERWISE,
        open_share=open_std / np.abs(best.fit.theta),
    )


_EXPLAINED_OTHERWISE = (Refusal.PRELOAD_EXPLAINS_AS_WELL, Refusal.DRIFT_EXPLAINS_AS_WELL)
_SAMPLING = {"held": Sampling.BEFORE, "held ahead": Sampling.AFTER, "linear": Sampling.UNKNOWN}


def _likeliest(hypotheses: "list[_Hypothesis]", settings: BatchSettings) -> "_Hypothesis":
    """Return the likeliest; where something is said of the sampling, that, unless another is clearly better."""
    best = min(hypotheses, key=_residual_m)
    said = next((each for each in hypotheses if _SAMPLING[each.interpolation] is settings.sampling), best)
    stands = settings.sampling and said.fit is not None and not _clearly_better(best.fit, said.fit)
    return said if stands else best


def _clearly_better(one: LikelihoodFit | None, other: LikelihoodFit | None) -> bool:
    """Return whether a fit is a thousand times likelier than another; residuals that hang together count as fewer."""
    if one is None or other is None:
        return one is not None
    count = one.count / _widening(one)
    return count * log(max(other.residual_std_m, FINEST_M) / max(one.residual_std_m, FINEST_M)) > DECISIVE


def _open_std(fit: LikelihoodFit, others: list[LikelihoodFit | None]) -> Array:
    """Return by how much θ is open, (6,), to first order: other fits have another, beyond their own deviation."""
    variance = np.zeros(6)
    for each in others:
        if each is not None:
            own = _widening(each) * np.diag(fit.gradient @ each.covariance @ fit.gradient.T)
            variance = np.maximum(variance, (fit.gradient @ (each.p - fit.p)) ** 2 - own)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _open_by_instants(best: "_Hypothesis", others: list[LikelihoodFit | None], settings: BatchSettings) -> Array:
    """Return by how much θ of a device's samples is open, (6,), whose commands act somewhere between two of them."""
    open_std = np.zeros(6)
    if settings.sampling and best.fit is not None:
        apart = [np.abs(each.theta[:4] - best.fit.theta[:4]) for each in others if each is not None]
        open_std[:4] = INSTANT * np.max([open_std[:4], *apart], axis=0)
    settled = [each for each in _settled(best) if len(each.time_s) > 2]
    if settings.sampling and settled:
        x = np.concatenate([each.position_m[1:] for each in settled])
        changes = np.concatenate([np.diff(each.pressure_pa) for each in settled])
        if float(np.ptp(x)) > 0.0:
            open_std[4:] = np.abs(np.polyfit(x, changes, 1)) * INSTANT
    return open_std


def _why_nothing(best: "_Hypothesis", position_m: Array, noise_std_m: float | None) -> Refusal:
    """Return why nothing was fitted: the stem moves for too short a time, too slowly to be seen sliding, or not."""
    if best.segmentation.moving_share > 0:
        return Refusal.WINDOW_TOO_SHORT
    travelled = position_m.size > 0 and float(np.ptp(position_m)) > TRAVELLED * (noise_std_m or 0.0)
    return Refusal.TOO_SLOW if travelled else Refusal.WAITING_FOR_MOTION


def even_instants(time_s: Array) -> Array | None:
    """Return the even instants about which time stamps jitter, (N,) both, s; None when they do not, or are not even.

    Samples that are missing leave their instants out.
    """
    if len(time_s) < FEWEST_LATER:
        return None
    steps = np.diff(time_s)
    number = np.append(0.0, np.cumsum(np.round(steps / np.median(steps))))
    if number[-1] < len(steps):
        return None
    period_s, start_s = np.polyfit(number, time_s, 1)
    even_s = start_s + period_s * number
    off = np.abs(time_s - even_s) / period_s
    jitters = off.std() > LEAST_JITTER and off.max() < LARGEST_JITTER and np.diff(number).min() > 0
    return np.asarray(even_s) if jitters else None


def _interpolations(pressure_pa: Array, settings: BatchSettings) -> list[tuple[str, Array]]:
    """Return the ways in which the pressure may go between the samples, each with the pressures that say so."""
    ahead = np.append(pressure_pa[:1], pressure_pa[:-1])
    if settings.pressure_held and settings.sampling:
        return [("held", pressure_pa), ("held ahead", ahead)]
    if settings.pressure_held is not None:
        return [("held" if settings.pressure_held else "linear", pressure_pa)]
    return [("held", pressure_pa), ("held ahead", ahead), ("linear", pressure_pa)]


@dataclass(frozen=True, slots=True)
class _Hypothesis:
    """A fit under one assumption on the pressure between the samples, and on the time stamps."""

    interpolation: str
    pressure_pa: Array
    segmentation: Segmentation
    chosen: tuple[MotionSegment, ...]
    fit: LikelihoodFit | None
    evened: bool = False


def _residual_m(each: _Hypothesis) -> float:
    return each.fit.residual_std_m if each.fit is not None else float("inf")


def _does_not_fit(each: _Hypothesis, noise_std_m: float | None, settings: BatchSettings) -> bool:
    """Return whether the residuals are more than the sensor's noise."""
    return each.fit is not None and each.fit.residual_std_m > _allowed_m(each, noise_std_m, settings)


def _allowed_m(each: _Hypothesis, noise_std_m: float | None, settings: BatchSettings) -> float:
    """Return how large residuals may be, m: as the sensor's noise, and unless they are white no more than any sensor's.

    Where the noise is unknown, as of a stem that never rests, white residuals are noise; of others only what no sensor
    would show passes.
    """
    white = each.fit is not None and _is_white(each.fit)
    if white and noise_std_m is None:
        return inf
    travel_m = max(float(np.ptp(segment.position_m)) for segment in each.chosen)
    allowed_m = max(MISFIT * (noise_std_m or 0.0), LEAST_MISFIT * travel_m)
    if settings.noise_std_m is None and not white:
        allowed_m = min(allowed_m, LARGEST_RESIDUAL * travel_m)
    return allowed_m


def _is_white(fit: LikelihoodFit) -> bool:
    """Return whether nothing of the model's is in the residuals, as far as neighbours tell."""
    return fit.count >= ENOUGH_FOR_WHITE and abs(fit.correlation) <= SIGNIFICANT


def _refusal_of_all(
    best: _Hypothesis,
    drifting: LikelihoodFit | None,
    noise_std_m: float | None,
    settings: BatchSettings,
) -> Refusal:
    """Return why nothing of a fit is valid: it is none, or something beside the model explains the motions as well."""
    if _explains_otherwise(best, drifting, (2, 3), noise_std_m, settings):
        return Refusal.DRIFT_EXPLAINS_AS_WELL
    if _does_not_fit(best, noise_std_m, settings):
        return Refusal.MODEL_DOES_NOT_FIT
    both_ways = len({each.direction for each in best.chosen}) > 1
    pushed = _fitted_beside(best, Beside.PRELOAD, None) if both_ways else None
    if _explains_otherwise(best, pushed, (2,), noise_std_m, settings):
        return Refusal.PRELOAD_EXPLAINS_AS_WELL
    return Refusal.VALID


def _fitted_beside(best: _Hypothesis, beside: Beside, prior: Prior | None) -> LikelihoodFit | None:
    """Return the fit of the same motions, from no start of theirs, with something beside the model."""
    return fit_motions(list(best.chosen), held=best.interpolation != "linear", prior=prior, beside=beside)


def _explains_otherwise(
    best: _Hypothesis,
    again: LikelihoodFit | None,
    numbers: tuple[int, ...],
    noise_std_m: float | None,
    settings: BatchSettings,
) -> bool:
    """Return whether another fit explains the motions as well, with one of these numbers of p another."""
    fit = best.fit
    if fit is None or again is None:
        return False
    if again.residual_std_m > _allowed_m(best, noise_std_m, settings):
        return False
    std = np.sqrt(np.diag(fit.covariance) + _widening(again) * np.diag(again.covariance))
    beyond = np.abs(again.p - fit.p) > np.maximum(APART * std, settings.largest_relative_std * np.abs(fit.p))
    return bool(beyond[list(numbers)].any())


def _contradicted(
    best: _Hypothesis,
    t: Array,
    x: Array,
    noise_std_m: float | None,
    settings: BatchSettings,
) -> bool:
    """Return whether the rest of the record contradicts the fit: a sensor that jumped."""
    fit = best.fit
    if fit is None:
        return False
    held, allowed_m = best.interpolation != "linear", _allowed_m(best, noise_std_m, settings)
    residual_m = max(fit.residual_std_m, allowed_m if allowed_m < inf else 0.0)
    scale_m = UNSEEN * float(np.ptp(x)) if noise_std_m is None else noise_std_m
    for each in best.segmentation.stretches:
        begin_s, end_s = t[each.begin], t[each.end - 1]
        inside = [part for part in best.chosen if begin_s <= part.time_s[-1] and part.time_s[0] <= end_s]
        if not inside:
            continue
        direction = max(inside, key=lambda part: float(np.ptp(part.position_m))).direction
        threshold = settings.moving_threshold_m_per_s
        whole = whole_stretch(each, direction, t, x, best.pressure_pa, scale_m, threshold)
        if whole is not None and contradicts(whole, fit, residual_m, held=held):
            return True
    return False


def _fitted(
    t: Array,
    x: Array,
    interpolation: str,
    u: Array,
    noise_std_m: float | None,
    settings: BatchSettings,
    prior: Prior | None,
    near: Array | None = None,
) -> _Hypothesis:
    scale_m = UNSEEN * float(np.ptp(x)) if noise_std_m is None and x.size else noise_std_m or 0.0
    found = find_motions(t, x, u, scale_m, settings.moving_threshold_m_per_s)
    chosen = _longest_motions(found.segments)
    fit = fit_motions(list(chosen), held=interpolation != "linear", prior=prior, near=near) if chosen else None
    return _Hypothesis(interpolation, u, found, chosen, fit)


def _longest_motions(segments: tuple[MotionSegment, ...]) -> tuple[MotionSegment, ...]:
    """Return the motions that go farthest, in order of time; both directions where there are both."""
    order = sorted(range(len(segments)), key=lambda each: -float(np.ptp(segments[each].position_m)))
    chosen = order[:MOST_STRETCHES]
    other = [each for each in order if segments[each].direction != segments[order[0]].direction] if order else []
    if other and not set(other) & set(chosen):
        chosen = [*chosen[:-1], other[0]]
    return tuple(segments[each] for each in sorted(chosen))


def condition(fit: LikelihoodFit) -> float:
    """Return the condition of the information about (ln τ, ln μ, ln g, ln q), its diagonal scaled to 1."""
    std = np.sqrt(np.diag(fit.covariance))
    if not np.isfinite(std).all() or not std.all():
        return float("inf")
    sizes = np.linalg.svd(fit.covariance / np.outer(std, std), compute_uv=False)
    return float(sizes[0] / sizes[-1]) if sizes[-1] > 0 else float("inf")


def _estimates(
    best: _Hypothesis, settings: BatchSettings, time_s: float, open_std: Array, together: Refusal
) -> Estimates:
    """Return the estimates of a fit, each valid or with the reason why not: that of all together, or its own."""
    assert best.fit is not None
    fit = _widened(best.fit, settings)
    values, std = fit.theta.tolist(), np.hypot(np.sqrt(np.abs(np.diag(fit.theta_covariance))), open_std).tolist()
    singly = _refusal_of_each(best, fit, settings.largest_relative_std)
    unphysical = (
        values[0] > 0 and Refusal.A_POSITIVE,
        values[1] >= 0 and Refusal.B_NOT_NEGATIVE,
        values[2] <= 0 and Refusal.C_NOT_POSITIVE,
        values[3] >= 0 and Refusal.K_NOT_NEGATIVE,
        values[4] >= 0 and Refusal.B_OVER_C_NOT_NEGATIVE,
        values[5] >= 0 and Refusal.K_OVER_C_NOT_NEGATIVE,
    )
    found = []
    for number in range(6):
        reason = singly if number < 4 and together is Refusal.VALID else together
        if reason is Refusal.VALID and not std[number] <= settings.largest_relative_std * abs(values[number]):
            reason = Refusal.TOO_UNCERTAIN
        if reason is Refusal.VALID and unphysical[number]:
            reason = Refusal(unphysical[number])
        found.append(Estimate(values[number], std[number], reason))
    a, b, c, k, b_over_c, k_over_c = found
    directions = reduce(or_, (Directions(each.direction) for each in best.chosen))
    return Estimates(a, b, c, k, b_over_c, k_over_c, progress=1.0, time_s=time_s, directions=directions)


def _widened(fit: LikelihoodFit, settings: BatchSettings) -> LikelihoodFit:
    """Return the fit with the covariance that correlated residuals and noise of the pressure leave."""
    factor = _widening(fit)
    drive_m = float(fit.p[2]) * settings.pressure_noise_std_pa
    factor *= 1 + (drive_m / max(fit.residual_std_m, 1e-12)) ** 2
    return replace(fit, covariance=fit.covariance * factor)


def _widening(fit: LikelihoodFit) -> float:
    """Return the factor on variances that correlated residuals leave."""
    if fit.correlation <= SIGNIFICANT:
        return 1.0
    share = min(fit.correlation / sqrt(fit.count), 0.98)
    return (1 + share) / (1 - share)


def _refusal_of_each(best: _Hypothesis, fit: LikelihoodFit, largest: float) -> Refusal:
    if fit.jumps == 0 and not _mass_identifiable_later(best, fit, largest):
        return Refusal.MASS_NOT_IDENTIFIABLE
    if fit.leverage > LARGEST_LEVERAGE or not float(fit.covariance[1, 1]) ** 0.5 <= largest:
        return Refusal.MASS_NOT_IDENTIFIABLE
    return Refusal.VALID


def _settled(best: _Hypothesis) -> list[MotionSegment]:
    """Return the motions without their first five time constants."""
    assert best.fit is not None
    settled_s = SETTLED * float(np.exp(max(best.fit.p[0], best.fit.p[1] / 2)))
    firsts = [int(np.searchsorted(each.time_s, each.time_s[each.begins] + settled_s)) for each in best.chosen]
    return [
        MotionSegment(
            each.direction,
            each.time_s[first:],
            each.position_m[first:],
            each.pressure_pa[first:],
            begins=0,
            earliest=0,
        )
        for each, first in zip(best.chosen, firsts, strict=True)
    ]


def _mass_identifiable_later(best: _Hypothesis, fit: LikelihoodFit, largest: float) -> bool:
    """Return whether ln μ is known well enough without the first five time constants of every motion."""
    later = [each for each in _settled(best) if len(each.time_s) >= FEWEST_LATER]
    again = fit_motions(later, held=best.interpolation != "linear", guess=fit.p[:2]) if later else None
    return again is not None and float(again.covariance[1, 1]) ** 0.5 <= largest


def _breakaway(best: _Hypothesis, estimates: Estimates, largest: float) -> Estimate:
    """Return F_s/A from the rests and what ended them."""
    if not estimates.b_over_c.valid:
        return no_estimate(estimates.b_over_c.reason)
    slope, slope_std = estimates.b_over_c.value, estimates.b_over_c.std
    bounds = []
    for segment in best.chosen:
        if segment.begins == 0:
            continue
        i = segment.begins
        rest_m = float(segment.position_m[:i].mean())
        force_pa = segment.direction * (segment.pressure_pa + slope * rest_m)
        steps = np.diff(force_pa[segment.earliest : i + 3])
        jump = segment.earliest + int(steps.argmax())
        others = np.delete(steps, steps.argmax())
        if len(others) and others.max() > CLEAR * steps.max():  # a ramp: the stem left within a few samples
            low, high = i - DETECTED_WITHIN, i + 1
        else:
            low, high = jump, jump + 1
        bounds.append((float(force_pa[: max(0, low) + 1].max()), float(force_pa[high]), slope_std * abs(rest_m)))
    least_pa = -estimates.k_over_c.value if estimates.k_over_c.valid else 0.0
    events = [(max(low, least_pa), high, std) for low, high, std in bounds if high > max(low, least_pa)]
    if not events:
        return no_estimate(Refusal.NO_BREAKAWAY)
    together = reduce(intersection, (from_interval(low, high, std) for low, high, std in events))
    return with_validity(together, largest)
