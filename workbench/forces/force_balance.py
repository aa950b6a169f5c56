"""The balance of forces under an imposed position, or along a static curve, and its fit. No simulation is needed.

    load = -A p + k_s x + F_v v + F_c z + F_0 + terms      a bench: A, k_s, F_v, F_c, F_0 fitted
    A p  =        k_s x         + F_c z + F_0 + terms      a static curve: A given, k_s, F_c, F_0 fitted

z is the direction of motion, +1 or -1, until presliding is added. The terms are those of the library's own laws
(`sim.effects`) under the motion as it was imposed: with f the force and F the sliding friction, N, of an effect's file,
and q its strength,

    term    q dF/dq z       at q = 0, F_c = 1 N; of a friction in proportion to F_c what is fitted is q F_c
            -q df/dq        of a force; a law that is another for q < 0 is tried with each sign

A constant is in the balance as F_0: what comes to one, as preload and an asymmetry do here, is none of the terms. What
holds the stem at rest, the pressure path and the sensor's dynamics leave no trace in a balance of moving rows. Besides

    presliding      z' = 1 / x_f within -1 <= z <= 1: the packing yields over x_f = F_c / k_p before it slips

which is its law solved for the force. Friction stays positive, and a strength in its effect's range.

Each fit is linear least squares within the physical ranges. Of several recordings, each is predicted from the others:
a pressure or a seal never fitted on. One recording is predicted by fifths, a static curve reading by reading.

    floor      scatter of what is left at the same place, the same way, in the same recording, over several strokes:
               what no such balance explains; a static curve has none, as it passes each place once
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from config.recording import Column
from config.results.result import Brief
from config.valve_file import ValveParameters
from sim.effect import Effect, shipped_effect, tried_effects
from sim.interpreted import own_law
from workbench.compare.measures import rms
from workbench.data.imposed_motion import Rows

FIFTHS = 5
YIELDS = (5e-4, 1e-3, 2e-3, 4e-3, 8e-3, 16e-3)
"""Of the travel: over how much of it the packing may yield."""
SHAPES: Mapping[str, tuple[float, ...]] = {
    "velocity_m_per_s": (0.1, 0.3, 1.0),
    "exponent": (0.3, 0.5, 0.7, 1.5, 2.0, 3.0),
}
"""What is tried of a law's shape: velocities, in median speeds, and exponents."""
PRESLIDING = "presliding"
DERIVATIVE_STEP = 1e-6
"""Of a strength, for the derivative of a law by it."""
ALONE = 1e-6
"""Share of a term that no combination of the bare balance's makes up, below which it is none."""
PLACES = 40
"""Cells of the travel in which a residual's scatter is taken."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
MOST_SHARES = 1e12
"""Times F_c beyond which a coefficient is no share of it: there is none."""
OUTSIDE_STANDARD_ERRORS = 3.0
"""Standard errors by which a coefficient lies beyond its range before that is said."""

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, repr=False)
class ForceFit(Brief):
    """A balance fitted: its parameters and their jackknife deviations over what was left out, and its residuals."""

    effects: tuple[str, ...]
    parameters: Mapping[str, float]
    deviations: Mapping[str, float]
    train_rms_n: float
    test_rms_n: float
    """Of the rows, each predicted by a fit that has not seen it."""
    logs: Column
    """Logarithm of the rms error of each stroke, or reading, so predicted."""
    residual_n: Column
    bic: float
    range_violation: str
    """What the rows want outside its physical range; empty if nothing."""

    @property
    def median_error_n(self) -> float:
        """Median error, as a standard deviation."""
        return median_error_n(self.residual_n)


@dataclass(frozen=True, slots=True)
class Term:
    """An effect's law as a column: its strength's name and unit, +1 or -1, and the shape of its law."""

    effect: Effect
    strength: str
    unit: float = 1.0
    shape: tuple[tuple[str, float], ...] = ()
    of_sign: bool = False
    """Whether the law is another for a strength of the other sign: then it is of one way, and F_v of the other."""

    @property
    def name(self) -> str:
        """The strength's."""
        return f"{self.effect.name}.{self.strength}"

    @property
    def is_friction(self) -> bool:
        """Whether it acts with z."""
        return "friction" in self.effect.functions

    @property
    def scales(self) -> bool:
        """Whether it is in proportion to F_c."""
        return self.is_friction and not self.effect.parameters[self.strength].scale

    @property
    def least(self) -> float:
        """Of the strength in its unit."""
        return 0.0 if self.effect.parameters[self.strength].least == 0.0 or self.of_sign else -np.inf

    def values(self, rows: Rows) -> Column:
        """Return what it adds to the force or to the level of friction, N, (rows,), for a strength of one unit."""
        place = "friction" if self.is_friction else "force"
        law, named = own_law(self.effect, place), self.effect.functions[place]
        one = np.ones(len(rows))
        given = {"x": rows.position_m, "p": rows.pressure_pa, "direction": rows.direction, "F_c": one, "F_s": one}
        if rows.velocity_m_per_s is not None and rows.time_s is not None:
            given |= {"t": rows.time_s, "v": rows.velocity_m_per_s}
        at = [given[each].tolist() for each in named if each != "q"]
        readings = list(zip(*at, strict=True)) or [()] * len(rows)

        q = law.parameters(**dict(self.shape), **{self.strength: self.unit * DERIVATIVE_STEP})
        found = [law.function(*each, q) for each in readings]
        # Without strength it vanishes: no force, and the friction that it was given.
        return (np.array([each[0] for each in found]) - one if self.is_friction else np.array(found)) / DERIVATIVE_STEP


