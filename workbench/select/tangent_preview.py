"""The tangent preview: a ranking of the effects in a second, before any of them is fitted. Not a verdict.

    r residual of a fit, J its derivatives by the fitted parameters and onsets, t the change that an effect makes
    score = (r' P t)^2 / (r' P r  t' P t),    P projects J out;  0 where t goes with r, away from the record

Limits and quanta do nothing until they are strong enough: hence all strengths that an effect starts with, the best of
which counts, and not the weakest. The right effect stands first in two thirds of the cases, in the first three in seven
of eight (`benchmarks.first_ranking`). What an effect changes beside one model is nearly what it changes beside another
that is as near to the record: a search composes them with its best model, and ranks them beside all others by that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sim.composition import Composition
from sim.effect import Effect
from workbench.fit.breaking_off import go_on
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import extended
from workbench.fit.likelihood import Groups, soft_weight
from workbench.fit.minimiser import derivatives
from workbench.fit.threads import on_threads

Series = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TangentScore:
    """An effect and the share of the residual's energy, 0 to 1, that its tangent explains."""

    name: str
    score: float


class Left:
    """What a fit leaves of its record, and how much of it a change explains."""

    def __init__(self, fit: Fit, of: Problem) -> None:
        self.fit, self.of = fit, replace(of, eased=fit.eased)
        composition = Composition.from_file(fit.valve)
        like = self.of.likelihood(composition, tuple(fit.parameters))
        self.groups = like.at(composition.theta, fit.onsets_s)
        slopes = derivatives(like, like.coordinates(composition.theta), fit.onsets_s)
        ends = np.cumsum([each.size for each in self.groups])
        self._all = _Projection(self.groups.whole, slopes)
        self._landings = _Projection(self.groups.landings, slopes[ends[0] : ends[1], : len(fit.parameters)])

    def share(self, change: Groups) -> float:
        """Return the score of a change."""
        return self._all.score(change.whole)

    def share_of_landings(self, change: Groups) -> float:
        """Return the same by landings alone: where slides end hangs on forces, however far off the motion is."""
        return self._landings.score(change.landings)

    def changes_by(self, effect: Effect, points: Sequence[tuple[float, ...]]) -> list[Groups]:
        """Return what an effect changes of the residuals at each of these values of its parameters."""
        composition = extended(self.fit.valve, (effect.written,), self.fit.valve.valve)
        like = self.of.likelihood(composition, ())
        found = []
        for values in points:
            go_on()
            theta = composition.theta.copy()
            theta[theta.size - len(values) :] = values
            found.append(Groups(*map(np.subtract, like.at(theta, self.fit.onsets_s), self.groups)))
        return found


Changes = Mapping[str, Sequence[Groups]]
"""Of each effect, at each of its strengths."""


def changes(left: Left, library: Mapping[str, Effect], workers: int | None = None) -> Changes:
    """Return what each effect changes of a fit, on so many threads, by default one a core."""
    valve = left.fit.valve.valve
    found = on_threads(lambda each: left.changes_by(each, each.strengths(valve)), tuple(library.values()), workers)
    return dict(zip(library, found, strict=True))


def rank(left: Left, by: Changes) -> tuple[TangentScore, ...]:
    """Rank the effects by their changes of this fit, or of one that is as near to the record, best first."""
    scores = [TangentScore(name, max(map(left.share, each), default=0.0)) for name, each in by.items()]
    return tuple(sorted(scores, key=lambda each: -each.score))


def preview(
    base: Fit, of: Problem, library: Mapping[str, Effect], workers: int | None = None
) -> tuple[TangentScore, ...]:
    """Rank the effects by their tangents on the fitted part, best first."""
    left = Left(base, of)
    return rank(left, changes(left, library, workers))


class _Projection:
    """Residuals (rows,), weighed as the soft-L1 cost does, and what their derivatives (rows, columns) leave of them."""

    def __init__(self, r: Series, slopes: Series) -> None:
        self._weights = np.sqrt(soft_weight(r))
        self._basis, _ = np.linalg.qr(self._weights[:, None] * slopes)
        self._left = self._without(r)

    def score(self, tangent: Series) -> float:
        t = self._without(tangent)
        energy, along = float(self._left @ self._left) * float(t @ t), float(self._left @ t)
        return along**2 / energy if energy > 0.0 and along < 0.0 else 0.0

    def _without(self, series: Series) -> Series:
        weighed = self._weights * series
        return np.asarray(weighed - self._basis @ (self._basis.T @ weighed))
