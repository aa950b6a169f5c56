"""What slips say of a rival: the forces under which they began and ended, whatever came between.

    e_j = s (A p - k_s x + F) - F_c          at landing j, N; see `workbench.fit.landings`
    lower_k <= F_s,k - F_s <= upper_k        at break-away k, N: the last sample at rest, the first in motion

    l = sum_j log t(e_j - d_r; S_j) |de_j/dx|             S_j^2 = S_c^2 + sigma_j^2 + (s |de_j/dx|)^2
      + sum_k log (T(upper_k - g_r; S_s) - T(lower_k - g_r; S_s))
      - 2 sum_r (d_r / S_c)^2 + (g_r / S_s)^2

is the log likelihood of where slides landed and under which pressures they began, on a valve whose friction scatters:
by S_c and S_s, N, from slip to slip, and half as much, by d_r and g_r, from recording to recording r. t is Student's
density of 4 degrees of freedom, T its distribution function: a slip may be told wrongly. A rival is weighed by the most
that its parameters, scatters and offsets make of l. A slip mistimed by luck spoils seconds of a free run, and no force.

Parameters are held loosely to the fit, so that what slips do not tell stays. A rival whose own simulation does not land
where its static balance says needs a scatter s, m, so large that it does; rivals are compared at the most that any
needs. It is one of positions: were it one of forces, the stiffer rival would be the likelier, whatever landed where.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import lgamma, log, nan, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import stdtr

from sim.composition import STATIC, VISCOUS, Composition
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.fit.fit_result import Fit
from workbench.fit.landings import DIFFERENCE, FEWEST, Landings, rests
from workbench.fit.objective import SimulationError
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters

FREEDOM = 4.0
"""Degrees of freedom of t."""
BETWEEN = 0.5
"""Scatter from recording to recording, over that from slip to slip."""
LEAST_N, MOST_N = 1.0, 1e4
"""Scatter."""
GUESSED_N = 30.0
"""Scatter of static friction to begin with."""
HELD = 0.5
"""Of a coordinate, from the fit: a standard deviation."""
PADDING = 0.05
"""Of the scatter, by which the interval of a break-away is wider either way: noise may have broken it."""
SHIFT = 2e-3
"""Of the stroke, over which a landing's slope is taken: wider than a sensor's steps."""
TOLD, MOSTLY = 0.5, 0.75
"""So near, in scatters, must so many of its own landings lie where a rival's balance says."""
NORMAL = lgamma(0.5 * (FREEDOM + 1.0)) - lgamma(0.5 * FREEDOM) - 0.5 * log(FREEDOM * pi)
TINY = np.finfo(float).tiny


@dataclass(frozen=True, slots=True)
class Slips:
    """What slips say of a rival: their log likelihood, of how many landings and break-aways, and their scatters, N."""

    log_likelihood: float
    count: int
    coulomb_n: float = nan
    """S_c."""
    static_n: float = nan
    """S_s."""
    least_m: float = 0.0
    """s."""
    logs: Vector = field(default_factory=lambda: np.empty(0))
    """Of that, what each landing and each break-away says, (slips,); the distance from the fit is not among it."""


class Needed(NamedTuple):
    """Scatter within which most slides of a rival's own simulation land where its balance says."""

    force_n: float
    position_m: float


def slips(fit: Fit, record: Record, first_rows: Sequence[int], least_m: float = 0.0) -> Slips | None:
    """Return what slips say of a fitted valve; None where there are too few.

    Args:
        fit: the rival.
        record: of all recordings.
        first_rows: of each recording in the record.
        least_m: s of rivals that are to be compared: the most of what they need (`needed`).
    """
    forces = SlipForces(fit, record, first_rows, least_m)
    if forces.landings.count < FEWEST:
        return None
    begin = forces.first()
    bounds = [*[(None, None)] * (begin.size - 2), *[(log(LEAST_N), log(MOST_N))] * 2]
    found = minimize(forces.loss_and_slope, begin, jac=True, method="L-BFGS-B", bounds=bounds)
    coulomb_n, static_n = np.exp(found.x[-2:]).tolist()
    return Slips(-float(found.fun), forces.count, coulomb_n, static_n, least_m, forces.logs(found.x))


