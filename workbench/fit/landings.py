"""Landings: the balance of forces where a slide ends in rest. It needs no simulation.

    A p - k_s x + F(x, p, t) = s F_c(x, p, s, t)      s last direction of motion, x where the stem rests, p actuator
                                                      pressure when it came to rest, the farthest in that
                                                      direction since its last motion, F extra forces
    lower <= F_s(x, p, s, t) <= upper                 break-away: |A p - k_s x + F| at the last sample at rest and the
                                                      first in motion; a rest that goes on gives a lower bound only

One equation a landing, in which neither mass nor viscous friction, lag nor sampling stands. The pressure path does not
know the stem, so that p comes from a simulation of that path alone. A landing under a moving pressure counts for less:

    sigma_j^2 = (k_s sigma / sqrt n_j)^2 + (A dp_j)^2 + F_0^2     sigma sensor noise, n_j samples of the rest, dp_j half
                                                                  the range of p between last motion and first rest,
                                                                  F_0 what is left of the slide's own speed

The landings are solved for the parameters that stand in them by Gauss and Newton, robustly (soft L1) and held loosely
to where they begin, so that what the landings do not tell apart stays. Static friction lies where the break-aways
contradict it least. Viscous friction and all that belongs to motion stays as it is.

An indicated position is taken back through the sensor's effects, which see a slide from the rest before.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from sim.composition import AREA, COULOMB, SPRING, STATIC, STRIBECK, VISCOUS
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.fit.objective import SimulationError
from workbench.model.parameters import MOST_STATIC

WINDOW = 8
"""Samples over which a stem at rest is told from a slow one; the shortest rest."""
FLAT = 3.0
"""Standard deviations by which the halves of a window may differ in their means."""
SPREAD, AWAY, MOVED = 6.0, 4.0, 5.0
"""Noises: range of a window at rest; beyond which a sample is no part of a rest; beyond which the stem has moved."""
DRIFT = 4.0
"""Standard deviations by which a rest may seem to drift."""
MOSTLY = 0.9
"""Of its samples must a rest have near its median."""
SLOW = 3.0
"""Stribeck velocities at which a slide ends: below, friction rises and holds the stem."""
FORCE_N = 0.5
ROUNDS = 6
DIFFERENCE = 1e-4
HELD = 0.5
"""Weight of the start, in landings' standard deviations for a log-parameter."""
SETTLING = 3
"""Samples from the first that looks like rest within which the last creep ends."""
PARTS = (1.0, 0.3, 0.1)
"""Of a move that are tried until one lowers what is left."""
OUTLIER = 3.0
"""Standard deviations, or median deviations, from which the loss is linear."""
CONTRADICTED_N = 20.0
"""Distance of static friction from a break-away's interval at which the contradiction counts half."""
FEWEST = 4
NOT_IN_LANDINGS = (VISCOUS, STATIC)
RECORDS = 4
"""Whose rests are kept: every effect that is fitted to a record asks for them."""


class Rest(NamedTuple):
    """A stretch of samples, first to end (half open), in which the stem rests."""

    first: int
    end: int
    position_m: float
    """Mean of the stretch."""
    std_m: float
    """Of that mean."""
    moved: int
    """Last sample before at which it was elsewhere; the first of the segment if it never was."""
    from_m: float
    """Where the slide that ended here came from."""
    direction: int
    """Of that slide; 0 if there was none."""
    leaves: int
    """First sample after at which it is elsewhere; the segment's end if it never is."""
    leaves_to: int
    """Direction in which it leaves, 0 if it does not."""


SHOWN, DIRECTION = 2, 6
"""Columns of a landing as `sim.karnopp.balance` takes it: position, m; direction of (impending) motion."""


