"""Whether one fit is better than another: robust BIC on what was fitted, block errors on what was held out.

    BIC = n log(2 C / n) + k log n             C soft-L1 cost, k free parameters; the gain is base less candidate
    rho = corr(r_i, r_i+1),  (1 - rho) / (1 + rho) of the samples are independent
    l_b = log rms of the error in block b      blocks of 1 s: within one the errors hang together
    d_b = l_b(base) - l_b(candidate)           held within +-log 2
    gain = 1 - exp(-mean d_b),                 its standard error from the spread of d_b over the blocks

Static friction is only known to an interval, so that on held-out data a slip is missed by a hair now and then, and the
blocks up to the next slip have an error a hundred times the noise, whatever the model. Therefore no block counts for
more than a factor of 2. A falling held-out error is needed for an effect; it proves none.
"""

from dataclasses import dataclass

import numpy as np

from config.recording import Column
from workbench.data.held_out import Split, residual_m
from workbench.fit.fitting import Fit
from workbench.select.structure import clipped, structure

BLOCK_S = 1.0
LEAST_BIC = 10.0
LEAST_GAIN = 0.05
LEAST_STANDARD_ERRORS, WHERE_EXPLAINED = 2.0, 3.0
"""More where nothing is left to explain: of twenty candidates one falls by two deviations by pure chance."""
ALIKE_STANDARD_ERRORS = 2.0
ALIKE_GAIN = 0.02
AT_FLOOR, RARELY_OFF = 1.25, 1.75
"""A model reaches the floor if its block error, and its plain error where it was fitted, are within these of it."""
MOST_LEFT = 0.1
"""Of the position's standard deviation: a model that leaves more explains little, however badly the valve repeats."""
MOST = float(np.log(2.0))
LEAST_ERROR = 0.01
"""Of a mean logarithm: no better known, however alike the blocks."""
NEGLIGIBLE = 0.1
"""Of the floor: what an error below it is does not matter."""


@dataclass(frozen=True, slots=True)
class Errors:
    """How far a fit is off, m."""

    train_rmse_m: float
    test_rmse_m: float
    train_block_m: float
    """Geometric mean of the fitted blocks' errors."""
    test_block_m: float
    """Median of the held-out blocks' errors."""
    logs: Column
    """l_b of the held-out blocks."""
    all_logs: Column
    """l_b of the fitted and the held-out blocks."""
    structure: float
    """How much of the residual hangs on the state, fitted or held out, whichever is more (`structure`)."""
    independent: float
    """Share of the fitted samples that are independent."""

    def at_floor(self, floor_m: float) -> bool:
        """Whether no model could do better: in the mean of what was fitted, and in most blocks of what was not.

        Nor may what was fitted be missed by far in a few places: what acts rarely is there for the whole time.
        """
        mostly = max(self.train_block_m, self.test_block_m) <= AT_FLOOR * floor_m
        return mostly and self.train_rmse_m <= RARELY_OFF * floor_m

    def follows(self, moved_m: float) -> bool:
        """Whether a typical second's error is small against the motion, given by its standard deviation."""
        return max(self.train_block_m, self.test_block_m) <= MOST_LEFT * moved_m


@dataclass(frozen=True, slots=True)
class Gain:
    """How much a candidate is better than its base."""

    bic: float
    held_out: float
    """Relative fall of the held-out block error."""
    standard_errors: float
    """The same in its own standard errors."""
    independent: float
    """Share of the samples that are independent: the evidence is worth so much of `bic`."""

    def short(self, explained: bool) -> str:
        """Say what is missing to accept the candidate; empty if nothing is.

        Args:
            explained: whether the model before leaves nothing to explain.
        """
        least = WHERE_EXPLAINED if explained else LEAST_STANDARD_ERRORS
        if self.bic <= LEAST_BIC:
            return f"evidence {self.bic:.3g} on the fitted part, more than {LEAST_BIC:g} needed"
        if explained and self.independent * self.bic <= LEAST_BIC:
            return (
                f"evidence {self.bic:.3g} on the fitted part, of whose samples {100 * self.independent:.2g} % are "
                f"independent: {self.independent * self.bic:.2g}, more than {LEAST_BIC:g} needed"
            )
        if self.held_out <= LEAST_GAIN:
            return f"the held-out error falls by {100 * self.held_out:.2g} %, more than {100 * LEAST_GAIN:g} % needed"
        if self.standard_errors <= least:
            return f"the held-out error falls by {self.standard_errors:.2g} standard errors, more than {least:g} needed"
        return ""


