"""Causes held against each other by the likelihood of PV, each told the output that is on record.

    friction        PV answers a stem that rests and slips (stem_landings)
    linear          PV answers the output itself: tight tuning, or a disturbance that a valve without fault corrects
    nonlinear       PV answers a curve of the output that rises throughout, u, u^2 and u^3: a characteristic
    disturbance     PV answers nothing: all of it comes from outside

The evidence for friction is what it is better by than the best of the others, in nats. A gain of PV against the
controller's action is refused: it would be the controller's own law read backwards, PV told from the OP that it made.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from workbench.loops.loop_record import Array, LoopRecord
from workbench.loops.oscillation import Oscillation
from workbench.loops.process_response import (
    Response,
    Scale,
    averaged,
    disturbance_alone,
    fit_responses,
    refine_responses,
    respond,
    shaped_cost,
)
from workbench.loops.stem_landings import rest_positions
from workbench.loops.thresholds import LIMITS

SHARES = (0.05, 0.1, 0.17, 0.25, 0.34, 0.44, 0.55, 0.66, 0.77, 0.87, 0.95)
"""Apparent stiction that is tried, of the output's span: beyond the span the stem never moves."""
JUMPS = (0.0, 0.5, 1.0)
"""Slip jump that is tried, of the apparent stiction."""
NEARER = ((0.12, 0.25), (0.05, 0.12), (0.02, 0.05))
"""Steps of S, of itself, and of J, of S, about the best, one round after the other: slips make the cost rough."""
ABOUT = (-2.0, -1.0, 0.0, 1.0, 2.0)
LEAST_MOTION = 0.1
"""Of the output's standard deviation: a stem that moves less explains no PV."""


@dataclass(frozen=True, slots=True)
class Friction:
    """The stem that explains PV best.

    Attributes:
        stiction_pct, low_pct, high_pct: apparent stiction S and its 95 % interval, % of the output.
        slip_jump_pct: J, likewise.
        slides_on: whether the stem follows after a slip until the output turns.
        share: of the output's span that S is.
        response: of the process, lag and delay in rows; its gain in standard deviations of PV a one of OP.
    """

    stiction_pct: float
    low_pct: float
    high_pct: float
    slip_jump_pct: float
    slides_on: bool
    share: float
    response: Response


@dataclass(frozen=True, slots=True)
class Causes:
    """Costs by cause, nats, less is better; what is best of friction; how the rows were made."""

    costs: dict[str, float]
    friction: Friction | None
    linear: Response
    scale: Scale
    lag_s: float
    delay_s: float
    gain: float

    @property
    def evidence(self) -> float:
        """What friction is better by than the best of the others, nats."""
        return min(cost for name, cost in self.costs.items() if name != "friction") - self.costs["friction"]

    @property
    def share(self) -> float:
        """What friction alone explains, of all that the output explains of PV with it, 0 to 1."""
        return min(1.0, max(0.0, self.evidence) / self.explained) if self.explained > 0.0 else 0.0

    @property
    def explained(self) -> float:
        """What friction explains beyond the disturbance alone, nats; 0 where no stem is allowed."""
        return max(0.0, self.costs["disturbance"] - self.costs["friction"]) if self.friction else 0.0


@dataclass(frozen=True, slots=True)
class Rows:
    """Output in rows of the stem, (m,), PV in rows of the comparison, (n,), both of unit variance."""

    output: Array
    pv: Array
    output_pct: float
    pv_unit: float
    period_s: float
    scale: Scale