@dataclass(frozen=True, slots=True)
class Loaded:
    """Rests, each at one of its samples, under a pressure and about to move, or come, in a direction."""

    rows: NDArray[np.int64]
    """Of those samples in the record, (places,)."""
    leaves_to: Vector
    """Direction in which each rest is left, 0 if it is not, (places,)."""
    landings: Vector
    """As `sim.karnopp.balance` takes them, (places, 7)."""

    @property
    def directions(self) -> Vector:
        """Of (impending) motion, (places,)."""
        return np.asarray(self.landings[:, DIRECTION])

    def those(self, which: NDArray[np.bool_]) -> "Loaded":
        """Return some of them."""
        return Loaded(self.rows[which], self.leaves_to[which], np.ascontiguousarray(self.landings[which]))

    def shifted(self, by_m: Vector) -> "Loaded":
        """Return them as if each stem had come to rest so much farther open, m, (places,)."""
        landings = self.landings.copy()
        landings[:, SHOWN] += by_m
        return replace(self, landings=landings)


@lru_cache(maxsize=RECORDS)
def rests(record: Record) -> tuple[Rest, ...]:
    """Return the rests of a record, in order; of the last few records they are kept."""
    return tuple(
        rest
        for first, end in record.segments
        for rest in _rests(np.where(record.valid, record.position_m, np.nan)[first:end], record.scale_m, first)
    )


def _rests(position_m: Column, noise_m: float, offset: int) -> list[Rest]:
    """Return the rests of one segment, (samples,) in m, whose first row in the record is `offset`."""
    found: list[Rest] = []
    for first, end in _still(position_m, noise_m):
        middle_m = float(np.median(position_m[first:end]))
        off_m = np.abs(position_m - middle_m)
        near = first + np.flatnonzero(off_m[first:end] < AWAY * noise_m)
        if near.size < max(WINDOW, MOSTLY * (end - first)) or _drifts(position_m[near], noise_m):
            continue
        begin, over = int(near[0]), int(near[-1]) + 1
        before, after = (np.flatnonzero(each > MOVED * noise_m) for each in (off_m[:begin], off_m[over:]))
        moved = int(before[-1]) if before.size else 0
        leaves = over + int(after[0]) if after.size else position_m.size
        if found and found[-1].first > offset + moved:
            # Noise has cut one rest in two.
            begin = found.pop().first - offset
        mean_m = float(np.nanmean(position_m[begin:over]))
        found.append(
            Rest(
                first=offset + begin,
                end=offset + over,
                position_m=mean_m,
                std_m=noise_m / (over - begin) ** 0.5,
                moved=offset + moved,
                from_m=found[-1].position_m if found else mean_m,
                direction=int(np.sign(middle_m - position_m[moved])) if before.size else 0,
                leaves=offset + leaves,
                leaves_to=int(np.sign(position_m[leaves] - middle_m)) if after.size else 0,
            )
        )
    return found


def _drifts(position_m: Column, noise_m: float) -> bool:
    """Whether a straight line through the samples rises by more than noise makes it rise."""
    steps = np.linspace(-0.5, 0.5, position_m.size)
    rise_m = steps @ position_m / (steps @ steps)
    return bool(abs(rise_m) > DRIFT * noise_m * (12.0 / position_m.size) ** 0.5)


def _still(position_m: Column, noise_m: float) -> list[tuple[int, int]]:
    """Return the stretches, half open, all of whose windows are flat; neighbours may overlap at a jump."""
    half = WINDOW // 2
    if position_m.size < 2 * WINDOW:
        return []
    means = np.convolve(position_m, np.full(half, 1.0 / half), mode="valid")
    windows = np.lib.stride_tricks.sliding_window_view(position_m, WINDOW)
    flat = np.abs(means[half:] - means[:-half]) < FLAT * noise_m * (2.0 / half) ** 0.5
    flat &= np.ptp(windows, axis=1) < SPREAD * noise_m
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flat, [False]])))
    return [(first, last + WINDOW - 1) for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]


@dataclass(frozen=True, slots=True)
class Solved:
    """A parameter vector that balances the landings, and the median of what is left, in their standard deviations."""

    theta: Vector
    left: float


