"""What slips say of a rival: where they ended and under which forces they began, whatever came between.

    e(x_j + s dx_j) = 0,  e(x) = s (A p - k_s x + F) - F_c      landing j comes to rest dx_j short of its balance, m
    lower_k <= dF_s,k <= upper_k                                break-away k, N, by so much beyond F_s(x, p, s, t): the
                                                                last sample at rest, the first in motion
    held_i <= dF_s,i                                            a rest that bore this much, N, and did not go that way

    l = sum_j log t(dx_j - d_r; S_j)                            S_j^2 = S_c^2 + sigma_j^2 + s^2
      + sum_k log (T(upper_k - g_r; S_s) - T(lower_k - g_r; S_s)) + sum_i log (1 - T(held_i - g_r; S_s))
      - 2 sum_r (d_r / S_c)^2 + (g_r / S_s)^2

is the log likelihood of where slides landed and under which pressures they began, on a valve whose friction scatters:
by S_c, m, where it ends a slide and S_s, N, where it holds, from slip to slip, and half as much, by d_r and g_r, from
recording to recording r. t is Student's density of 4 degrees of freedom, T its distribution function: a slip may be
told wrongly. A rival is weighed by the most that its parameters, scatters and offsets make of l. A slip mistimed by
luck spoils seconds of a free run, and no balance.

Landings scatter in positions: were it in forces, the stiffer rival would be the likelier, whatever landed where; and on
a stop, where a sensor's step is worth thousands of newtons, every rest would speak against it. For the same reason
loads are taken `SHIFT` farther in the direction in which they push: off the stop that the stem rested on, or on the one
that keeps it from going that way. And break-aways scatter by as many newtons whichever way the stem is held: were it in
proportion, pressure noise would speak against a lopsided packing.

Parameters are held loosely to the fit, so that what slips do not tell stays. A rival whose own simulation does not land
where its static balance says needs a scatter s, m, so large that it does; rivals are compared at the most that any
needs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import lgamma, log, nan, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import stdtr

from sim.composition import VISCOUS, Composition
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.fit.fit_result import Fit
from workbench.fit.landings import DIFFERENCE, FEWEST, FORCE_N, Landings, Loaded, Rest, rests
from workbench.fit.objective import SimulationError
from workbench.fit.static_scatter import PADDING, TINY, log_between
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters

FREEDOM = 4.0
"""Degrees of freedom of t."""
BETWEEN = 0.5
"""Scatter from recording to recording, over that from slip to slip."""
LEAST_N, MOST_N = 1.0, 1e4
"""S_s."""
LEAST, MOST = 1e-6, 0.3
"""S_c, of the stroke."""
GUESSED_N = 30.0
"""Scatter of static friction to begin with."""
HELD = 0.5
"""Of a coordinate, from the fit: a standard deviation."""
SHIFT = 2e-3
"""Of the stroke, wider than a sensor's steps: over which a landing's slope is taken, and how far off a load is."""
TOLD, MOSTLY = 0.5, 0.75
"""So near, in scatters, must so many of its own landings lie where a rival's balance says."""
NORMAL = lgamma(0.5 * (FREEDOM + 1.0)) - lgamma(0.5 * FREEDOM) - 0.5 * log(FREEDOM * pi)


@dataclass(frozen=True, slots=True)
class Slips:
    """What slips say of a rival: their log likelihood, of how many landings and break-aways, and their scatters."""

    log_likelihood: float
    count: int
    landing_m: float = nan
    """S_c."""
    static_n: float = nan
    """S_s."""
    least_m: float = 0.0
    """s."""
    logs: Vector = field(default_factory=lambda: np.empty(0))
    """Of that, what each landing, break-away and load borne says; the distance from the fit is not among it."""


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
    found = minimize(forces.loss_and_slope, forces.first(), jac=True, method="L-BFGS-B", bounds=forces.bounds)
    landing_m, static_n = np.exp(found.x[-2:]).tolist()
    return Slips(-float(found.fun), forces.count, landing_m, static_n, least_m, forces.logs(found.x))


def needed_m(fit: Fit, record: Record, first_rows: Sequence[int]) -> float:
    """Return the scatter, m, within which most slides of a rival's own simulation land where its balance says.

    A stem that creeps, or whose friction rises as it slows down, ends elsewhere: so much its landings do not tell.
    """
    composition = Composition.from_file(fit.valve)
    simulated_m = FreeRun(composition, record, from_pressure=fit.from_pressure).position_m(composition.theta)
    # What leads to where a recording is judged from is not simulated: the stem was there.
    own = replace(record, position_m=np.where(np.isfinite(simulated_m), simulated_m, record.position_m))
    lands = SlipForces(fit, own, first_rows)
    if lands.landings.count < FEWEST:
        return 0.0
    beyond = (lands.left(lands.fitted).short_m / TOLD) ** 2 - lands.own_m**2
    return float(np.sqrt(max(0.0, np.quantile(beyond, MOSTLY))))


