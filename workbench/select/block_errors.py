"""How far a model is off, on what was fitted and on what was held out, event by event, told when the stem moves.

    l_k = 1/2 log(1 + mean of m_k, r_k^2, b_k)   an event: a move and the rest that it ends in. m_k mean square of its
                                                 samples in motion, r_k its landing, b_k mean square of the blocks of
                                                 its rest, in deviations (`workbench.fit.likelihood`)
    l_k = 1/2 log(1 + z_k^2)                     a break-away, z_k its residual
    d_k = l_k(base) - l_k(candidate)             held within +-log 2
    reduction = 1 - exp(-mean d_k),              its standard error from the spread of d_k

Of what is held out a valve that fits at the noise stays within what its fit leaves open: the least of the cost and of
the squares of how far its coordinates go, in deviations. Whether a model is wrong, and what a record leaves open of its
parameters, are two questions. One that does not fit is wrong, so that its deviations say nothing: it stays as it was
fitted. Errors in metres are of the same runs.
"""

from dataclasses import dataclass
from itertools import compress
from typing import NamedTuple

import numpy as np

from config.errors import InputError
from config.recording import Column
from config.results.result import Brief
from sim.composition import STATIC, Composition
from sim.karnopp import Vector
from workbench.compare.measures import BLOCK_S
from workbench.data.held_out import HELD_OUT_RECORDING, Part, Split, residual_m
from workbench.fit.fit_result import Counted, Fit, Terms, terms
from workbench.fit.fit_thresholds import FIT
from workbench.fit.fitting import at_the_noise, problem_of
from workbench.fit.likelihood import Groups, Likelihood, cost_of
from workbench.fit.minimiser import descend
from workbench.fit.onsets import with_onsets
from workbench.model.simulation_regime import NO_LANDING
from workbench.select.residual_structure import structure
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True, repr=False)
class BlockErrors(Brief):
    """How far a model is off."""

    train_rmse_m: float
    test_rmse_m: float
    train_block_m: float
    """Median of the fitted events' errors."""
    test_block_m: float
    """Median of the held-out events' errors."""
    logs: Column
    """l_k of the held-out events, (events,)."""
    structure: float
    """How much of the residual hangs on the state, fitted or held out, whichever is more."""
    held_out: Terms
    """The likelihood of what is held out."""

    def at_floor(self, floor_m: float | None) -> bool:
        """Whether no model could do better: in a typical event, and by the plain error, fitted and held out.

        Where the floor is unknown, nobody can say so.
        """
        if floor_m is None:
            return False
        return self._typical_m <= SELECTION.at_floor * floor_m and self.rms_floors(floor_m) <= SELECTION.rarely_off

    def rms_floors(self, floor_m: float) -> float:
        """Return the rms, fitted or held out, whichever is more, in floors."""
        return max(self.train_rmse_m, self.test_rmse_m) / floor_m

    def floors_left(self, floor_m: float) -> float:
        """Return what is left, in floors: a typical event's error or the rms, fitted or held out, the most of them."""
        return max(self._typical_m / floor_m, self.rms_floors(floor_m))

    def leaves_nothing(self, floor_m: float | None) -> bool:
        """Whether what is left of a record that is explained is the floor, so that another effect has no room in it."""
        return floor_m is not None and self.floors_left(floor_m) <= SELECTION.nothing_left

    def follows(self, motion_std_m: float) -> bool:
        """Whether a typical event's error is small against the motion, given by its standard deviation, m."""
        return self._typical_m <= SELECTION.most_left * motion_std_m

    @property
    def _typical_m(self) -> float:
        return max(self.train_block_m, self.test_block_m)


def errors_json(errors: BlockErrors) -> dict[str, float]:
    """Return what JSON says of errors, m."""
    return {
        "train_rmse_m": errors.train_rmse_m,
        "test_rmse_m": errors.test_rmse_m,
        "test_typical_rmse_m": errors.test_block_m,
    }