def rows_of(record: LoopRecord, oscillation: Oscillation) -> Rows:
    """Return a record in the rows in which causes are compared; of a long one the middle."""
    cycle = oscillation.period_s / record.period_s
    first = max(1, int(cycle / LIMITS.stem_rows_a_cycle))
    coarse = max(1, int(cycle / first / LIMITS.rows_a_cycle))
    most = LIMITS.most_rows * coarse * first
    begin = max(0, (record.pv.size - most) // 2)
    output = averaged(record.op_pct[begin : begin + most], first)
    pv = averaged(record.pv[begin : begin + most], first)
    output_pct, pv_unit = max(float(output.std()), 1e-12), max(float(pv.std()), 1e-12)
    return Rows(
        (output - output.mean()) / output_pct,
        averaged((pv - pv.mean()) / pv_unit, coarse),
        output_pct,
        pv_unit,
        first * record.period_s,
        Scale(cycle / first, coarse),
    )


def hold_causes(record: LoopRecord, oscillation: Oscillation, action: int) -> Causes:
    """Return the causes of what a loop does; `action` is the sign that the process's gain must have, 0 if unknown."""
    rows = rows_of(record, oscillation)
    scale, pv, output = rows.scale, rows.pv, rows.output
    (linear,) = fit_responses(output[:, None], pv, scale, action)
    (linear,) = refine_responses(output[:, None], pv, scale, action, linear)
    friction = _friction(rows, action)
    responses = [linear] + ([friction.response] if friction else [])
    curved = np.stack([output, output**2, output**3], axis=1)
    span = np.linspace(float(output.min()), float(output.max()), 50)

    def rises(weights: Array) -> bool:
        return float(weights.sum()) * action >= 0.0

    def is_characteristic(weights: Array) -> bool:
        slope = weights[0] + 2.0 * weights[1] * span + 3.0 * weights[2] * span**2
        return bool((slope * (action or np.sign(slope.mean())) >= 0.0).all())

    costs = {
        "friction": friction.response.cost if friction else np.inf,
        "linear": min(linear.cost, *(shaped_cost(_paths(output, scale, each), pv, rises) for each in responses)),
        "nonlinear": min(
            shaped_cost(respond(curved, scale, each.lag, each.delay), pv, is_characteristic) for each in responses
        ),
        "disturbance": disturbance_alone(pv),
    }
    best = friction.response if friction and costs["friction"] < costs["linear"] else linear
    return Causes(
        costs,
        friction,
        linear,
        scale,
        best.lag * scale.coarse * rows.period_s,
        best.delay * rows.period_s,
        best.gain * rows.pv_unit / rows.output_pct,
    )


@dataclass(frozen=True, slots=True)
class FittedPath:
    """Stem and PV as friction has them, beside the record, in rows of the comparison, (n,) each."""

    time_s: Array
    output_pct: Array
    stem_pct: Array
    pv: Array
    pv_fitted: Array


def fitted_path(record: LoopRecord, oscillation: Oscillation, friction: Friction) -> FittedPath:
    """Return what friction makes of a record's output."""
    rows = rows_of(record, oscillation)
    pct, every = rows.output_pct, rows.scale.coarse
    stem = rest_positions(
        rows.output,
        np.array([friction.stiction_pct / pct]),
        np.array([friction.slip_jump_pct / pct]),
        np.array([friction.slides_on]),
    )[:, 0]
    told = respond(stem, rows.scale, friction.response.lag, friction.response.delay)
    weights = np.polyfit(told, rows.pv, 1)
    time_s = np.asarray(rows.period_s * every * (np.arange(rows.pv.size) + 0.5), np.float64)
    middle = float(record.op_pct.mean())
    return FittedPath(
        time_s,
        middle + pct * averaged(rows.output, every),
        middle + pct * averaged(stem, every),
        record.pv.mean() + rows.pv_unit * rows.pv,
        record.pv.mean() + rows.pv_unit * np.polyval(weights, told),
    )


def _paths(output: Array, scale: Scale, response: Response) -> Array:
    """Return the response to the output, (n, 3), and the same a tenth and a fifth of a cycle later.

    Their sum has any phase: no stem is preferred because a process has two lags, or the grid misses its own.
    """
    delays = [response.delay + each * scale.cycle for each in (0.0, 0.1, 0.2)]
    return np.stack([respond(output, scale, response.lag, each) for each in delays], axis=1)


@dataclass(frozen=True, slots=True)
class _Trials:
    """Stems that were tried, g of them: S and J in the unit of the rows, the manner, and the response."""

    stiction: Array
    ratio: Array
    slides_on: npt.NDArray[np.bool_]
    responses: list[Response]

    @property
    def costs(self) -> Array:
        return np.array([each.cost for each in self.responses])


def _friction(rows: Rows, action: int) -> Friction | None:
    span = float(np.ptp(rows.output))
    sizes, ratios, manners = (
        each.ravel() for each in np.meshgrid(span * np.array(SHARES), JUMPS, [False, True], indexing="ij")
    )
    trials = _try(rows, sizes, ratios, manners, action, None)
    tried, best = [trials], []
    for manner in (False, True):
        of_manner = np.where(trials.slides_on == manner, trials.costs, np.inf)
        at = int(np.argmin(of_manner))
        if np.isfinite(of_manner[at]):
            best.append((manner, *_refined(rows, trials, at, span, action, tried)))
    if not best:
        return None
    manner, size, ratio, response = min(best, key=lambda each: each[3].cost)
    low, high = _interval(
        np.concatenate([each.stiction for each in tried]), np.concatenate([each.costs for each in tried]), size
    )
    pct = rows.output_pct
    return Friction(size * pct, low * pct, high * pct, size * ratio * pct, manner, min(1.0, size / span), response)


def _refined(
    rows: Rows, trials: _Trials, at: int, span: float, action: int, tried: list[_Trials]
) -> tuple[float, float, Response]:
    """Return S, J of S and the response of the best stem about one; adds to those that were tried."""
    size, ratio, response = float(trials.stiction[at]), float(trials.ratio[at]), trials.responses[at]
    for step, jump_step in NEARER:
        sizes, ratios = (
            each.ravel()
            for each in np.meshgrid(
                np.minimum(size * np.exp(step * np.array(ABOUT)), 0.98 * span),
                np.unique(np.clip(ratio + jump_step * np.array(ABOUT[1:-1]), 0.0, 1.0)),
                indexing="ij",
            )
        )
        manners = np.full(sizes.size, bool(trials.slides_on[at]))
        near = _try(rows, sizes, ratios, manners, action, response)
        tried.append(near)
        best = int(np.argmin(near.costs))
        if near.costs[best] < response.cost:
            size, ratio, response = float(sizes[best]), float(ratios[best]), near.responses[best]
    return size, ratio, response


def _try(
    rows: Rows, sizes: Array, ratios: Array, manners: npt.NDArray[np.bool_], action: int, about: Response | None
) -> _Trials:
    """Return stems with their responses; lag and delay of all that may be, or about those of a response."""
    stems = rest_positions(rows.output, sizes, sizes * ratios, manners)
    stems[:, stems.std(axis=0) < LEAST_MOTION] = 0.0
    if about is None:
        responses = fit_responses(stems, rows.pv, rows.scale, action)
    else:
        responses = refine_responses(stems, rows.pv, rows.scale, action, about)
    return _Trials(sizes, ratios, manners, responses)


def _interval(sizes: Array, costs: Array, best: float) -> tuple[float, float]:
    """Return between which sizes the likelihood is near its best, and no less than the calibrated factor about it."""
    inside = sizes[costs < costs.min() + LIMITS.interval_cost]
    factor = float(np.exp(LIMITS.least_interval))
    return min(float(inside.min()), best / factor), max(float(inside.max()), best * factor)
