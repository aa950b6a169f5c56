"""One likelihood for a valve that sticks: where the stem is, told when it moves, and what it takes to break it loose.

    p(record | valve) = p(where the stem is | when it moves, valve) p(when it moves | valve)

First factor. A simulation is told the moves (`workbench.model.told_run`). With e_i = simulated - measured position, m:

    r_i = e_i / sigma                               samples in motion
    r_l = mean(e) / sqrt(sigma^2 / n + tau^2)       a rest of n samples: where the slide landed
    r_b = (mean_b(e) - mean(e)) sqrt(n_b) / sigma   blocks b of n_b samples of it: what still creeps there

sigma the noise, tau = `landing_noises` sigma. Where the sensor of the model rounds to q, a reading L says that x was
within L - q/2 and L + q/2: e is L - measured there, and grows by the distance over tau / sigma outside (`off_by`).
Second factor. F_s lies between L_bears, what a rest bore, and L_breaks, what broke it loose:

    r_k = max(L_bears - F_s, F_s - L_breaks, 0) / L_0    L_0 = `break_away_noises` k_s sigma, k_s as on the data sheet

The cost is the soft L1 of all, s^2 (sqrt(1 + (r / s)^2) - 1) summed, s = `soft_noises`. It is smooth in every
parameter: nothing in it asks whether a slip happened.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim.composition import COULOMB, STATIC, Composition
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.fit.fit_thresholds import FIT
from workbench.model.search_coordinates import Parameter
from workbench.model.simulation_regime import Sampling
from workbench.model.told_run import RECORDS, ToldMove, ToldPath, ToldRun

Rows = npt.NDArray[np.int64]


class Groups(NamedTuple):
    """The residuals by what they tell."""

    motion: Vector
    landings: Vector
    rests: Vector
    """Blocks."""
    break_aways: Vector

    @property
    def whole(self) -> Vector:
        """All of them, one after another."""
        return np.concatenate(self)


@dataclass(frozen=True, slots=True)
class Layout:
    """Which samples of a record each residual is made of."""

    moving: Rows
    resting: Rows
    """Samples at rest, in order."""
    starts: Rows
    """Where among these each block begins."""
    count: Rows
    """Samples of each block."""
    rest_of: Rows
    """The rest that each block belongs to."""
    per_rest: Rows
    """Samples of each rest."""
    rest_after: Rows
    """The rest that each move ends in, (moves,); -1: none that is judged."""
    in_motion: tuple[tuple[int, int], ...]
    """Which of the residuals in motion belong to each move, first to end (half open)."""
    broken: Rows
    """Moves that break loose from a rest."""
    move_of: Rows
    """The move whose onset each residual hangs on, (rows,); the number of moves: none."""


@lru_cache(maxsize=RECORDS)
def layout(record: Record, told: tuple[ToldMove, ...]) -> Layout:
    """Return the layout of a record, the same for every model: what is not in a move is at rest."""
    state = np.full(len(record), -2, dtype=np.int64)  # -2 not judged, -1 moving, k in the k-th rest
    rests, after = 0, np.zeros(len(told), dtype=np.int64)
    for number, (first, end) in enumerate(record.segments):
        state[first:end] = rests
        rests += 1
        for k, move in enumerate(told):
            if move.segment == number:
                landed = last_in_motion(move) + 1
                state[first_in_motion(move) : landed] = -1
                state[landed:end] = after[k] = rests
                rests += 1
    state[~record.valid] = -2
    resting = np.flatnonzero(state >= 0)
    names, of = np.unique(state[resting], return_inverse=True)
    first_of = np.searchsorted(of, np.arange(names.size))
    within = np.arange(resting.size) - first_of[of]
    starts = np.flatnonzero(within % FIT.weights.block_samples == 0)
    count = np.diff(np.append(starts, resting.size))
    at = {int(name): i for i, name in enumerate(names)}
    moving, rest_of = np.flatnonzero(state == -1), of[starts]
    rest_after = np.array([at.get(int(each), -1) for each in after], dtype=np.int64)
    in_motion = tuple(
        (int(np.searchsorted(moving, first_in_motion(each))), int(np.searchsorted(moving, last_in_motion(each) + 1)))
        for each in told
    )
    gone = FIT.weights.gone_noises * record.scale_m
    broken = np.array([k for k, each in enumerate(told) if each.breaks_loose(record, gone)], dtype=np.int64)
    of_moving = np.full(moving.size, len(told), dtype=np.int64)
    for k, (first, end) in enumerate(in_motion):
        of_moving[first:end] = k
    of_rests = np.full(names.size, len(told), dtype=np.int64)
    of_rests[rest_after[rest_after >= 0]] = np.flatnonzero(rest_after >= 0)
    return Layout(
        moving=moving,
        resting=resting,
        starts=starts,
        count=count,
        rest_of=rest_of,
        per_rest=np.bincount(of, minlength=names.size),
        rest_after=rest_after,
        in_motion=in_motion,
        broken=broken,
        move_of=np.concatenate([of_moving, of_rests, of_rests[rest_of], broken]),
    )


def first_in_motion(move: ToldMove) -> int:
    """Return the first row of a move that counts by itself."""
    return max(move.before + 1 - FIT.onsets.reach_periods, move.rested_from + 1)


def last_in_motion(move: ToldMove) -> int:
    """Return the last row of a move that counts by itself."""
    return min(move.after + FIT.onsets.reach_periods, move.until) - 1


class Likelihood:
    """The residuals of a composition told through a record; its parameters by their coordinates z, onsets in s.

    Raises:
        InputError: as `workbench.model.free_run.FreeRun`.
    """

    def __init__(
        self,
        composition: Composition,
        record: Record,
        told: Sequence[ToldMove],
        parameters: Sequence[Parameter],
        *,
        by: Sampling,
        from_pressure: bool = False,
        load_n: float,
        eased: bool = False,
    ) -> None:
        self.composition, self.record, self.parameters = composition, record, tuple(parameters)
        self.by, self.from_pressure, self.load_n = by, from_pressure, load_n
        self.run = ToldRun(composition, record, tuple(told), by=by, from_pressure=from_pressure)
        self.moves = self.run.moves
        self.layout = layout(record, self.moves)
        self.broken, self.move_of = self.layout.broken, self.layout.move_of
        self.bounds = np.array([each.bounds for each in parameters]).reshape(-1, 2).T
        """Least and most of each coordinate, (2, parameters)."""
        self.sigma_m = record.scale_m
        self.landing_m = self.sigma_m * np.sqrt(1.0 / self.layout.per_rest + FIT.weights.landing_noises**2)
        self.is_eased = eased
        self._last: tuple[bytes, Groups] | None = None
        self._quantum = next((i for i, each in enumerate(_guesses(composition)) if each == "quantum"), None)

    @cached_property
    def eased(self) -> "Likelihood":
        """The same where static friction has no part in a move (`sim.told`): for a search that begins far off."""
        eased = copy(self)
        eased.is_eased, eased._last = True, None
        return eased

    @property
    def count(self) -> int:
        """Residuals."""
        return self.move_of.size

    def theta(self, z: Vector) -> Vector:
        """Return the parameter vector of coordinates, (parameters,)."""
        theta = self.composition.theta.copy()
        for each, value in zip(self.parameters, z, strict=True):
            each.put(theta, float(value))
        return theta

    def coordinates(self, theta: Vector) -> Vector:
        """Return the coordinates of a parameter vector."""
        return np.array([each.coordinate(theta) for each in self.parameters])

    def at(self, theta: Vector, onsets_s: Vector) -> Groups:
        """Simulate; return the residuals. Those asked for last are kept: a minimiser asks again for derivatives."""
        asked, last = theta.tobytes() + onsets_s.tobytes(), self._last
        if last is None or last[0] != asked:  # another thread may ask meanwhile
            self._last = last = asked, self.of_path(self.path(theta, onsets_s), theta)
        return last[1]

    def path(self, theta: Vector, onsets_s: Vector) -> ToldPath:
        """Simulate, the sensor's rounding left out."""
        rounds = np.arange(theta.size) == (-1 if self._quantum is None else self._quantum)
        return self.run.run(np.where(rounds, 0.0, theta), onsets_s, eased=self.is_eased)

    def off_m(self, path: ToldPath, theta: Vector) -> Vector:
        """Return what a path is off by, m, (n,)."""
        quantum_m = 0.0 if self._quantum is None else float(theta[self._quantum])
        return off_by(path.indicated_m, self.record.position_m, quantum_m)

    def of_path(self, path: ToldPath, theta: Vector) -> Groups:
        """Return the residuals of a path."""
        rows, most = self.layout, FIT.weights.wild_noises
        e = self.off_m(path, theta) / self.sigma_m
        e = np.maximum(np.fmin(e, most), -most)  # of no number and another fmin takes the other
        sums = np.add.reduceat(e[rows.resting], rows.starts) if rows.starts.size else np.empty(0)
        mean = np.bincount(rows.rest_of, sums) / rows.per_rest
        blocks = (sums / rows.count - mean[rows.rest_of]) * np.sqrt(rows.count)
        (broken,) = self.rows_of_static(path, theta[STATIC : STATIC + 1])
        return Groups(e[rows.moving], mean * self.sigma_m / self.landing_m, blocks, broken)

    def wide_landings(self, groups: Groups) -> Vector:
        """Return the residuals of landings, wide, and of break-aways: what leads a search that begins far off."""
        landed = groups.landings * self.landing_m / (FIT.descent.wide_landings * self.sigma_m)
        return np.concatenate([landed, groups.break_aways])

    def rows_of_static(self, path: ToldPath, static_n: Vector, wider: Vector | float = 1.0) -> Vector:
        """Return the residuals of the second factor with each of some static frictions, N, (frictions, rows).

        Wider: factor on L_0 of what broke each move loose, (rows,).
        """
        F_s, bears, breaks = static_n[:, np.newaxis], path.bears_n[self.broken], path.breaks_n[self.broken]
        breaks = np.where(breaks > 0.0, breaks, np.inf)  # it slides on where the record rests: nothing breaks loose
        off = np.maximum(bears - F_s, (F_s - breaks) / wider) / self.load_n
        return np.asarray(np.maximum(np.fmin(off, FIT.weights.wild_noises), 0.0))