def needed(fit: Fit, record: Record, first_rows: Sequence[int]) -> Needed:
    """Return the scatter that a rival's landings need, as a force and as a distance.

    A stem that creeps, or whose friction rises as it slows down, ends elsewhere: so much its landings do not tell.
    """
    composition = Composition.from_file(fit.valve)
    simulated_m = FreeRun(composition, record).position_m(composition.theta)
    # What leads to where a recording is judged from is not simulated: the stem was there.
    own = replace(record, position_m=np.where(np.isfinite(simulated_m), simulated_m, record.position_m))
    lands = SlipForces(fit, own, first_rows)
    if lands.landings.count < FEWEST:
        return Needed(0.0, 0.0)
    left = lands.left(lands.fitted)
    beyond = (left.e_n / TOLD) ** 2 - lands.own_n**2
    return Needed(_mostly(beyond), _mostly(beyond / left.slope_n_per_m**2))


def _mostly(squares: Vector) -> float:
    return float(np.sqrt(max(0.0, np.quantile(squares, MOSTLY))))


class Left(NamedTuple):
    """Of each landing e_j and |de_j/dx|; of each break-away the bounds of F_s,k - F_s; or slopes over any of these."""

    e_n: Vector
    slope_n_per_m: Vector
    lower_n: Vector
    upper_n: Vector


