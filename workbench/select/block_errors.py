"""How far a fit is off, on what was fitted and on what was held out, second by second.

    l_b = log rms of the error in block b      blocks of 1 s, and of ten samples at least: within one the errors hang
                                               together
    d_b = l_b(base) - l_b(candidate)           held within +-log 2
    reduction = 1 - exp(-mean d_b),            its standard error from the spread of d_b over the blocks
    rho = corr(r_i, r_i+1),  (1 - rho) / (1 + rho) of the samples are independent

Static friction is only known to an interval, so that on held-out data a slip is narrowly mistimed now and then, and the
blocks up to the next slip have an error a hundred times the noise, whatever the model. Therefore no block counts for
more than a factor of 2 where two models are compared. Whether one explains all is another question: there the plain
rms of what was held out must be at the floor too, or what it is told when the stem moves (`told_errors`).
"""

from dataclasses import dataclass, replace

import numpy as np

from config.drive import Scale
from config.errors import InputError
from config.recording import Column
from config.results.result import Brief
from workbench.data.held_out import HELD_OUT_RECORDING, Part, Split, residual_m
from workbench.fit.fit_result import Fit
from workbench.model.sampling import NO_LANDING
from workbench.select.residual_structure import clipped, structure
from workbench.select.rest_errors import RestErrors, rest_errors
from workbench.select.told_errors import told_error_m

BLOCK_S, BLOCK_SAMPLES = 1.0, 10
AT_FLOOR, RARELY_OFF = 1.6, 1.75
"""A model reaches the floor if its block error, and its plain error fitted and held out, are within these of it.

1.6: friction that is smooth where the model's is not (LuGre's) leaves 1.5 times the noise.
"""
NOISE_KNOWN_TO = 1.2
"""A factor: what leaves no more than so many floors leaves nothing that can be told from them."""
NOTHING_LEFT = 1.1
"""The same, where no other effect need be sought: one that adds half the floor to it, in squares, leaves 1.12."""
MOST_LEFT = 0.1
"""Of the position's standard deviation: a model that leaves more explains little, however badly the valve repeats."""
MOST_LOG_RATIO = float(np.log(2.0))
"""What one block counts at most."""
LEAST_STANDARD_ERROR = 0.01
"""Of a mean logarithm: no better known, however equal the blocks."""
NEGLIGIBLE = 0.1
"""Of the floor: what an error below it is does not matter."""
SAME_STANDARD_ERRORS, SAME_REDUCTION = 2.0, 0.02
"""Within one of these two models are indistinguishable."""


@dataclass(frozen=True, slots=True)
class Told:
    """What a model leaves of what was held out, told when the stem moves (`told_errors`): rms, and a typical second."""

    rmse_m: float
    block_m: float