@dataclass(frozen=True, slots=True)
class ForceModel:
    """Which terms a balance has beyond the bare one, and over how much the packing yields, m."""

    terms: tuple[Term, ...] = ()
    yield_m: float | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects' names, presliding last."""
        names = tuple(each.effect.name for each in self.terms)
        return names if self.yield_m is None else (*names, PRESLIDING)

    @property
    def free(self) -> int:
        """Shapes that were chosen."""
        return (self.yield_m is not None) + sum(len(_trial_parameters(each.effect)) for each in self.terms)


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the balance: its coefficient's name, range, and values."""

    name: str
    least: float
    values: Column
    added: bool = False
    """Whether it is a term's, or of what a term hangs on: it stands for nothing else then."""


class Balance:
    """Rows, and how they are left out in turn."""

    rows: Rows
    valve: ValveParameters
    fold: NDArray[np.int64]

    def __init__(self, rows: Rows, valve: ValveParameters, *, tested: bool) -> None:
        self.rows = rows
        self.valve = valve
        self.fold = _folds(rows, tested=tested)
        self.held_out = (self.fold.max(),) if tested else tuple(range(int(self.fold.max()) + 1))
        self._slips: dict[float, Column] = {}
        self._values: dict[tuple[Any, ...], Column] = {}

    @cached_property
    def library(self) -> dict[str, Effect]:
        """The effects that rows like these can show, by name."""
        moved = self.rows.velocity_m_per_s is not None
        library = {name: shipped_effect(name, "effects") for name in tried_effects()}
        return {name: each for name, each in library.items() if self._shows(each, moved)} | (
            {PRESLIDING: library[PRESLIDING]} if moved else {}
        )

    def _shows(self, effect: Effect, moved: bool) -> bool:
        """Whether an effect is a force or a friction by what these rows have, with one strength, and no constant."""
        named = {argument for place in effect.places for argument in effect.functions[place]}
        if effect.memory or {*effect.places} not in ({"force"}, {"friction"}) or (not moved and named & {"t", "v"}):
            return False
        strengths = [key for key, each in effect.parameters.items() if each.off == 0.0]
        if len(strengths) != 1:
            return False
        bare = np.column_stack([each.values for each in self.columns(ForceModel())])
        column = self._column(self._terms(effect)[0], self.rows.direction)
        left = column - bare @ np.linalg.lstsq(bare, column)[0]
        return float(np.linalg.norm(left)) > ALONE * float(np.linalg.norm(column))

    def _terms(self, effect: Effect) -> list[Term]:
        """Return an effect's law, once for each shape and each sign by which it differs."""
        (strength,) = (key for key, each in effect.parameters.items() if each.off == 0.0)
        shapes: dict[str, tuple[float, ...]] = {}
        for key, declared in effect.parameters.items():
            if key != strength:
                tried = SHAPES[key] if key in _trial_parameters(effect) else ()
                speeds = self.rows.velocity_m_per_s if key == "velocity_m_per_s" else None
                unit = 1.0 if speeds is None else float(np.median(np.abs(speeds)))
                shapes[key] = tuple(unit * each for each in tried) or declared.starts_for(self.valve)[:1]
        found = [Term(effect, strength, 1.0, each) for each in _products(shapes)]
        if effect.parameters[strength].least >= 0.0:
            return found
        if not np.allclose(self._values_of(found[0]), -self._values_of(replace(found[0], unit=-1.0))):
            found = [replace(each, unit=unit, of_sign=True) for each in found for unit in (1.0, -1.0)]
        return found

    def _column(self, term: Term, z: Column) -> Column:
        """Return a term as it stands in the balance, (rows,)."""
        return self._values_of(term) * z if term.is_friction else -self._values_of(term)

    def _values_of(self, term: Term) -> Column:
        key = term.name, term.unit, term.shape
        if key not in self._values:
            self._values[key] = term.values(self.rows)
        return self._values[key]

    def friction_state(self, yield_m: float | None) -> Column:
        """Return z, (rows,): the direction, or that of a packing that yields over so many metres before it slips."""
        if yield_m is None:
            return self.rows.direction
        if yield_m not in self._slips:
            self._slips[yield_m] = _yielding(self.rows, yield_m)
        return self._slips[yield_m]

    def columns(self, model: ForceModel) -> list[_Column]:
        """Return the columns of a model."""
        rows, z = self.rows, self.friction_state(model.yield_m)
        base = [
            _Column("spring_n_per_m", 0.0, rows.position_m),
            _Column("coulomb_n", 0.0, z),
            _Column("constant_n", -np.inf, np.ones(len(rows))),
        ]
        if rows.velocity_m_per_s is not None:
            one_way = any(each.of_sign for each in model.terms)
            base.append(_Column("viscous_ns_per_m", 0.0, rows.velocity_m_per_s, one_way))
        if rows.load_n is not None:
            base.append(_Column("diaphragm_area_m2", 0.0, -rows.pressure_pa))
        return [*base, *(_Column(each.name, each.least, self._column(each, z), True) for each in model.terms)]

    def fit_model(self, model: ForceModel, *, bounded: bool = True) -> ForceFit:
        """Fit a model to all that is fitted, and predict each part from the others."""
        columns, y = self.columns(model), balanced_n(self.rows, self.valve)
        X = np.column_stack([each.values for each in columns])
        scale = np.maximum(np.abs(X).max(axis=0), np.finfo(float).tiny)
        least = np.array([each.least if bounded else -np.inf for each in columns])
        reduced = {k: _reduce(X[self.fold == k] / scale, y[self.fold == k]) for k in range(int(self.fold.max()) + 1)}
        trained = [k for k in reduced if k not in self.held_out or len(self.held_out) == len(reduced)]
        theta = _solve([reduced[k] for k in trained], least) / scale
        others = {k: _solve([reduced[j] for j in reduced if j != k], least) / scale for k in self.held_out}
        residual_n, predicted_n = y - X @ theta, np.full(y.size, np.nan)
        for k, other in others.items():
            predicted_n[self.fold == k] = (y - X @ other)[self.fold == k]
        predicted = np.isfinite(predicted_n)
        train_n = rms(residual_n[np.isin(self.fold, trained)])
        values = dict(zip([each.name for each in columns], theta.tolist(), strict=True))
        whole = self._parameters(model, values)
        violations = (
            self._range_violation(columns, reduced, trained, least),
            self._negative_friction(model, values),
            _outside(model, whole),
        )
        deviations = _jackknife(list(others.values()))
        n = int(np.isin(self.fold, trained).sum())
        free = len(columns) + model.free
        return ForceFit(
            model.effects,
            whole,
            {} if deviations is None else self._own(model, values, dict(zip(values, deviations.tolist(), strict=True))),
            train_n,
            rms(predicted_n[predicted]),
            _stroke_logs(self.rows.stroke[predicted], predicted_n[predicted]),
            np.where(predicted, predicted_n, residual_n),
            n * 2.0 * float(np.log(max(train_n, 1e-12))) + free * float(np.log(n)),
            next(filter(None, violations), "") if bounded else "",
        )

    def _level_n(self, model: ForceModel, values: Mapping[str, float]) -> Column:
        """Return the sliding friction of a balance, N, (rows,)."""
        up = np.ones(len(self.rows))
        return values["coulomb_n"] * up + sum(
            values[each.name] * self._column(each, up) for each in model.terms if each.is_friction
        )

    def _parameters(self, model: ForceModel, values: Mapping[str, float]) -> dict[str, float]:
        """Return what was fitted as the effects' own parameters, with their shapes."""
        found = self._own(model, values, dict(values))
        for each in model.terms:
            found[each.name] *= each.unit
            found |= {f"{each.effect.name}.{key}": value for key, value in each.shape}
        if model.yield_m is not None:
            found[f"{PRESLIDING}.yield_m"] = model.yield_m
            found[f"{PRESLIDING}.stiffness_n_per_m"] = float(np.mean(self._level_n(model, values))) / model.yield_m
        return found

    def _own(self, model: ForceModel, values: Mapping[str, float], fitted: dict[str, float]) -> dict[str, float]:
        """Return coefficients, or their deviations, as the effects' own: shares of F_c, where that is what they are."""
        scaled = {each.name for each in model.terms if each.scales}
        return {name: _share(value, values["coulomb_n"]) if name in scaled else value for name, value in fitted.items()}

    def _range_violation(
        self, columns: list[_Column], reduced: Mapping[int, Matrix], trained: Sequence[int], least: Column
    ) -> str:
        """Say which of the added coefficients the rows want below its range, by several of its own deviations."""
        free = np.full(least.size, -np.inf)
        wanted = _solve([reduced[k] for k in trained], free)
        draws = [_solve([reduced[j] for j in trained if j != k], free) for k in trained] if len(trained) > 2 else []
        deviations = _jackknife(draws)
        for i, each in enumerate(columns):
            spread = 0.0 if deviations is None else float(deviations[i])
            if each.added and wanted[i] < each.least - OUTSIDE_STANDARD_ERRORS * spread:
                return f"not physical: the rows want {each.name} below {each.least:g}, the end of its range"
        return ""

    def _negative_friction(self, model: ForceModel, values: Mapping[str, float]) -> str:
        """Say if friction comes out negative somewhere; empty if not."""
        level = self._level_n(model, values)
        least_n = float(level.min())
        return f"not physical: friction would fall to {least_n:.3g} N" if least_n < -1e-9 * level.max() else ""

    def candidates(self, before: ForceModel, name: str) -> list[ForceModel]:
        """Return the models that add an effect, one a value of its shape."""
        if name == PRESLIDING:
            travel_m = float(np.ptp(self.rows.position_m))
            return [replace(before, yield_m=share * travel_m) for share in YIELDS]
        return [replace(before, terms=(*before.terms, each)) for each in self._terms(self.library[name])]