def off_by(simulated_m: Vector, measured_m: Vector, quantum_m: float) -> Vector:
    """Return e, m, (n,), of what is simulated, before its sensor rounds it: a reading L says x in [L - q/2, L + q/2].

    Outside, e grows with the distance over tau / sigma, to what the rounded position is off by at the most.
    """
    if not quantum_m > 0.0:
        return simulated_m - measured_m
    level_m, rounded_m = (quantum_m * np.floor(each / quantum_m + 0.5) for each in (measured_m, simulated_m))
    beyond_m = simulated_m - np.clip(simulated_m, level_m - 0.5 * quantum_m, level_m + 0.5 * quantum_m)
    most_m = np.abs(rounded_m - level_m)
    return level_m - measured_m + np.clip(beyond_m / FIT.weights.landing_noises, -most_m, most_m)


def _guesses(composition: Composition) -> list[str]:
    """Return what a record suggests for each parameter, in the order of theta; the bare valve's: nothing."""
    declared = [each.guess for effect in composition.effects for each in effect.parameters.values()]
    return [""] * (composition.theta.size - len(declared)) + declared


def with_static(like: Likelihood, theta: Vector, path: ToldPath) -> Vector:
    """Return a parameter vector with the static friction that its path's break-aways like best, (parameters,)."""
    ends_n = np.concatenate([path.bears_n[like.broken], path.breaks_n[like.broken]])
    tried_n = np.append(theta[STATIC], np.unique(ends_n[np.isfinite(ends_n) & (ends_n > theta[COULOMB])]))
    costs = soft(like.rows_of_static(path, tried_n)).sum(axis=1)
    there = theta.copy()
    there[STATIC] = tried_n[int(np.argmin(costs))]
    return there