def block_errors(fit: Fit, split: Split) -> BlockErrors:
    """Return how far a fit is off on what it was fitted to, and on what was held out.

    Raises:
        InputError: nothing that was held out is judged: no slide is seen to land in it.
    """
    fitted, held_out = _on_fitted(fit, split.train), _on_held_out(fit, split.test)
    if not np.isfinite(held_out.error_m).any():
        raise InputError(HELD_OUT_RECORDING, NO_LANDING)
    negligible_m = SELECTION.negligible_error * split.scale_m
    return BlockErrors(
        train_rmse_m=_rms(fitted.error_m),
        test_rmse_m=_rms(held_out.error_m),
        train_block_m=float(np.median(fitted.event_errors_m)),
        test_block_m=float(np.median(held_out.event_errors_m)),
        logs=held_out.logs,
        structure=max(structure(each.part.record, each.error_m, negligible_m) for each in (fitted, held_out)),
        held_out=terms(held_out.of_counted, held_out.moved),
    )


class _Told(NamedTuple):
    """A fit told through a part."""

    part: Part
    like: Likelihood
    groups: Groups
    error_m: Column
    """(n,)."""
    moved: Vector
    """How far its parameters had to go, in deviations, (parameters,)."""

    @property
    def counted(self) -> list[bool]:
        """Whether each move counts: of a recording whose end is held out those of the end."""
        return [bool(self.part.counted[each.after]) for each in self.like.moves]

    @property
    def event_errors_m(self) -> Column:
        """The rms error of each event that counts, m; of a part without any, of all of it."""
        rows = [self.error_m[each.before : each.until + 1] for each in compress(self.like.moves, self.counted)]
        return np.array([_rms(each) for each in rows if np.isfinite(each).any()] or [_rms(self.error_m)])

    @property
    def logs(self) -> Column:
        """l_k of the events and of the break-aways that count."""
        like, groups, counted, found = self.like, self.groups, self.counted, []
        blocks = np.bincount(like.layout.rest_of, groups.rests**2, like.layout.per_rest.size)
        per_rest = np.maximum(np.bincount(like.layout.rest_of, minlength=like.layout.per_rest.size), 1)
        for k, (first, end) in enumerate(like.layout.in_motion):
            if not counted[k]:
                continue
            squares = [float(np.mean(groups.motion[first:end] ** 2))] if end > first else []
            rest = like.layout.rest_after[k]
            if rest >= 0:
                squares += [float(groups.landings[rest] ** 2), float(blocks[rest] / per_rest[rest])]
            found.append(0.5 * np.log1p(np.mean(squares)) if squares else 0.0)
        broken = [0.5 * np.log1p(z**2) for k, z in zip(like.broken, groups.break_aways, strict=True) if counted[k]]
        return np.array([*found, *broken])

    @property
    def of_counted(self) -> Counted:
        """The residuals of the moves that count, and of the rests they end in."""
        like, groups, counted = self.like, self.groups, self.counted
        if all(counted):
            return Counted(groups, like.layout.rest_of, len(counted))
        moves = [k for k, counts in enumerate(counted) if counts]
        rests = [like.layout.rest_after[k] for k in moves if like.layout.rest_after[k] >= 0]
        rows, blocks = like.layout.in_motion, np.isin(like.layout.rest_of, rests)
        found = Groups(
            np.concatenate([np.empty(0), *(groups.motion[slice(*rows[k])] for k in moves)]),
            groups.landings[rests],
            groups.rests[blocks],
            groups.break_aways[np.isin(like.broken, moves)],
        )
        return Counted(found, like.layout.rest_of[blocks], len(moves))


def _on_fitted(fit: Fit, part: Part) -> _Told:
    """Return a fit told through what it was fitted to."""
    like, theta = _likelihood(fit, part)
    onsets_s = fit.onsets_s if fit.onsets_s.size == len(like.moves) else with_onsets(like, theta)[0]
    return _at(like, part, theta, onsets_s, np.empty(0))


def _on_held_out(fit: Fit, part: Part) -> _Told:
    """Return a fit told through what was held out, its parameters as what was fitted leaves them open."""
    like, theta = _likelihood(fit, part)
    onsets_s, groups = with_onsets(like, theta)
    z, root = like.coordinates(theta), fit.known.root
    fits = at_the_noise(fit.cost, fit.count)
    if not (fits and z.size) or at_the_noise(cost_of(groups.whole), like.count):
        return _at(like, part, theta, onsets_s, np.zeros(z.size))
    if others := _open(fit, like, z):
        begin = min([z, *others], key=lambda at: _cost(like, at, root @ (at - z)))
        onsets_s, _ = with_onsets(like, like.theta(begin))
    else:
        begin = z
    end = descend(like, begin, onsets_s, held=(z, root))
    moved = root @ (end.z - z)
    if np.abs(moved).max() > SELECTION.most_moved:
        return _at(like, part, theta, onsets_s, np.zeros(z.size))
    return _at(like, part, like.theta(end.z), end.onsets_s, moved)


