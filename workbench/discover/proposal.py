"""Which forms are likely, and where their fits begin, found by projection. It decides nothing.

At every strength c, with every value of a shape's own parameters from which a fit may begin:

    tangent     (r' P t)^2 / (r' P r  t' P t)      r what the bare fit leaves of the record, t the change that the form
                                                   makes of the simulated position, P projects the bare valve's own
                                                   parameters out
    landings    missing_j = x_j dk_s + s_j dF_c + c (F_j - s_j dF_cj)

                what the balance of forces leaves where slides end in rest, by robust least squares; F_j force and
                dF_cj friction that the form adds at landing j, s_j the direction that it came by: no simulation

Forms are taken by turns of the two; the fit of each begins at the best point of either.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, zip_longest

import numpy as np
import numpy.typing as npt

from config.valve_file import EffectTable, ValveFile
from sim.composition import Composition
from sim.effect import Effect
from sim.interpreted import interpreted
from workbench.data.held_out import Split
from workbench.discover.added_force import Landing, landings
from workbench.discover.grammar import Form
from workbench.fit.breaking_off import go_on
from workbench.fit.descent import NARROW
from workbench.fit.fit_result import Fit
from workbench.fit.objective import FINAL, SimulationError, root_weights
from workbench.fit.threads import on_threads
from workbench.model.free_run import ROUGH, FreeRun
from workbench.model.parameters import MOST_GRID, free_parameters

FEWEST_LANDINGS = 8
"""Below which a regression of three columns says nothing."""
BEST = 5
"""Points that each of the two gives a fit to begin with."""
REWEIGHED = 3
NEARER = 10.0
"""Medians, beyond which a landing counts no more."""

Point = tuple[float, ...]
Series = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Proposal:
    """A form, by the name of its file, and the values of its parameters at which a fit is to begin."""

    name: str
    points: tuple[Point, ...]


def proposed(
    base: Fit,
    split: Split,
    forms: Mapping[str, Form],
    effects: Mapping[str, Effect],
    workers: int | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> tuple[Proposal, ...]:
    """Return the forms with where to begin, the likeliest first.

    Args:
        base: the fit of the valve as it is.
        split: what it was fitted to.
        forms: by the names of their files.
        effects: the same as effects.
        workers: threads, by default one a core.
        tell: called with the fraction done.
    """
    tangents = _Tangents(base, split)
    names = tuple(effects)
    points = {name: effects[name].strengths(base.valve.valve)[:MOST_GRID] for name in names}
    scores: dict[str, list[float]] = {}
    for name, found_here in zip(
        names, on_threads(lambda name: tangents.scores(effects[name], points[name]), names, workers), strict=True
    ):
        scores[name] = found_here
        tell(len(scores) / len(names))
    by_tangent = sorted(names, key=lambda name: -max(scores[name]))
    found = landings(base, split)
    left: dict[str, list[float]] = {}
    if len(found) >= FEWEST_LANDINGS:
        left = {name: _left_n(base, found, effects[name], points[name]) for name in names if forms[name].is_static}
    by_landings = sorted(left, key=lambda name: min(left[name]))
    turns = chain.from_iterable(zip_longest(by_tangent, by_landings))
    order = dict.fromkeys(name for name in turns if name is not None)
    best = {name: [points[name][i] for i in np.argsort(scores[name])[: -BEST - 1 : -1]] for name in order}
    for name in left:
        best[name] += [points[name][i] for i in np.argsort(left[name])[:BEST]]
    return tuple(
        Proposal(name, tuple(_free(effects[name], each) for each in dict.fromkeys(best[name]))) for name in order
    )


def _free(effect: Effect, values: Point) -> Point:
    """Return a point without what is read from a drawing."""
    return tuple(value for value, each in zip(values, effect.parameters.values(), strict=True) if not each.given)


def _with_form(valve: ValveFile, effect: Effect) -> Composition:
    """Compose a valve with a form, switched off."""
    values = dict(zip(effect.parameters, effect.off(valve.valve), strict=True))
    table = EffectTable.model_validate({"name": effect.written, **values})
    return Composition.from_file(valve.model_copy(update={"effect": (*valve.effect, table)}))


class _Tangents:
    """What a bare fit leaves, and the projection of what a form changes on it."""

    def __init__(self, base: Fit, split: Split) -> None:
        self._base, self._record = base, split.train.record
        composition = Composition.from_file(base.valve)
        run = FreeRun(composition, self._record, from_pressure=base.from_pressure, by=base.by)
        error = SimulationError(
            run, composition, free_parameters(composition, tuple(base.parameters)), composition.theta
        )
        z = error.coordinates(composition.theta)
        residual = error.residuals(z)
        self._weights = root_weights(residual, FINAL)
        self._basis, _ = np.linalg.qr(self._weights[:, None] * error.jacobian(z, residual, NARROW.difference))
        self._bare_m = run.position_m(composition.theta)
        self._rows = np.flatnonzero(run.judged & self._record.valid)
        self._left = self._without(self._weights * residual)

    def scores(self, effect: Effect, points: Sequence[Point]) -> list[float]:
        """Return the share of the residual's energy, 0 to 1, that a form explains at each point."""
        found = []
        extended = _with_form(self._base.valve, effect)
        run = FreeRun(extended, self._record, from_pressure=self._base.from_pressure, accuracy=ROUGH, by=self._base.by)
        for values in points:
            go_on()
            theta = np.concatenate([extended.theta[: -len(values)], values])
            change_m = np.nan_to_num(run.position_m(theta) - self._bare_m)[self._rows]
            t = self._without(self._weights * change_m)
            energy = float(self._left @ self._left) * float(t @ t)
            found.append(float(self._left @ t) ** 2 / energy if energy > 0.0 else 0.0)
        return found

    def _without(self, series: Series) -> Series:
        return np.asarray(series - self._basis @ (self._basis.T @ series))


def _left_n(base: Fit, found: Sequence[Landing], effect: Effect, points: Sequence[Point]) -> list[float]:
    """Return what the landings leave beside a form, N, at each of its points."""
    laws = interpreted((effect,))
    coulomb_n = base.valve.valve.coulomb_n
    bare = Composition.from_file(ValveFile(valve=base.valve.valve)).theta.tolist()
    position_m, direction, missing_n = np.array([[each.position_m, each.direction, each.missing_n] for each in found]).T
    left = []
    for values in points:
        theta = [*bare, *values]
        column = np.empty(len(found))
        for i, each in enumerate(found):
            stem = laws.Stem(each.time_s, each.position_m, 0.0, each.pressure_pa)
            level_n, _ = laws.friction(coulomb_n, coulomb_n, each.direction, stem, theta, ())
            column[i] = laws.force(0.0, stem, theta, ()) - each.direction * (level_n - coulomb_n)
        left.append(_robust_left_n(np.column_stack([position_m, direction, column]), missing_n))
    return left


def _robust_left_n(matrix: Series, missing_n: Series) -> float:
    """Return the mean distance, N, that least squares leave, thrice reweighed towards the median."""
    weights = np.ones(missing_n.size)
    scaled = matrix / np.maximum(np.abs(matrix).max(axis=0), np.finfo(float).tiny)
    left = np.abs(missing_n)
    for _ in range(REWEIGHED):
        found = np.linalg.lstsq(weights[:, None] * scaled, weights * missing_n)[0]
        left = np.abs(missing_n - scaled @ found)
        weights = (1.0 + (left / max(float(np.median(left)), np.finfo(float).tiny)) ** 2) ** -0.25
    return float(np.mean(np.minimum(left, NEARER * float(np.median(left)))))