def _trial_parameters(effect: Effect) -> list[str]:
    """Return the parameters of an effect's law that are chosen by trials."""
    return [key for key, each in effect.parameters.items() if key in SHAPES and len(each.starts) > 1]


def _products(shapes: Mapping[str, tuple[float, ...]]) -> list[tuple[tuple[str, float], ...]]:
    return [tuple(zip(shapes, values, strict=True)) for values in product(*shapes.values())]


def _outside(model: ForceModel, values: Mapping[str, float]) -> str:
    """Say which strength lies outside the range that its effect declares; empty if none."""
    for each in model.terms:
        declared, value = each.effect.parameters[each.strength], values[each.name]
        if not declared.least <= value <= declared.most:
            return f"not physical: {each.name} = {value:.4g}, allowed are {declared.least:g} to {declared.most:g}"
    return ""


def _folds(rows: Rows, *, tested: bool) -> NDArray[np.int64]:
    """Number what is left out together: the tested recording; each of several; fifths of one; each reading."""
    several = int(rows.recording.max())
    if tested:
        return np.where(rows.recording == several, 1, 0)
    if rows.velocity_m_per_s is None:
        return np.arange(len(rows))
    return rows.recording if several else np.floor_divide(np.arange(len(rows)) * FIFTHS, len(rows))


