"""The tangent preview: a first ranking of the effects in a second, before any of them is fitted. Not a verdict.

    r residual of the bare fit, J its derivatives by the fitted parameters and onsets, t the change that an effect makes
    score = (r' P t)^2 / (r' P r  t' P t),    P projects J out;  0 where t goes with r, away from the record

Limits and quanta do nothing until they are strong enough: hence all strengths that an effect starts with, the best of
which counts, and not the weakest. The right effect stands first in two thirds of the cases, in the first three in seven
of eight (`benchmarks.first_ranking`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from sim.composition import Composition
from sim.effect import Effect
from workbench.fit.breaking_off import go_on
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import extended
from workbench.fit.likelihood import Groups, Likelihood, soft_weight
from workbench.fit.minimiser import derivatives
from workbench.fit.problem import Problem
from workbench.fit.threads import on_threads

Series = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TangentScore:
    """An effect and the share of the residual's energy, 0 to 1, that its tangent explains."""

    name: str
    score: float


def preview(
    base: Fit, of: Problem, library: Mapping[str, Effect], workers: int | None = None
) -> tuple[TangentScore, ...]:
    """Rank the effects by their tangents on the fitted part, best first, on so many threads, by default one a core."""
    tangents = Tangents(base, of)

    def scored(name: str) -> TangentScore:
        effect = library[name]
        return TangentScore(name, max(tangents.shares(effect, effect.strengths(base.valve.valve))[0]))

    return tuple(sorted(on_threads(scored, tuple(library), workers), key=lambda each: -each.score))


class Tangents:
    """What a bare fit leaves, and how much of it the change that an effect makes explains."""

    def __init__(self, base: Fit, of: Problem) -> None:
        self._base, self._of = base, replace(of, eased=base.eased)
        composition = Composition.from_file(base.valve)
        like = self._of.likelihood(composition, tuple(base.parameters))
        self._bare = like.at(composition.theta, base.onsets_s)
        slopes = derivatives(like, like.coordinates(composition.theta), base.onsets_s)
        ends = np.cumsum([each.size for each in self._bare])
        soft = like.weights.soft
        self._all = _Projection(self._bare.whole, slopes, soft)
        self._landings = _Projection(self._bare.landings, slopes[ends[0] : ends[1], : len(base.parameters)], soft)

    def shares(self, effect: Effect, points: Sequence[tuple[float, ...]]) -> tuple[list[float], list[float]]:
        """Return the score of an effect at each of these values of its parameters, by all residuals, and by landings.

        Where slides end hangs on forces alone: it tells a place from another where the motion is far off.
        """
        composition = extended(self._base.valve, (effect.written,), self._base.valve.valve)
        like = self._of.likelihood(composition, ())
        found = [self._with(like, values) for values in points]
        return (
            [self._all.score(each.whole - self._bare.whole) for each in found],
            [self._landings.score(each.landings - self._bare.landings) for each in found],
        )

    def _with(self, like: Likelihood, values: tuple[float, ...]) -> Groups:
        """Return the residuals with an effect's parameters, the last of a valve's, at these values."""
        go_on()
        theta = like.composition.theta.copy()
        theta[theta.size - len(values) :] = values
        return like.at(theta, self._base.onsets_s)


class _Projection:
    """Residuals (rows,), weighed as the soft-L1 cost does, and what their derivatives (rows, columns) leave of them."""

    def __init__(self, r: Series, slopes: Series, soft: float) -> None:
        self._weights = np.sqrt(soft_weight(r, soft))
        self._basis, _ = np.linalg.qr(self._weights[:, None] * slopes)
        self._left = self._without(r)

    def score(self, tangent: Series) -> float:
        t = self._without(tangent)
        energy, along = float(self._left @ self._left) * float(t @ t), float(self._left @ t)
        return along**2 / energy if energy > 0.0 and along < 0.0 else 0.0

    def _without(self, series: Series) -> Series:
        weighed = self._weights * series
        return np.asarray(weighed - self._basis @ (self._basis.T @ weighed))