@dataclass(frozen=True, slots=True, repr=False)
class BlockErrors(Brief):
    """How far a fit is off, m."""

    train_rmse_m: float
    test_rmse_m: float
    train_block_m: float
    """Geometric mean of the fitted blocks' errors."""
    test_block_m: float
    """Median of the held-out blocks' errors."""
    logs: Column
    """l_b of the held-out blocks, (blocks,)."""
    all_logs: Column
    """l_b of the fitted and the held-out blocks, (blocks,)."""
    structure: float
    """How much of the residual that is judged hangs on the state, fitted or held out, whichever is more."""
    independent_share: float
    """Share of the fitted samples that are independent."""
    rests: RestErrors | None = None
    """How far rests are off, where all else is at the floor and yet something may be left, or `with_rests`."""
    told: "Told | None" = None
    """What was held out leaves told when the stem moves, where a free run leaves more: a slip that it mistimes."""
    mistimed_m: float = 0.0
    """What the noise of a measured pressure adds to the rms besides a typical second (`pressure_scatter`)."""

    @property
    def _held_out_rmse_m(self) -> float:
        return self.told.rmse_m if self.told else self.test_rmse_m

    @property
    def _held_out_block_m(self) -> float:
        return self.told.block_m if self.told else self.test_block_m

    def fitted_at_floor(self, floor_m: float) -> bool:
        """Whether no model could do better on what was fitted."""
        near = self.train_rmse_m <= RARELY_OFF * self.rms_floor_m(floor_m)
        return near and self.train_block_m <= AT_FLOOR * floor_m

    def at_floor(self, floor_m: float | None) -> bool:
        """Whether no model could do better: in the mean of what was fitted, and in most blocks of what was not.

        Nor may what was fitted or held out be missed by far in a few places: what acts rarely is there for the whole
        time. Where the floor is unknown, nobody can say so.
        """
        if floor_m is None:
            return False
        mostly = max(self.train_block_m, self._held_out_block_m) <= AT_FLOOR * floor_m
        return mostly and self.rms_floors(floor_m) <= RARELY_OFF

    def rms_floors(self, floor_m: float) -> float:
        """Return the rms, fitted or held out, whichever is more, over what it is at the floor."""
        return max(self.train_rmse_m, self._held_out_rmse_m) / self.rms_floor_m(floor_m)

    def rms_floor_m(self, floor_m: float) -> float:
        """Return what the rms is at the floor, m: behind a measured pressure its noise mistimes a few slips."""
        return float(np.hypot(floor_m, self.mistimed_m))

    def floors_left(self, floor_m: float) -> float:
        """Return what is left, in floors: a typical second's error or the rms, fitted or held out, the most of them."""
        return max(max(self.train_block_m, self._held_out_block_m) / floor_m, self.rms_floors(floor_m))

    def leaves_nothing(self, floor_m: float | None) -> bool:
        """Whether what is left of a record that is explained is the floor, so that another effect has no room in it."""
        if floor_m is None or self.train_rmse_m > NOTHING_LEFT * self.rms_floor_m(floor_m):
            return False
        return max(self.train_block_m, self._held_out_block_m) <= NOTHING_LEFT * floor_m

    def follows(self, motion_std_m: float) -> bool:
        """Whether a typical second's error is small against the motion, given by its standard deviation, m."""
        return max(self.train_block_m, self._held_out_block_m) <= MOST_LEFT * motion_std_m


def block_errors(fit: Fit, split: Split) -> BlockErrors:
    """Return how far a fit is off on what it was fitted to and on what was held out.

    Raises:
        InputError: nothing that was held out is judged: no slide is seen to land in it.
    """
    negligible_m = NEGLIGIBLE * split.scale_m
    train, test = split.train, split.test
    fitted_m = residual_m(train, fit.indicated_m(train.record))
    held_out_m = residual_m(test, fit.indicated_m(test.record))
    rows = np.isfinite(held_out_m)
    if not rows.any():
        raise InputError(HELD_OUT_RECORDING, NO_LANDING)
    fitted_logs = block_logs(train.record.time_s, fitted_m, negligible_m, block_s(train))
    logs = block_logs(test.record.time_s, held_out_m, negligible_m, block_s(test))
    test_rmse_m = float(np.sqrt(np.mean(held_out_m[rows] ** 2)))
    fitted_structure = structure(train.record, fitted_m, negligible_m)
    found = BlockErrors(
        train_rmse_m=fit.rms_m,
        test_rmse_m=test_rmse_m,
        train_block_m=float(np.exp(np.mean(fitted_logs))),
        test_block_m=float(np.exp(np.median(logs))),
        logs=logs,
        all_logs=np.concatenate([fitted_logs, logs]),
        structure=max(fitted_structure, structure(test.record, held_out_m, negligible_m)),
        independent_share=independent_share(fitted_m),
        mistimed_m=split.by_pressure.mistimed_m if split.by_pressure and fit.from_pressure else 0.0,
    )
    floor_m = split.floor_m
    if floor_m is None or not found.fitted_at_floor(floor_m):
        return found
    if found.at_floor(floor_m) and found.floors_left(floor_m) > NOTHING_LEFT:
        found = replace(found, rests=rest_errors(split, fitted_m, held_out_m))
    if test_rmse_m <= NOISE_KNOWN_TO * found.rms_floor_m(floor_m):
        return found
    told_m = told_error_m(fit, split)
    if told_m is None or _rms(told_m) >= test_rmse_m:
        return found
    told_logs = block_logs(test.record.time_s, told_m, negligible_m, block_s(test))
    left = max(fitted_structure, structure(test.record, told_m, negligible_m))
    told = Told(_rms(told_m), float(np.exp(np.median(told_logs))))
    logs = np.concatenate([fitted_logs, told_logs])
    return replace(found, told=told, logs=told_logs, all_logs=logs, structure=left)