def _open(fit: Fit, like: Likelihood, z: Column) -> list[Column]:
    """Return other coordinates, along each that a fit leaves open; along static friction, of which it knows a range."""
    deviation, found = fit.known.deviations, []
    for i, each in enumerate(like.parameters):
        farthest = min(SELECTION.same_standard_errors * deviation[i], FIT.intervals.farthest_deviation)
        if each.index == STATIC:
            ahead = farthest * np.arange(1, SELECTION.places_tried + 1) / SELECTION.places_tried
        elif deviation[i] > SELECTION.left_open:
            ahead = np.geomspace(SELECTION.left_open, farthest, SELECTION.places_tried)
        else:
            continue
        for by in (*-ahead[::-1], *ahead):
            there = z.copy()
            there[i] = np.clip(z[i] + by, *each.bounds)
            found.append(there)
    return found


def _cost(like: Likelihood, z: Column, moved: Column) -> float:
    """Return the cost at coordinates, and of how far these are from a fit's, in deviations."""
    _, groups = with_onsets(like, like.theta(z), FIT.onsets.coarse_rounds)
    return cost_of(np.concatenate([groups.whole, moved]))


def _likelihood(fit: Fit, part: Part) -> tuple[Likelihood, Vector]:
    composition = Composition.from_file(fit.valve)
    return problem_of(fit, part.record).likelihood_of(composition, fit.known.parameters), composition.theta


def _at(like: Likelihood, part: Part, theta: Vector, onsets_s: Vector, moved: Vector) -> _Told:
    path = like.path(theta, onsets_s)
    off_m = like.off_m(path, theta)
    return _Told(part, like, like.of_path(path, theta), residual_m(part, part.record.position_m + off_m), moved)


def event_logs(fit: Fit, part: Part) -> Column:
    """Return l_k of a fit's events and break-aways in a part, (events,)."""
    return _on_held_out(fit, part).logs


def event_errors_m(fit: Fit, part: Part) -> Column:
    """Return the rms error of each event of a part that counts, m; of a part without any, of all of it."""
    return _on_held_out(fit, part).event_errors_m


def _rms(error_m: Column) -> float:
    return float(np.sqrt(np.nanmean(error_m**2)))


def block_logs(time_s: Column, error: Column, negligible: float, period_s: float = 0.0) -> Column:
    """Return the log rms of an error in each block of time that has samples which count, (blocks,).

    Args:
        time_s: time, s, (samples,).
        error: in any unit, (samples,); NaN where a sample does not count.
        negligible: added in quadrature, so that what is far below it makes no difference.
        period_s: of the samples, s: where they are rare, blocks are longer.
    """
    block_s = max(BLOCK_S, SELECTION.fewest_block_samples * period_s)
    rows = np.flatnonzero(np.isfinite(error))
    _, block = np.unique(np.floor((time_s[rows] - time_s[0]) / block_s), return_inverse=True)
    squares = np.bincount(block, error[rows] ** 2) / np.bincount(block)
    return np.asarray(0.5 * np.log(squares + negligible**2 + np.finfo(float).tiny))


def relative_error_reduction(before: Column, after: Column) -> tuple[float, float]:
    """Return by what part the error of events falls, and that in its standard errors; l_k of the same, (events,)."""
    d = np.clip(before - after, -SELECTION.most_log_ratio, SELECTION.most_log_ratio)
    mean = float(np.mean(d))
    error = float(np.std(d)) / d.size**0.5
    return 1.0 - float(np.exp(-mean)), mean / max(error, SELECTION.least_standard_error)


def indistinguishable(best: Column, other: Column) -> bool:
    """Whether the errors of events l_k, (events,), do not tell two apart: within 2 standard errors or 2 %."""
    reduction, standard_errors = relative_error_reduction(other, best)
    return reduction < SELECTION.same_reduction or standard_errors < SELECTION.same_standard_errors
