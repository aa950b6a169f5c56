"""What the slips of an experiment promise to tell of rivals: courses of the menu by the forces of their slips.

A rival A answers a course, under the pressure noise that `Rivalry` plays: what slips only in silence promises nothing.
Where its slides land and break loose its balances are held against those of another, B:

    r = ((dx_j,B - dx_j,A)/S_j, (f_k,B - f_k,A)/T_k)     f_k middle of the interval of dF_s,k, see `slip_evidence`
    S_j^2 = S_c^2 + sigma_j^2,  T_k^2 = S_s^2 + w_k^2/12   w_k width of the interval: a large step tells little of F_s
    l = sum of min((nu + 1)/(nu + 3) e^2/2, (nu + 1)/2 log(1 + e^2/nu)) + (nu + 1)/(nu + 3) u' H u/2,  e = r + J u
    u = argmin |r + J u|^2 + u' H u                                           H = 1 + J' J over the recordings so far

u are B's parameters, held as the recordings know them, and an offset of either friction in the new recording; nu is the
freedom of t, by which no slip says much alone. By l the log odds of A against B are to rise, in the mean over draws of
the noise, which decides where a stem slips; other draws than those by which a course was found say what it promises.
A course promises the least of all pairs, but of those that no course tells apart, however often repeated: what else is
suspected can still be ruled out.

On a valve that scatters a slow ramp of many slips tells more than a large step: each leg is one move. The best few of
the menu are changed at random, a change kept if it promises more a move.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.discriminate.experiment_design import (
    CHECKED,
    KEPT,
    SEARCHED,
    Course,
    Rivalry,
    Terms,
    courses,
    improved,
    told_apart,
)
from workbench.discriminate.slip_evidence import BETWEEN, FREEDOM, Left, SlipForces, Slips
from workbench.fit.fit_result import Fit
from workbench.fit.landings import FEWEST, rests
from workbench.fit.threads import on_threads

Matrix = NDArray[np.float64]
HOPELESS = 0.01
"""Log odds a move: a pair of which no course promises more will not be told apart in any number of moves."""


def promised_by_slips(
    rivals: Sequence[tuple[Fit, Slips]],
    record: Record,
    first_rows: Sequence[int],
    terms: Terms,
    *,
    workers: int | None = None,
) -> tuple[Course, float] | None:
    """Return the course whose slips promise most a move, and by how much the log odds rise.

    Args:
        rivals: two or more, and what slips have said of each.
        record: of all recordings so far.
        first_rows: of each recording in the record.
        terms: to keep to.
        workers: threads, by default one a core.
    """
    by_slips = _SlipRivalry(rivals, record, first_rows, terms)
    inside = list(courses(record, terms))
    rated = np.array(list(on_threads(lambda course: by_slips.promised(course, SEARCHED), inside, workers)))
    if not rated.size:
        return None
    moves = np.array([max(1, course.moves) for course in inside])
    pairs = told_apart(rated / moves[:, None], HOPELESS)
    a_move = rated[:, pairs].min(axis=1) / moves

    def least(course: Course, draws: Sequence[int]) -> float:
        return float(by_slips.promised(course, draws)[pairs].min())

    def score(course: Course) -> float:
        return least(course, SEARCHED) / max(1, course.moves)

    def changed(i: int) -> Course:
        return improved(score, inside[i], a_move[i], terms.bounds, np.random.default_rng([terms.seed, i]))

    kept = np.argsort(-a_move, kind="stable")[:KEPT].tolist()
    found = [*on_threads(changed, kept, workers), *(inside[i] for i in kept)]
    promises = list(on_threads(lambda course: least(course, CHECKED), found, workers))
    best = max(range(len(found)), key=lambda i: promises[i] / max(1, found[i].moves))
    return (found[best], promises[best]) if promises[best] > 0.0 else None


class _SlipRivalry:
    """Rivals held against each other's answers by the forces of their slips."""

    def __init__(
        self, rivals: Sequence[tuple[Fit, Slips]], record: Record, first_rows: Sequence[int], terms: Terms
    ) -> None:
        self._rivals = rivals
        self._rivalry = Rivalry([fit for fit, _ in rivals], record, terms)
        self._known = [_Known(fit, told, record, first_rows) for fit, told in rivals]

    def promised(self, course: Course, draws: Sequence[int]) -> Vector:
        """Return what a course promises of each rival that answers against each other one, (pairs,)."""
        return np.asarray(np.mean([self._told(course, draw) for draw in draws], axis=0))

    def _told(self, course: Course, draw: int) -> Vector:
        count = len(self._rivals)
        told: list[float] = []
        for i in range(count):
            answer = self._rivalry.answer(i, course, draw)
            if answer is None:
                return np.zeros(count * (count - 1))
            came_to_rest = rests(answer)
            forces = [
                SlipForces(replace(fit, from_pressure=False), answer, [0], slips.least_m, came_to_rest)
                for fit, slips in self._rivals
            ]
            if forces[i].landings.count < FEWEST:
                return np.zeros(count * (count - 1))
            left = [each.left(each.fitted) for each in forces]
            told += [self._known[j].told_by(forces[j], left[j], left[i]) for j in range(count) if j != i]
        return np.array(told)


class _Known:
    """A rival, and what the slips so far say of its parameters."""

    def __init__(self, fit: Fit, told: Slips, record: Record, first_rows: Sequence[int]) -> None:
        self._told = told
        forces = SlipForces(fit, record, first_rows, told.least_m)
        here = forces.left(forces.fitted)
        J = self._slopes(forces, here) / self._scatters(forces, here)[:, None]
        self._information = np.eye(J.shape[1]) + J.T @ J

    def told_by(self, forces: SlipForces, here: Left, answered: Left) -> float:
        """Return l against this valve, of the one that answered, from the balances of both in the answer."""
        scatters = self._scatters(forces, here)
        r = (_middles(here) - _middles(answered)) / scatters
        landings = np.arange(r.size) < forces.own_m.size
        J = self._slopes(forces, here) / scatters[:, None]
        J = np.column_stack([J, -BETWEEN * landings, -BETWEEN * ~landings])
        H = np.eye(J.shape[1])
        H[:-2, :-2] = self._information
        u = -np.linalg.solve(J.T @ J + H, J.T @ r)
        e = r + J @ u
        near, far = (FREEDOM + 1.0) / (FREEDOM + 3.0) * e**2, (FREEDOM + 1.0) * np.log1p(e**2 / FREEDOM)
        return float(0.5 * (np.minimum(near, far).sum() + (FREEDOM + 1.0) / (FREEDOM + 3.0) * (u @ H @ u)))

    def _slopes(self, forces: SlipForces, here: Left) -> Matrix:
        """Return what the balances change by with the coordinates, m and N, (slips, coordinates)."""
        return np.column_stack([_middles(each) for each in forces.moved(forces.fitted, here)])

    def _scatters(self, forces: SlipForces, here: Left) -> Vector:
        """Return S_j, m, and T_k, N, (slips,)."""
        widths_n = here.upper_n - here.lower_n
        return np.concatenate(
            [forces.scatter_m(self._told.landing_m), np.hypot(self._told.static_n, widths_n / 12.0**0.5)]
        )


def _middles(left: Left) -> Vector:
    """Return dx_j, m, and f_k, N, (slips,)."""
    return np.concatenate([left.short_m, 0.5 * (left.lower_n + left.upper_n)])