class SlipForces:
    """The forces of a rival's slips, and their loss over u: coordinates, offsets and log scatters.

    u = ((z - z_fit) / HELD of what is free, d_r / (S_c / 2), g_r / (S_s / 2), log S_c, log S_s)
    """

    def __init__(self, fit: Fit, record: Record, first_rows: Sequence[int], least_m: float = 0.0) -> None:
        self._least_m = least_m
        composition = Composition.from_file(fit.valve)
        theta = composition.theta
        parameters = free_parameters(composition, tuple(fit.parameters))
        self.error = SimulationError(FreeRun(composition, record), composition, parameters, theta)
        self.fitted = self.error.coordinates(theta)
        self.landings = Landings(self.error, rests(record))
        pressure_pa = self.error.run.run(theta).pressure_pa
        self._landed, self.own_n = self.landings.landed(theta, pressure_pa)
        self._broke = self.landings.breaking(pressure_pa)
        bore = self.landings.holding(pressure_pa)
        self._bore = bore.those(bore.directions == bore.leaves_to)
        self._way = self._landed.directions
        self._shift_m = SHIFT * composition.valve.stroke_m
        self._shifted = [self._landed.shifted(np.full(self._way.size, way * self._shift_m)) for way in (1.0, -1.0)]
        """The landings as if the stem had come to rest elsewhere."""
        self._landed_in, self._broke_in = (
            np.searchsorted(first_rows, each.rows, side="right") - 1 for each in (self._landed, self._broke)
        )
        """In which recording each lies."""
        self._free = [i for i, each in enumerate(parameters) if each.index != VISCOUS]
        self._recordings = len(first_rows)
        self.count = self._landed.rows.size + self._broke.rows.size

    def first(self) -> Vector:
        """Return u to begin with: the fit."""
        e_n, _, _, _ = self.left(self.fitted)
        scatters_n = (max(3.0 * LEAST_N, 1.5 * float(np.median(np.abs(e_n)))), GUESSED_N)
        return np.concatenate([np.zeros(len(self._free) + 2 * self._recordings), np.log(scatters_n)])

    def loss_and_slope(self, u: Vector) -> tuple[float, Vector]:
        """Return -l, and what the parameters' distance from the fit costs; and its slope over u.

        The forces are followed over the parameters by differences, all else by hand: it is cheap, and there are two
        offsets more for each recording.
        """
        z, left = self._there(u)
        coulomb_n, static_n = np.exp(u[-2:])
        d_n, _ = self._offsets_n(u)
        scale_n, off, lower, upper = self._in_scatters(u, left)
        landed, broke = _landed(off, left.slope_n_per_m / scale_n), _log_between(lower, upper)
        value = landed.sum() + broke.sum()

        by_off = -(FREEDOM + 1.0) * off / (FREEDOM + off**2)
        by_lower, by_upper = -np.exp(_log_density(lower) - broke), np.exp(_log_density(upper) - broke)
        by_scale = -(by_off * off + 1.0) / scale_n**2
        by_slope = 1.0 / left.slope_n_per_m + by_scale * left.slope_n_per_m * self._least_m**2
        of_forces = Left(by_off / scale_n, by_slope, by_lower / static_n, by_upper / static_n)
        by_g = -(of_forces.lower_n + of_forces.upper_n)
        slope = np.concatenate(
            [
                [sum(of @ by for of, by in zip(of_forces, moved, strict=True)) for moved in self.moved(z, left)],
                -BETWEEN * coulomb_n * self._by_recording(of_forces.e_n, self._landed_in),
                BETWEEN * static_n * self._by_recording(by_g, self._broke_in),
                [coulomb_n**2 * by_scale.sum() - of_forces.e_n @ d_n],
                [-of_forces.lower_n @ left.lower_n - of_forces.upper_n @ left.upper_n],
            ]
        )
        slope[:-2] -= u[:-2]
        return float(0.5 * (u[:-2] @ u[:-2]) - value), -slope

    def logs(self, u: Vector) -> Vector:
        """Return what each landing and each break-away adds to l, (slips,)."""
        _, left = self._there(u)
        scale_n, off, lower, upper = self._in_scatters(u, left)
        return np.concatenate([_landed(off, left.slope_n_per_m / scale_n), _log_between(lower, upper)])

    def _there(self, u: Vector) -> tuple[Vector, "Left"]:
        """Return the coordinates at u, and what is left of the balances there."""
        z = self.fitted.copy()
        z[self._free] += HELD * u[: len(self._free)]
        z = np.clip(z, self.error.lower, self.error.upper)
        return z, self.left(z)

    def _offsets_n(self, u: Vector) -> tuple[Vector, Vector]:
        """Return d_r of each landing and g_r of each break-away, N."""
        d, g = np.split(u[len(self._free) : -2], 2)
        coulomb_n, static_n = np.exp(u[-2:])
        return BETWEEN * coulomb_n * d[self._landed_in], BETWEEN * static_n * g[self._broke_in]

    def _in_scatters(self, u: Vector, left: "Left") -> tuple[Vector, Vector, Vector, Vector]:
        """Return S_j, N, and in scatters: each e_j - d_r, and the bounds of each F_s,k - F_s - g_r."""
        coulomb_n, static_n = np.exp(u[-2:])
        d_n, g_n = self._offsets_n(u)
        scale_n = self.scatter_n(left, coulomb_n)
        lower, upper = (left.lower_n - g_n) / static_n - PADDING, (left.upper_n - g_n) / static_n + PADDING
        return scale_n, (left.e_n - d_n) / scale_n, lower, upper

    def scatter_n(self, left: "Left", coulomb_n: float) -> Vector:
        """Return S_j, N, (landings,)."""
        return np.asarray(np.sqrt(coulomb_n**2 + self.own_n**2 + (self._least_m * left.slope_n_per_m) ** 2))

    def moved(self, z: Vector, left: "Left") -> Iterator["Left"]:
        """Yield the forces' slopes over each free coordinate, in steps of u; flat beyond a bound."""
        for i in self._free:
            there = z.copy()
            there[i] += DIFFERENCE if z[i] + DIFFERENCE <= self.error.upper[i] else -DIFFERENCE
            yield Left(
                *(HELD / (there[i] - z[i]) * (each - here) for each, here in zip(self.left(there), left, strict=True))
            )

    def _by_recording(self, each: Vector, which: NDArray[np.intp]) -> Vector:
        return np.asarray(np.bincount(which, weights=each, minlength=self._recordings), dtype=np.float64)

    def left(self, z: Vector) -> "Left":
        """Return what is left of the balances at z."""
        theta = self.error.theta(z)
        up_n, down_n = (self.landings.balance_n(theta, each) for each in self._shifted)
        slope_n_per_m = np.maximum(np.abs(up_n - down_n) / (2.0 * self._shift_m), TINY)
        bounds_n = [self.landings.static_at_n(theta, each) - theta[STATIC] for each in (self._bore, self._broke)]
        e_n = self._way * self.landings.balance_n(theta, self._landed)
        return Left(e_n, slope_n_per_m, np.minimum(*bounds_n), np.maximum(*bounds_n))


def _landed(off: Vector, per_m: Vector) -> Vector:
    """Return the log density of each landing, off by so many scatters, a scatter being 1 / per_m long."""
    return np.asarray(_log_density(off) + np.log(per_m))


def _log_density(off: Vector) -> Vector:
    """Return log t of distances in scatters."""
    return np.asarray(NORMAL - 0.5 * (FREEDOM + 1.0) * np.log1p(off**2 / FREEDOM))


def _log_between(lower: Vector, upper: Vector) -> Vector:
    """Return log (T(upper) - T(lower)), taken in the lower tail, where it is exact."""
    flipped = lower > 0.0
    low, high = np.where(flipped, -upper, lower), np.where(flipped, -lower, upper)
    return np.asarray(np.log(np.maximum(stdtr(FREEDOM, high) - stdtr(FREEDOM, low), TINY)))