def _yielding(rows: Rows, yield_m: float) -> Column:
    """Return z of a packing that yields over a distance; each recording begins slipping."""
    steps = (np.diff(rows.position_m, prepend=rows.position_m[:1]) / yield_m).tolist()
    begins = (np.diff(rows.recording, prepend=-1) != 0).tolist()
    z, here = [], 0.0
    for step, begin, direction in zip(steps, begins, rows.direction.tolist(), strict=True):
        here = direction if begin else here + step
        if here > 1.0:
            here = 1.0
        elif here < -1.0:
            here = -1.0
        z.append(here)
    return np.array(z, dtype=np.float64)


def _reduce(X: Matrix, y: Column) -> Matrix:
    """Return the triangle that holds all a least-squares problem knows of its rows."""
    return np.asarray(np.linalg.qr(np.column_stack([X, y]), mode="r"))


def _solve(reduced: Sequence[Matrix], least: Column) -> Column:
    whole = np.vstack(reduced)
    found = np.linalg.lstsq(whole[:, :-1], whole[:, -1])[0]
    if np.all(found >= least):
        return np.asarray(found)
    return np.asarray(lsq_linear(whole[:, :-1], whole[:, -1], bounds=(least, np.inf), method="bvls").x)


def _jackknife(others: Sequence[Column]) -> Column | None:
    """Return the standard deviations that fits with one part left out each show; None of fewer than three."""
    if len(others) < 3:
        return None
    spread = np.array(others) - np.mean(others, axis=0)
    return np.asarray(np.sqrt((len(others) - 1) / len(others) * np.sum(spread**2, axis=0)))


