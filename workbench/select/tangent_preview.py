"""The tangent preview: a first ranking of the effects in a second, before any of them is fitted. Not a verdict.

    r residual of the bare fit, J its derivatives by the fitted parameters, t the change that an effect makes
    score = (r' P t)^2 / (r' P r  t' P t),    P projects J out;  the best of the strengths that the effect starts with

Limits and quanta do nothing until they are strong enough: hence all strengths, and not the weakest. The right effect
stands first in two thirds of the cases, in the first three in seven of eight (`benchmarks.first_ranking`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from config.valve_file import EffectTable, ValveFile
from sim.composition import Composition
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.data.record import Record
from workbench.fit.descent import NARROW
from workbench.fit.fit_result import Fit
from workbench.fit.objective import FINAL, SimulationError, root_weights
from workbench.fit.threads import on_threads
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters

Series = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TangentScore:
    """An effect and the share of the residual's energy, 0 to 1, that its tangent explains."""

    name: str
    score: float


def preview(
    base: Fit, split: Split, library: Mapping[str, Effect], workers: int | None = None
) -> tuple[TangentScore, ...]:
    """Rank the effects by their tangents on the fitted part, best first, on so many threads, by default one a core."""
    record = split.train.record
    composition = Composition.from_file(base.valve)
    run = FreeRun(composition, record, from_pressure=base.from_pressure, by=base.by)
    parameters = free_parameters(composition, tuple(base.parameters))
    error = SimulationError(run, composition, parameters, composition.theta)
    z = error.coordinates(composition.theta)
    residual = error.residuals(z)
    weights = root_weights(residual, FINAL)
    basis, _ = np.linalg.qr(weights[:, None] * error.jacobian(z, residual, NARROW.difference))
    bare = run.position_m(composition.theta)
    rows = record.valid & np.isfinite(bare)
    r = _without(basis, weights * residual)

    def score(tangent_m: Series) -> float:
        t = _without(basis, weights * tangent_m[rows])
        energy = float(r @ r) * float(t @ t)
        return float(r @ t) ** 2 / energy if energy > 0.0 else 0.0

    def scored(name: str) -> TangentScore:
        return TangentScore(name, max(score(each) for each in _tangents(base, library[name], name, record, bare)))

    return tuple(sorted(on_threads(scored, tuple(library), workers), key=lambda each: -each.score))


def _without(basis: Series, series: Series) -> Series:
    return np.asarray(series - basis @ (basis.T @ series))


def _tangents(base: Fit, effect: Effect, name: str, record: Record, bare: Series) -> list[Series]:
    """Return the change of the indicated position by the effect at each of its strengths."""
    valve = base.valve
    tangents = []
    for values in effect.strengths(valve.valve):
        table = EffectTable.model_validate({"name": name, **dict(zip(effect.parameters, values, strict=True))})
        extended = Composition.from_file(ValveFile(valve=valve.valve, effect=(*valve.effect, table)))
        run = FreeRun(extended, record, from_pressure=base.from_pressure, by=base.by)
        tangents.append(np.nan_to_num(run.position_m(extended.theta) - bare))
    return tangents