class Landings:
    """The landings of a record and the balance of forces at them, for one composition."""

    def __init__(self, error: SimulationError, chosen: Sequence[Rest]) -> None:
        self._error = error
        self._record = error.run.record
        self._rests = chosen
        self._landed = tuple(each for each in self._rests if each.direction)
        self.behind_path = any("pressure" in each.functions for each in error.composition.effects)

    @property
    def count(self) -> int:
        """How many landings there are."""
        return len(self._landed)

    def solved(self, theta: Vector, kept: Collection[int] = ()) -> Solved | None:
        """Solve the landings for the free parameters that stand in them, from theta on; None if there are too few.

        What follows in time what enters it has come to its end where the stem rests: its parameters stay.

        Args:
            theta: parameter vector.
            kept: indices of theta that stay besides those of motion.
        """
        if self.count < FEWEST:
            return None
        pressure_pa = self._error.run.run(theta).pressure_pa
        moving = {each.name for each in self._error.composition.effects if each.in_time}
        free = [
            i
            for i, each in enumerate(self._error.parameters)
            if each.index not in (*NOT_IN_LANDINGS, *kept) and each.name.partition(".")[0] not in moving
        ]
        z, left = self._gauss_newton(self._error.coordinates(theta), pressure_pa, free)
        found = self._error.theta(z)
        if any(each.index == STATIC for each in self._error.parameters):
            found[STATIC] = self._static_n(found, pressure_pa)
        return Solved(found, float(np.median(np.abs(left))))

    def _gauss_newton(self, z: Vector, pressure_pa: Column, free: Sequence[int]) -> tuple[Vector, Vector]:
        """Return the coordinates of the solution, and what is left of the balance, in standard deviations.

        The moves are made in the parameters themselves, of which most stand linearly in the balance.
        """
        error = self._error
        landed, scale_n = self.landed(error.theta(z), pressure_pa)
        left = self.balance_n(error.theta(z), landed) / scale_n
        indices = [error.parameters[i].index for i in free]
        begin = error.theta(z)[indices]
        held = HELD / np.abs(self._steps(z, free)) * DIFFERENCE
        for _ in range(ROUNDS if free else 0):
            theta, steps = error.theta(z), self._steps(z, free)
            columns = []
            for index, step in zip(indices, steps.tolist(), strict=True):
                there = theta.copy()
                there[index] += step
                columns.append((self.balance_n(there, landed) / scale_n - left) / step)
            outlier = OUTLIER * max(1.0, float(np.median(np.abs(left))))
            weights = (1.0 + (left / outlier) ** 2) ** -0.25
            matrix = np.vstack([weights[:, None] * np.array(columns).T, np.diag(held)])
            move = np.linalg.lstsq(matrix, np.concatenate([-weights * left, held * (begin - theta[indices])]))[0]
            for part in PARTS:
                there = theta.copy()
                there[indices] += part * move
                reached = error.coordinates(there)
                after = self.balance_n(error.theta(reached), landed) / scale_n
                if np.abs(after).sum() < np.abs(left).sum():
                    break
            else:
                break
            z, left = reached, after
        return z, left

    def landed(self, theta: Vector, pressure_pa: Column) -> tuple[Loaded, Vector]:
        """Return each landing, under the pressure in which it came to rest, and sigma_j, N, (landings,)."""
        # From the last motion to when the rest has settled; a pressure that jumps at a sample has jumped before a slide
        # that was over by the next one.
        by = self._error.run.by
        later = 1 if by.slow and by.held and not self.behind_path else 0
        ranges = [_range(pressure_pa[each.moved + later : each.first + SETTLING]) for each in self._landed]
        landed = self._loaded(
            (each, each.first, pressures[each.direction > 0], each.direction)
            for each, pressures in zip(self._landed, ranges, strict=True)
        )
        return landed, self._scale_n(theta, np.array(ranges).reshape(-1, 2))

    def _steps(self, z: Vector, free: Sequence[int]) -> Vector:
        """Return by how much each free parameter changes with its coordinate's step."""
        theta, steps = self._error.theta(z), []
        for i in free:
            there = z.copy()
            there[i] += DIFFERENCE if z[i] + DIFFERENCE <= self._error.upper[i] else -DIFFERENCE
            index = self._error.parameters[i].index
            steps.append(self._error.theta(there)[index] - theta[index])
        return np.array(steps)

    def balance_n(self, theta: Vector, landed: Loaded) -> Vector:
        """Return A p - k_s x + F - s F_c of the landings, N."""
        slow = SLOW * float(theta[STRIBECK])
        forces = self._forces_n(theta, landed, slow)
        return np.asarray(forces[:, 0] - landed.directions * (forces[:, 1] + theta[VISCOUS] * slow))

    def _scale_n(self, theta: Vector, ranges_pa: Vector) -> Vector:
        """Return sigma_j, N, from the lowest and highest pressures of the landings, (landings, 2)."""
        std_m = np.array([each.std_m for each in self._landed])
        moving_n = 0.5 * theta[AREA] * (ranges_pa[:, 1] - ranges_pa[:, 0])
        return np.asarray(np.sqrt((theta[SPRING] * std_m) ** 2 + moving_n**2 + FORCE_N**2))

    def _static_n(self, theta: Vector, pressure_pa: Column) -> float:
        """Return the static friction that the break-aways contradict least: the middle of the best stretch."""
        lower = self.static_at_n(theta, self.holding(pressure_pa))
        upper = self.static_at_n(theta, self.breaking(pressure_pa))
        least, most = float(theta[COULOMB]), MOST_STATIC * float(theta[COULOMB])
        edges = np.unique(np.concatenate([lower, upper, [least, most]]))
        edges = edges[(edges >= least) & (edges <= most)]
        middles = 0.5 * (edges[1:] + edges[:-1])
        if not middles.size:
            return least
        below = np.maximum(lower - middles[:, None], 0.0) / CONTRADICTED_N
        above = np.maximum(middles[:, None] - upper, 0.0) / CONTRADICTED_N
        contradicted = (below / (1.0 + below)).sum(axis=1) + (above / (1.0 + above)).sum(axis=1)
        return float(middles[np.argmin(contradicted)])

    def holding(self, pressure_pa: Column) -> Loaded:
        """Return each rest under the highest and the lowest pressure that it bore."""
        return self._loaded(
            (each, each.end - 1, pressure, way)
            for each in self._rests
            for way, pressure in zip((-1, 1), _range(pressure_pa[each.first : each.end]), strict=True)
        )

    def breaking(self, pressure_pa: Column) -> Loaded:
        """Return each rest that was left, under the pressure that it did not bear."""
        return self._loaded(
            (each, each.leaves, _range(pressure_pa[each.end - 1 : each.leaves + 1])[way > 0], way)
            for each in self._rests
            if (way := each.leaves_to)
        )

    def _loaded(self, at: Iterable[tuple[Rest, int, float, int]]) -> Loaded:
        """Return rests, each at a row of the record, under a pressure, Pa, in a direction."""
        time_s, at = self._record.time_s, list(at)
        landings = [
            (time_s[rest.first], time_s[row], rest.position_m, rest.from_m, pressure_pa, rest.direction or 1, way)
            for rest, row, pressure_pa, way in at
        ]
        rows = np.array([row for _, row, _, _ in at], np.int64)
        leaves_to = np.array([rest.leaves_to for rest, _, _, _ in at], np.float64)
        return Loaded(rows, leaves_to, np.array(landings, np.float64).reshape(-1, 7))

    def static_at_n(self, theta: Vector, at: Loaded) -> Vector:
        """Return the static friction of the bare valve with which each would be on the verge of breaking away, N."""
        more = theta.copy()
        more[STATIC] *= 1.01
        beyond_n = self.beyond_static_n(theta, at)
        slope = (beyond_n - self.beyond_static_n(more, at)) / (more[STATIC] - theta[STATIC])
        return np.asarray(theta[STATIC] + beyond_n / np.where(slope > 0.0, slope, 1.0))

    def beyond_static_n(self, theta: Vector, at: Loaded) -> Vector:
        """Return by how much each load is more than the static friction there, N."""
        forces = self._forces_n(theta, at)
        return np.asarray(at.directions * forces[:, 0] - forces[:, 2])

    def _forces_n(self, theta: Vector, at: Loaded, speed: float = 0.0) -> Vector:
        """Return (places, 3): A p - k_s x + F, F_c, F_s, N, of a stem at rest or at a speed, m/s, in its direction."""
        return self._error.composition.balance_n(theta, at.landings, SLOW * float(theta[STRIBECK]), speed)


def _range(pressure_pa: Column) -> tuple[float, float]:
    return float(pressure_pa.min()), float(pressure_pa.max())