def _stroke_logs(stroke: NDArray[np.int64], error_n: Column) -> Column:
    _, block = np.unique(stroke, return_inverse=True)
    squares = np.bincount(block, error_n**2) / np.bincount(block)
    return np.asarray(0.5 * np.log(squares + np.finfo(float).tiny))


def balanced_n(rows: Rows, valve: ValveParameters) -> Column:
    """Return the force that is balanced, N, (rows,): the load of a bench, A p of a static curve."""
    return valve.diaphragm_area_m2 * rows.pressure_pa if rows.load_n is None else rows.load_n


def carried_n(rows: Rows, parameters: Mapping[str, float]) -> Column:
    """Return k_s x + F_0, less A p on a bench, N, (rows,): the balanced force without friction."""
    force_n = parameters["spring_n_per_m"] * rows.position_m + parameters["constant_n"]
    return force_n if rows.load_n is None else force_n - parameters["diaphragm_area_m2"] * rows.pressure_pa


def floor_of(rows: Rows, residual_n: Column) -> float | None:
    """Return the scatter, N, of a residual, N, (rows,), at the same place, way and recording.

    None where no place is passed by more than one stroke.
    """
    if rows.velocity_m_per_s is None:
        return None
    span_m = max(float(np.ptp(rows.position_m)), np.finfo(float).tiny)
    place = np.minimum((rows.position_m - rows.position_m.min()) / span_m * PLACES, PLACES - 1).astype(np.int64)
    cell = (rows.recording * 2 + (rows.direction > 0)) * PLACES + place
    visited = np.unique(np.column_stack([cell, rows.stroke]), axis=0)[:, 0]
    cells, member, count = np.unique(cell, return_inverse=True, return_counts=True)
    strokes = np.bincount(np.searchsorted(cells, visited), minlength=cells.size)
    mean = np.bincount(member, residual_n) / count
    kept = (strokes > 1)[member]
    return median_error_n((residual_n - mean[member])[kept]) if kept.any() else None


def median_error_n(error_n: Column) -> float:
    """Return the median of |error|, (n,), as a standard deviation, N."""
    return float(NORMAL * np.median(np.abs(error_n)))


def _share(value: float, of: float) -> float:
    """Return a share; of next to nothing as many times it as says that it is beyond every share."""
    if abs(value) > MOST_SHARES * of:
        return float(np.copysign(MOST_SHARES, value))
    return value / of if of else 0.0