class SlipsOff(NamedTuple):
    """How far a rival is off at each landing, m, and each break-away, N, and in which recording that lies."""

    landed_m: Vector
    landed_in: NDArray[np.intp]
    broke_n: Vector
    """Beyond what was borne and what broke the stem loose: 0 between the two."""
    broke_in: NDArray[np.intp]


def slips_off(fit: Fit, record: Record, first_rows: Sequence[int]) -> SlipsOff:
    """Return how far a fitted valve is off where slides landed, and in what began them.

    Args:
        fit: the valve.
        record: of all recordings.
        first_rows: of each recording in the record.
    """
    forces = SlipForces(fit, record, first_rows)
    left = forces.left(forces.fitted)
    broke_n = np.maximum(0.0, np.maximum(left.lower_n, -left.upper_n))
    return SlipsOff(np.abs(left.short_m), forces.landed_in, broke_n, forces.broke_in)


class Left(NamedTuple):
    """Of landings dx_j; of break-aways the bounds of dF_s,k; of loads borne held_i; or slopes of these."""

    short_m: Vector
    lower_n: Vector
    upper_n: Vector
    held_n: Vector


class SlipForces:
    """The balances of a rival's slips, and their loss over u: coordinates, offsets and log scatters.

    u = ((z - z_fit) / HELD of what is free, d_r / (S_c / 2), g_r / (S_s / 2), log S_c, log S_s)
    """

    def __init__(
        self,
        fit: Fit,
        record: Record,
        first_rows: Sequence[int],
        least_m: float = 0.0,
        came_to_rest: Sequence[Rest] | None = None,
    ) -> None:
        self._least_m = least_m
        composition = Composition.from_file(fit.valve)
        theta = composition.theta
        parameters = free_parameters(composition, tuple(fit.parameters))
        run = FreeRun(composition, record, from_pressure=fit.from_pressure)
        self.error = SimulationError(run, composition, parameters, theta)
        self.fitted = self.error.coordinates(theta)
        self.landings = Landings(self.error, rests(record) if came_to_rest is None else came_to_rest)
        pressure_pa = self.error.run.run(theta).pressure_pa
        self._stroke_m = composition.valve.stroke_m
        self._shift_m = SHIFT * self._stroke_m
        landed, own_n = self.landings.landed(theta, pressure_pa)
        self._landed = [_farther(landed, each * self._shift_m) for each in (-1.0, 0.0, 1.0)]
        """The landings as if the stem had come to rest before, there, and beyond."""
        bore = _farther(self.landings.holding(pressure_pa), self._shift_m)
        leaves = bore.directions == bore.leaves_to
        self._bore, self._held = bore.those(leaves), bore.those(~leaves)
        self._broke = _farther(self.landings.breaking(pressure_pa), self._shift_m)
        before_n, _, beyond_n = self._balances_n(theta)
        self.own_m = own_n * 2.0 * self._shift_m / np.maximum(before_n - beyond_n, FORCE_N * SHIFT)
        """sigma_j, (landings,)."""
        self.landed_in, self.broke_in, self._held_in = (
            np.searchsorted(first_rows, each.rows, side="right") - 1 for each in (landed, self._broke, self._held)
        )
        """In which recording each lies."""
        self._free = [i for i, each in enumerate(parameters) if each.index != VISCOUS]
        self._recordings = len(first_rows)
        self.count = landed.rows.size + self._broke.rows.size

    def first(self) -> Vector:
        """Return u to begin with: the fit."""
        landing_m = max(3.0 * LEAST * self._stroke_m, 1.5 * float(np.median(np.abs(self.left(self.fitted).short_m))))
        return np.concatenate([np.zeros(len(self._free) + 2 * self._recordings), np.log([landing_m, GUESSED_N])])

    @property
    def bounds(self) -> list[tuple[float | None, float | None]]:
        """Of u."""
        scatters = (np.log(LEAST * self._stroke_m), np.log(MOST * self._stroke_m)), (log(LEAST_N), log(MOST_N))
        return [*[(None, None)] * (len(self._free) + 2 * self._recordings), *scatters]

    def loss_and_slope(self, u: Vector) -> tuple[float, Vector]:
        """Return -l, and what the parameters' distance from the fit costs; and its slope over u.

        The balances are followed over the parameters by differences, all else by hand: it is cheap, and there are two
        offsets more for each recording.
        """
        z, left = self._there(u)
        landing_m, static_n = np.exp(u[-2:])
        scatter_m, off, *loads = self._in_scatters(u, left)
        lower, upper, held = loads
        broke, bore = _log_between(lower, upper), _log_beyond(held)
        value = np.sum(_log_density(off) - np.log(scatter_m)) + broke.sum() + bore.sum()

        by_off = -(FREEDOM + 1.0) * off / (FREEDOM + off**2)
        by_scatter = -(by_off * off + 1.0) / scatter_m**2
        by_lower, by_upper = -np.exp(_log_density(lower) - broke), np.exp(_log_density(upper) - broke)
        by_held = -np.exp(_log_density(held) - bore)
        of = Left(by_off / scatter_m, by_lower / static_n, by_upper / static_n, by_held / static_n)
        by_g = self._by_recording(of.lower_n + of.upper_n, self.broke_in) + self._by_recording(of.held_n, self._held_in)
        by_d = self._by_recording(of.short_m, self.landed_in)
        d, _ = self._offsets(u)
        slope = np.concatenate(
            [
                [sum(by @ each for by, each in zip(of, moved, strict=True)) for moved in self.moved(z, left)],
                -BETWEEN * landing_m * by_d,
                -BETWEEN * static_n * by_g,
                [landing_m**2 * by_scatter.sum() - BETWEEN * landing_m * by_d @ d],
                [-of.lower_n @ left.lower_n - of.upper_n @ left.upper_n - of.held_n @ left.held_n],
            ]
        )
        slope[:-2] -= u[:-2]
        return float(0.5 * (u[:-2] @ u[:-2]) - value), -slope

    def logs(self, u: Vector) -> Vector:
        """Return what each landing, each break-away and each load borne adds to l."""
        _, left = self._there(u)
        scatter_m, off, lower, upper, held = self._in_scatters(u, left)
        landed = _log_density(off) - np.log(scatter_m)
        return np.concatenate([landed, _log_between(lower, upper), _log_beyond(held)])

    def _there(self, u: Vector) -> tuple[Vector, "Left"]:
        """Return the coordinates at u, and what is left of the balances there."""
        z = self.fitted.copy()
        z[self._free] += HELD * u[: len(self._free)]
        z = np.clip(z, self.error.lower, self.error.upper)
        return z, self.left(z)

    def _offsets(self, u: Vector) -> tuple[Vector, Vector]:
        """Return d_r / (S_c / 2) and g_r / (S_s / 2) of each recording."""
        d, g = np.split(u[len(self._free) : -2], 2)
        return d, g

    def _in_scatters(self, u: Vector, left: "Left") -> tuple[Vector, Vector, Vector, Vector, Vector]:
        """Return S_j, m, and in scatters: dx_j - d_r, the bounds of dF_s,k - g_r, and held_i - g_r."""
        landing_m, static_n = np.exp(u[-2:])
        d, g = self._offsets(u)
        scatter_m = self.scatter_m(landing_m)
        off = (left.short_m - BETWEEN * landing_m * d[self.landed_in]) / scatter_m
        lower = left.lower_n / static_n - BETWEEN * g[self.broke_in] - PADDING
        upper = left.upper_n / static_n - BETWEEN * g[self.broke_in] + PADDING
        return scatter_m, off, lower, upper, left.held_n / static_n - BETWEEN * g[self._held_in]

    def scatter_m(self, landing_m: float) -> Vector:
        """Return S_j, m, (landings,)."""
        return np.asarray(np.sqrt(landing_m**2 + self.own_m**2 + self._least_m**2))

    def moved(self, z: Vector, left: "Left") -> Iterator["Left"]:
        """Yield the balances' slopes over each free coordinate, in steps of u; flat beyond a bound."""
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
        bore_n, broke_n, held_n = (
            self.landings.beyond_static_n(theta, each) for each in (self._bore, self._broke, self._held)
        )
        # A slow stem is at rest, by its samples, for longer than it is; what broke it loose it seems to have borne.
        lower_n, upper_n = np.minimum(bore_n, broke_n), np.maximum(bore_n, broke_n)
        return Left(self._short_m(*self._balances_n(theta)), lower_n, upper_n, held_n)

    def _balances_n(self, theta: Vector) -> list[Vector]:
        """Return e of each landing before, where, and beyond where it came to rest, N."""
        return [each.directions * self.landings.balance_n(theta, each) for each in self._landed]

    def _short_m(self, before_n: Vector, there_n: Vector, beyond_n: Vector) -> Vector:
        """Return dx of each landing, m, a stroke at most: where a straight line meets 0, on the side where it does."""
        onwards = there_n > 0.0
        steep_n = np.where(onwards, there_n - beyond_n, before_n - there_n)
        short_m = self._shift_m * there_n / np.maximum(steep_n, FORCE_N * SHIFT)
        return np.clip(short_m, -self._stroke_m, self._stroke_m)


def _farther(at: Loaded, by_m: float) -> Loaded:
    """Return rests as if the stem were so much farther in the direction of (impending) motion, m."""
    return at.shifted(at.directions * by_m)


def _log_density(off: Vector) -> Vector:
    """Return log t of distances in scatters."""
    return np.asarray(NORMAL - 0.5 * (FREEDOM + 1.0) * np.log1p(off**2 / FREEDOM))


def _log_between(lower: Vector, upper: Vector) -> Vector:
    """Return log (T(upper) - T(lower))."""
    return log_between(lower, upper, _below)


def _log_beyond(lower: Vector) -> Vector:
    """Return log (1 - T(lower))."""
    return np.asarray(np.log(np.maximum(_below(-lower), TINY)))


def _below(off: Vector) -> Vector:
    """Return T of distances in scatters."""
    return np.asarray(stdtr(FREEDOM, off))
