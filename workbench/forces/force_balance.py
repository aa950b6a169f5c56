"""The balance of forces under an imposed position, or along a static curve, and its fit. No simulation is needed.

    load = -A p + k_s x + F_v v + F_c z + F_0 + terms      a bench: A, k_s, F_v, F_c, F_0 fitted
    A p  =        k_s x         + F_c z + F_0 + terms      a static curve: A given, k_s, F_c, F_0 fitted

z is the direction of motion, +1 or -1, until presliding is added. The terms, each with the name of the effect whose
force or friction it is:

    pressure_friction    mu max(p, 0) z            mu >= 0, N/Pa
    pressure_power_friction
                         F_1 (max(p, 0) / p_1)^n z F_1 >= 0, N, at p_1 = 100 kPa; n from 0.3 to 3
    position_friction    g F_c s z                 s = x / L within 0 and 1, L the stroke; friction stays >= 0
    friction_drift       r F_c t z                 t from the recording's start, s
    stribeck             F_x exp(-(v / v_x)^2) z   F_x >= 0, N; v_x from those between 0.1 and 1 of the median speed
    quadratic_drag       c v |v|                   c >= 0
    asymmetric_viscosity c |v| / 2                 c of either sign, of which F_v takes half: |c| / 2 <= F_v
    spring_hardening     k_3 x^3                   k_3 >= 0
    area_variation       -dA s p                   dA of either sign
    presliding           z' = 1 / x_f within -1 <= z <= 1: the packing yields over x_f = F_c / k_p before it slips

A constant force is in the balance as F_0: preload, sensor_offset and asymmetric_friction are one with it here. Effects
of the pressure path, of break-away and of the sensor's dynamics leave no trace in a balance of moving rows.

Each fit is linear least squares within the physical ranges. Of several recordings, each is predicted from the others:
a pressure or a seal never fitted on. One recording is predicted by fifths, a static curve reading by reading.

    floor      scatter of what is left at the same place, the same way, in the same recording, over several strokes:
               what no such balance explains; a static curve has none, as it passes each place once
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from config.recording import Column
from config.results.result import Brief
from config.valve_file import ValveParameters
from sim.effect import shipped_effect
from sim.effects.pressure_power_friction import P_1_PA
from workbench.data.imposed_motion import Rows

FIFTHS = 5
YIELDS = (5e-4, 1e-3, 2e-3, 4e-3, 8e-3, 16e-3)
"""Of the travel: over how much of it the packing may yield."""
SPEEDS = (0.1, 0.3, 1.0)
"""Of the median speed."""
EXPONENTS = (0.3, 0.5, 0.7, 1.5, 2.0, 3.0)
"""Of the pressure."""
PLACES = 40
"""Cells of the travel in which a residual's scatter is taken."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
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
class ForceModel:
    """Which terms a balance has beyond the bare one, and the values of their shapes."""

    terms: tuple[str, ...] = ()
    yield_m: float | None = None
    speed_m_per_s: float | None = None
    exponent: float | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects' names, those with a shape last."""
        return self.terms if self.yield_m is None else (*self.terms, "presliding")


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the balance: its coefficient's name, range, and values."""

    name: str
    least: float
    values: Column


Term = Callable[["Balance", Column, ForceModel], Column]


def _pressed(rows: Rows, exponent: float) -> Column:
    return np.asarray((np.maximum(rows.pressure_pa, 0.0) / P_1_PA) ** exponent)


def _share(balance: "Balance") -> Column:
    return np.clip(balance.rows.position_m / balance.valve.stroke_m, 0.0, 1.0)