def errors(fit: Fit, split: Split) -> Errors:
    """Judge a fit on what it was fitted to and on what was held out."""
    negligible_m = NEGLIGIBLE * split.floor_m
    train, judged = split.train, split.judged
    fitted_m = residual_m(train, fit.predict(train.recording))
    held_out_m = residual_m(judged, fit.predict(judged.recording))
    rows = np.isfinite(held_out_m)
    fitted_logs = block_logs(train.record.time_s, fitted_m, negligible_m)
    logs = block_logs(judged.record.time_s, held_out_m, negligible_m)
    return Errors(
        train_rmse_m=fit.rms_m,
        test_rmse_m=float(np.sqrt(np.mean(held_out_m[rows] ** 2))),
        train_block_m=float(np.exp(np.mean(fitted_logs))),
        test_block_m=float(np.exp(np.median(logs))),
        logs=logs,
        all_logs=np.concatenate([fitted_logs, logs]),
        structure=max(structure(train.record, fitted_m), structure(judged.record, held_out_m)),
        independent=independent(fitted_m),
    )


def block_logs(time_s: Column, error_m: Column, negligible_m: float) -> Column:
    """Return log rms of the error in each block of 1 s that has samples which count."""
    rows = np.flatnonzero(np.isfinite(error_m))
    _, block = np.unique(np.floor((time_s[rows] - time_s[0]) / BLOCK_S), return_inverse=True)
    squares = np.bincount(block, error_m[rows] ** 2) / np.bincount(block)
    return np.asarray(0.5 * np.log(squares + negligible_m**2 + np.finfo(float).tiny))


def independent(error_m: Column) -> float:
    """Return the share of samples that are independent, at most 1; the error clipped at 5 robust deviations."""
    e = clipped(error_m)
    pairs = np.isfinite(e[1:]) & np.isfinite(e[:-1])
    power = float(np.nanmean(e**2)) if pairs.any() else 0.0
    rho = float(np.mean(e[1:][pairs] * e[:-1][pairs])) / power if power > 0.0 else 0.0
    rho = min(max(rho, 0.0), 1.0)
    return (1.0 - rho) / (1.0 + rho)


def gain(base: Fit, candidate: Fit, base_errors: Errors, candidate_errors: Errors) -> Gain:
    """Compare a candidate with its base."""
    held_out, standard_errors = fall(base_errors.logs, candidate_errors.logs)
    return Gain(bic(base) - bic(candidate), held_out, standard_errors, candidate_errors.independent)


def bic(fit: Fit) -> float:
    """Return the robust Bayesian information criterion: less is better."""
    n = fit.count
    return float(n * np.log(2.0 * max(fit.cost, np.finfo(float).tiny) / n) + len(fit.parameters) * np.log(n))


def lead(one: Fit, other: Fit) -> float:
    """Return how much better one fits than another, as BIC counts it but for the parameters: n log(C_other / C_one)."""
    least = np.finfo(float).tiny
    return float(one.count * np.log(max(other.cost, least) / max(one.cost, least)))


def fall(before: Column, after: Column) -> tuple[float, float]:
    """Return the relative fall of the block error, and that in its standard errors."""
    d = np.clip(before - after, -MOST, MOST)
    mean = float(np.mean(d))
    error = float(np.std(d)) / d.size**0.5
    return 1.0 - float(np.exp(-mean)), mean / max(error, LEAST_ERROR)


def alike(best: Column, other: Column) -> bool:
    """Whether the block errors l_b do not tell two apart: within 2 standard errors or 2 %."""
    less, standard_errors = fall(other, best)
    return less < ALIKE_GAIN or standard_errors < ALIKE_STANDARD_ERRORS


def fallen(before: Errors, after: Errors) -> str:
    """Say how the held-out error falls; where one slip missed by a hair outweighs all else, in a typical second."""
    whole = f"from {1e3 * before.test_rmse_m:.3g} to {1e3 * after.test_rmse_m:.3g} mm"
    if after.test_rmse_m < before.test_rmse_m:
        return f"the held-out error falls {whole}"
    typical = f"from {1e3 * before.test_block_m:.3g} to {1e3 * after.test_block_m:.3g} mm"
    return (
        f"the held-out error of a typical second falls {typical}, though a slip missed by a hair moves the rms {whole}"
    )