def with_rests(errors: BlockErrors, fit: Fit, split: Split) -> BlockErrors:
    """Return the errors of a fit with how far rests are off, where something is left: slow, for all that is tried."""
    if errors.rests or split.floor_m is None or errors.floors_left(split.floor_m) <= NOTHING_LEFT:
        return errors
    fitted_m, held_out_m = (residual_m(each, fit.indicated_m(each.record)) for each in (split.train, split.test))
    return replace(errors, rests=rest_errors(split, fitted_m, held_out_m))


def block_s(part: Part) -> float:
    """Return the length of a block of a part, s."""
    return max(BLOCK_S, BLOCK_SAMPLES * part.record.period_s)


def block_logs(time_s: Column, error_m: Column, negligible_m: float, block_s: float = BLOCK_S) -> Column:
    """Return l_b, the log rms of the error in each block that has samples which count, (blocks,).

    Args:
        time_s: time, s, (samples,).
        error_m: simulated less measured position, m, (samples,); NaN where a sample does not count.
        negligible_m: added in quadrature, m, so that what is far below it makes no difference.
        block_s: length of a block, s.
    """
    rows = np.flatnonzero(np.isfinite(error_m))
    _, block = np.unique(np.floor((time_s[rows] - time_s[0]) / block_s), return_inverse=True)
    squares = np.bincount(block, error_m[rows] ** 2) / np.bincount(block)
    return np.asarray(0.5 * np.log(squares + negligible_m**2 + np.finfo(float).tiny))


def relative_error_reduction(before: Column, after: Column) -> tuple[float, float]:
    """Return by what part the block error falls, and that in its standard errors; l_b of the same blocks, (blocks,)."""
    d = np.clip(before - after, -MOST_LOG_RATIO, MOST_LOG_RATIO)
    mean = float(np.mean(d))
    error = float(np.std(d)) / d.size**0.5
    return 1.0 - float(np.exp(-mean)), mean / max(error, LEAST_STANDARD_ERROR)


def indistinguishable(best: Column, other: Column) -> bool:
    """Whether the block errors l_b, (blocks,), do not tell two apart: within 2 standard errors or 2 %."""
    reduction, standard_errors = relative_error_reduction(other, best)
    return reduction < SAME_REDUCTION or standard_errors < SAME_STANDARD_ERRORS


def independent_share(error_m: Column) -> float:
    """Return the share of independent samples, at most 1; the error, m, (n,), is clipped at 5 robust deviations."""
    e = clipped(error_m)
    pairs = np.isfinite(e[1:]) & np.isfinite(e[:-1])
    power = float(np.nanmean(e**2)) if pairs.any() else 0.0
    rho = float(np.mean(e[1:][pairs] * e[:-1][pairs])) / power if power > 0.0 else 0.0
    rho = min(max(rho, 0.0), 1.0)
    return (1.0 - rho) / (1.0 + rho)


def told_sentence(errors: BlockErrors, length: Scale) -> str:
    """Say what is left told when the stem moves, with a leading space; empty where the free run is judged."""
    if errors.told is None:
        return ""
    return (
        f" Static friction is known to an interval, in which a free run mistimes a held-out slip; told when the stem "
        f"moves, the valve leaves {length.said(errors.told.rmse_m)} rms."
    )


def _rms(error_m: Column) -> float:
    return float(np.sqrt(np.nanmean(error_m**2)))