TERMS: Mapping[str, tuple[str, float, Term]] = {
    "pressure_friction": ("growth_n_per_pa", 0.0, lambda b, z, _: np.maximum(b.rows.pressure_pa, 0.0) * z),
    "pressure_power_friction": ("growth_n", 0.0, lambda b, z, m: _pressed(b.rows, m.exponent or 1.0) * z),
    "position_friction": ("growth_n", -np.inf, lambda b, z, _: _share(b) * z),
    "friction_drift": ("rate_n_per_s", -np.inf, lambda b, z, _: b.time_s * z),
    "stribeck": ("excess_n", 0.0, lambda b, z, m: z * np.exp(-((b.velocity / (m.speed_m_per_s or np.inf)) ** 2))),
    "quadratic_drag": ("drag_ns2_per_m2", 0.0, lambda b, _z, _m: b.velocity * np.abs(b.velocity)),
    "asymmetric_viscosity": ("extra_ns_per_m", -np.inf, lambda b, _z, _m: 0.5 * np.abs(b.velocity)),
    "spring_hardening": ("cubic_n_per_m3", 0.0, lambda b, _z, _m: b.rows.position_m**3),
    "area_variation": ("change_m2", -np.inf, lambda b, _z, _m: -_share(b) * b.rows.pressure_pa),
}
FRICTION = ("pressure_friction", "pressure_power_friction", "position_friction", "friction_drift", "stribeck")
PRESSED = ("pressure_friction", "pressure_power_friction")
RELATIVE = {
    "position_friction.growth": "position_friction.growth_n",
    "friction_drift.rate_per_s": "friction_drift.rate_n_per_s",
}
"""Parameters that an effect has as shares of F_c, and what is fitted in their place."""
NEEDS_MOTION = ("friction_drift", "stribeck", "quadratic_drag", "asymmetric_viscosity", "presliding")


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

    @property
    def time_s(self) -> Column:
        """Time since the recording's start, s, (rows,)."""
        return self.rows.position_m * 0.0 if self.rows.time_s is None else self.rows.time_s

    @property
    def velocity(self) -> Column:
        """Velocity, m/s, (rows,); 0 in a static curve."""
        return self.rows.position_m * 0.0 if self.rows.velocity_m_per_s is None else self.rows.velocity_m_per_s

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that rows like these can show."""
        names = (*TERMS, "presliding")
        return names if self.rows.velocity_m_per_s is not None else tuple(n for n in names if n not in NEEDS_MOTION)

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
            base.append(_Column("viscous_ns_per_m", 0.0, rows.velocity_m_per_s))
        if rows.load_n is not None:
            base.append(_Column("diaphragm_area_m2", 0.0, -rows.pressure_pa))
        return [*base, *(_Column(f"{n}.{TERMS[n][0]}", TERMS[n][1], TERMS[n][2](self, z, model)) for n in model.terms)]

    def fitted(self, model: ForceModel, *, bounded: bool = True) -> ForceFit:
        """Fit a model to all that is fitted, and predict each part from the others."""
        columns, y = self.columns(model), balanced_n(self.rows, self.valve)
        X = np.column_stack([each.values for each in columns])
        scale = np.maximum(np.abs(X).max(axis=0), np.finfo(float).tiny)
        least = np.array([each.least if bounded else -np.inf for each in columns])
        reduced = {k: _reduced(X[self.fold == k] / scale, y[self.fold == k]) for k in range(int(self.fold.max()) + 1)}
        trained = [k for k in reduced if k not in self.held_out or len(self.held_out) == len(reduced)]
        theta = _solved([reduced[k] for k in trained], least) / scale
        others = {k: _solved([reduced[j] for j in reduced if j != k], least) / scale for k in self.held_out}
        residual_n, predicted_n = y - X @ theta, np.full(y.size, np.nan)
        for k, other in others.items():
            predicted_n[self.fold == k] = (y - X @ other)[self.fold == k]
        predicted = np.isfinite(predicted_n)
        train_n = _rms(residual_n[np.isin(self.fold, trained)])
        values = dict(zip([each.name for each in columns], theta.tolist(), strict=True))
        whole = values | self._shapes(model, values)
        violations = (
            self._range_violation(columns, reduced, trained, least),
            self._negative_friction(model, values),
            _negative_viscosity(values),
            _outside(whole),
        )
        deviations = _jackknife(list(others.values()))
        n = int(np.isin(self.fold, trained).sum())
        shapes = (model.yield_m, model.speed_m_per_s, model.exponent)
        free = len(columns) + sum(each is not None for each in shapes)
        return ForceFit(
            model.effects,
            whole,
            {} if deviations is None else dict(zip(values, deviations.tolist(), strict=True)),
            train_n,
            _rms(predicted_n[predicted]),
            _stroke_logs(self.rows.stroke[predicted], predicted_n[predicted]),
            np.where(predicted, predicted_n, residual_n),
            n * 2.0 * float(np.log(max(train_n, 1e-12))) + free * float(np.log(n)),
            next(filter(None, violations), "") if bounded else "",
        )

    def _shapes(self, model: ForceModel, values: Mapping[str, float]) -> dict[str, float]:
        shapes = {}
        if model.yield_m is not None:
            up = np.ones(len(self.rows))
            terms = [(TERMS[name], values[f"{name}.{TERMS[name][0]}"]) for name in model.terms if name in PRESSED]
            pressed = sum(float(np.mean(growth * term(self, up, model))) for (_, _, term), growth in terms)
            shapes["presliding.yield_m"] = model.yield_m
            shapes["presliding.stiffness_n_per_m"] = (values["coulomb_n"] + pressed) / model.yield_m
        if model.exponent is not None:
            shapes["pressure_power_friction.exponent"] = model.exponent
        if model.speed_m_per_s is not None:
            shapes["stribeck.velocity_m_per_s"] = model.speed_m_per_s
        for relative, absolute in RELATIVE.items():
            if values.get(absolute):
                # Without any F_c a growth is beyond every share of it.
                infinite = float(np.copysign(np.inf, values[absolute]))
                shapes[relative] = values[absolute] / values["coulomb_n"] if values["coulomb_n"] else infinite
        return shapes

    def _range_violation(
        self, columns: list[_Column], reduced: Mapping[int, Matrix], trained: Sequence[int], least: Column
    ) -> str:
        """Say which of the added coefficients the rows want below its range, by several of its own deviations."""
        free = np.full(least.size, -np.inf)
        wanted = _solved([reduced[k] for k in trained], free)
        draws = [_solved([reduced[j] for j in trained if j != k], free) for k in trained] if len(trained) > 2 else []
        deviations = _jackknife(draws)
        for i, each in enumerate(columns):
            spread = 0.0 if deviations is None else float(deviations[i])
            if "." in each.name and wanted[i] < each.least - OUTSIDE_STANDARD_ERRORS * spread:
                return f"not physical: the rows want {each.name} below {each.least:g}, the end of its range"
        return ""

    def _negative_friction(self, model: ForceModel, values: Mapping[str, float]) -> str:
        """Say if friction comes out negative somewhere; empty if not."""
        up = np.ones(len(self.rows))
        level = values["coulomb_n"] * up
        for name in model.terms:
            key, _, term = TERMS[name]
            level = level + values[f"{name}.{key}"] * term(self, up, model) * (name in FRICTION)
        least_n = float(level.min())
        return f"not physical: friction would fall to {least_n:.3g} N" if least_n < -1e-9 * level.max() else ""

    def candidates(self, before: ForceModel, name: str) -> list[ForceModel]:
        """Return the models that add an effect, one a value of its shape."""
        travel_m = float(np.ptp(self.rows.position_m))
        if name == "presliding":
            return [replace(before, yield_m=share * travel_m) for share in YIELDS]
        extended = replace(before, terms=(*before.terms, name))
        if name == "pressure_power_friction":
            return [replace(extended, exponent=each) for each in EXPONENTS]
        if name != "stribeck":
            return [extended]
        middle = float(np.median(np.abs(self.velocity)))
        return [replace(extended, speed_m_per_s=share * middle) for share in SPEEDS]


def _negative_viscosity(values: Mapping[str, float]) -> str:
    """Say if viscous friction comes out negative one way; empty if not."""
    half = 0.5 * abs(values.get("asymmetric_viscosity.extra_ns_per_m", 0.0))
    least = values.get("viscous_ns_per_m", 0.0) - half
    return f"not physical: viscous friction would be {least:.3g} N s/m one way" if half and least < 0.0 else ""


def _outside(values: Mapping[str, float]) -> str:
    """Say which parameter lies outside the range that its effect declares; empty if none."""
    for name, value in values.items():
        effect, _, key = name.partition(".")
        declared = shipped_effect(effect, "effects").parameters.get(key) if key else None
        if declared and not declared.least <= value <= declared.most:
            return f"not physical: {name} = {value:.4g}, allowed are {declared.least:g} to {declared.most:g}"
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


def _rms(error_n: Column) -> float:
    return float(np.sqrt(np.mean(error_n**2)))


def _reduced(X: Matrix, y: Column) -> Matrix:
    """Return the triangle that holds all a least-squares problem knows of its rows."""
    return np.asarray(np.linalg.qr(np.column_stack([X, y]), mode="r"))


def _solved(reduced: Sequence[Matrix], least: Column) -> Column:
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