def soft(r: Vector) -> Vector:
    """Return the soft-L1 cost of each residual."""
    scale = FIT.weights.soft_noises
    return np.asarray(scale**2 * (np.sqrt(1.0 + (r / scale) ** 2) - 1.0))


def cost_of(r: Vector) -> float:
    """Return the soft-L1 cost of residuals together."""
    return float(soft(r).sum())


def soft_weight(r: Vector) -> Vector:
    """Return W of each residual: W r is the slope of its soft-L1 cost."""
    return np.asarray(1.0 / np.sqrt(1.0 + (r / FIT.weights.soft_noises) ** 2))


def coupling(of: Rows, by_z: Vector, by_onset: Vector, weight: Vector, moves: int) -> tuple[Vector, Vector]:
    """Return C, (parameters, moves), and D, (moves,): curvature by a coordinate and an onset, and by an onset alone.

    Args:
        of: as `Layout.move_of`, (rows,).
        by_z: derivatives of the residuals, (rows, parameters).
        by_onset: the same by the onset of the move that each belongs to, (rows,).
        weight: of each residual's square, (rows,).
        moves: how many.
    """
    C = np.array([by_move(of, weight * by_onset * column, moves) for column in by_z.T])
    return C.reshape(by_z.shape[1], moves), by_move(of, weight * by_onset**2, moves)


def by_move(of: Rows, values: Vector, moves: int) -> Vector:
    """Return sums over the rows that belong to each move, (moves,); `of` as `Layout.move_of`."""
    return np.asarray(np.bincount(of, values, moves + 1)[:-1], dtype=np.float64)
