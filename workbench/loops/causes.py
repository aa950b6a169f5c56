"""Causes held against each other by the likelihood of PV, each told the output that is on record.

This is the evidence. The verdict comes from it in `loop_diagnosis`, by the numbers of `loop_thresholds`.

    friction        PV answers a stem that rests and slips
    linear          PV answers the output itself: tight tuning, or a disturbance that a valve without fault corrects
    nonlinear       PV answers a curve of the output that rises throughout, u, u^2 and u^3: a characteristic
    disturbance     PV answers nothing: all of it comes from outside

The evidence for friction is the logarithm of its mean likelihood over all stems that would rule the loop, and all
processes, less that of the best other cause: what is tried more often fits better by chance, and a mean pays for it.
Friction that is small against the output's swing is none of these: where the record shows a valve that follows closely,
the evidence is therefore negative, and where it shows nothing, 0.

Where no PV is on record, it is what the PI law makes of the output backwards, for each of a few reset times.

The output is asked the same: the loop is closed, so stem, process and controller make of the output what the output is
later, with the sign of negative feedback. A controller integrates, and so shows a rest of the stem above its noise.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from workbench.loops.calibration import Evidence, Witness, mean_witness
from workbench.loops.loop_record import Array, LoopRecord, averaged
from workbench.loops.loop_thresholds import LIMITS
from workbench.loops.oscillation import Oscillation
from workbench.loops.stem_and_process import cost_of, costs_of_stems, respond, rest_positions

CAUSES_FORM = 4
"""To be raised when causes would come out differently: what was kept is then made anew."""
SHARES = (0.12, 0.17, 0.24, 0.33, 0.44, 0.55, 0.66, 0.77, 0.87, 0.95)
"""Apparent stiction that is tried, of the output's span: less does not rule a loop, beyond it the stem never moves."""
JUMPS = (0.0, 0.5, 1.0)
"""Slip jump that is tried, of the apparent stiction."""
LAGS = tuple((each, 0.0) for each in (0.0, 0.05, 0.12, 0.3, 0.8, 4.0))
DELAYS = (0.0, 0.05, 0.1, 0.17, 0.25)
"""In cycles of the loop; a quarter of a cycle of delay and a quarter of lag is all that a PI loop leaves a process."""
WAYS_ROUND = (*DELAYS[1:], 0.35, 0.5)
"""Delays once round the loop, likewise: none would tell the output by itself, and half a cycle turns its sign."""
NEGATIVE_FEEDBACK = -1
"""Sign with which the loop answers its own output."""
RESETS = (0.03, 0.1, 0.3, 1.0)
"""Reset times of the law read backwards, in cycles: with the shortest it integrates, with the longest hardly."""
LONGER, LATER = (0.7, 1.0, 1.4), (-0.025, 0.0, 0.025)
"""Factors of the lag, and cycles of delay, about the best."""
FIRST_LAG = 0.02
"""In cycles, with which one is tried where there was none."""
SECOND_LAG = 0.1
"""In cycles, the longest second lag; up to it as long as the first. Where stems are coarse the delay stands for it."""
STARTS = 8
"""Stems of the coarse trials from which the best is sought: slips make the cost rough."""
NEARER = ((0.12, 0.25), (0.05, 0.12), (0.02, 0.05))
"""Steps of S, of itself, and of J, of S, about the best, one round after the other."""
ABOUT = (-2.0, -1.0, 0.0, 1.0, 2.0)
MORE_WEIGHTS = 3.0
"""Nats that two more weights of a response cost, as a mean over what they may be would."""


@dataclass(frozen=True, slots=True)
class Process:
    """What a process makes of a stem: its cost, nats, less is better; lags and delay, rows of the stem; its gain."""

    cost: float
    lag: float
    second_lag: float
    delay: int
    gain: float


@dataclass(frozen=True, slots=True)
class Size:
    """Apparent stiction S and its 95 % interval, % of the output."""

    stiction_pct: float
    low_pct: float
    high_pct: float

    @classmethod
    def of(cls, stiction_pct: float, low_pct: float, high_pct: float) -> "Size":
        """Return S and what the likelihood leaves open of it, widened by what a model of a stem has wrong."""
        factor = 1.0 + LIMITS.size_within
        return cls(stiction_pct, low_pct / factor, high_pct * factor)

    @property
    def told(self) -> bool:
        """Whether the likelihood leaves open no more than S to `LIMITS.size_within`."""
        most = (1.0 + LIMITS.size_within) ** 2
        return max(self.stiction_pct / self.low_pct, self.high_pct / self.stiction_pct) <= most

    @property
    def said(self) -> str:
        """S and its interval, or where S is not told the interval, as people read them."""
        interval = f"{self.low_pct:.2g} to {self.high_pct:.2g}"
        return f"{self.stiction_pct:.2g} ({interval})" if self.told else interval


@dataclass(frozen=True, slots=True)
class Friction:
    """The stem that explains PV best.

    Attributes:
        size: S.
        slip_jump_pct: J, % of the output.
        slides_on: whether the stem follows after a slip until the output turns.
        process: what the process makes of it.
    """

    size: Size
    slip_jump_pct: float
    slides_on: bool
    process: Process


@dataclass(frozen=True, slots=True)
class Causes:
    """Causes held against each other.

    Attributes:
        costs: of each cause, nats, less is better.
        evidence: for friction against the best of the others.
        friction: the best of it.
        lag_s, delay_s, gain: of its process; what lags second counts as delay; the gain in PV a % of the output.
    """

    costs: dict[str, float]
    evidence: Evidence
    friction: Friction
    lag_s: float
    delay_s: float
    gain: float


@dataclass(frozen=True, slots=True)
class Rows:
    """Output in rows of the stem, (m,), PV in rows of the comparison, (n,), both of unit variance.

    Attributes:
        period_s: of a row of the stem.
        cycle: rows of the stem a cycle.
        coarse: of them to a row of the comparison.
    """

    output: Array
    pv: Array
    output_pct: float
    pv_unit: float
    period_s: float
    cycle: float
    coarse: int


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
        cycle / first,
        coarse,
    )


@dataclass(frozen=True, slots=True)
class _Trials:
    """Stems that were tried, g of them: S and J in the unit of the rows, manner; costs and gains, (g, l, d)."""

    stiction: Array
    slip_jump: Array
    slides_on: npt.NDArray[np.bool_]
    lags: Array
    delays: npt.NDArray[np.int64]
    costs: Array
    gains: Array

    @property
    def least(self) -> Array:
        """Cost of each stem with its best process, (g,)."""
        return np.asarray(self.costs.min(axis=(1, 2)))

    def process(self, stem: int) -> Process:
        """Return the best process of a stem."""
        lag, delay = (int(at) for at in np.unravel_index(int(np.argmin(self.costs[stem])), self.costs.shape[1:]))
        first, second = self.lags[lag].tolist()
        at = (stem, lag, delay)
        return Process(float(self.costs[at]), first, second, int(self.delays[delay]), float(self.gains[at]))

    def best(self) -> Process:
        """Return the best process of the best stem."""
        return self.process(int(np.argmin(self.least)))

    @property
    def mean_likelihood(self) -> float:
        """Logarithm of the mean likelihood, nats."""
        least = float(self.costs.min())
        return float(np.log(np.exp(least - self.costs).mean())) - least


def hold_causes(record: LoopRecord, oscillation: Oscillation, action: int) -> Causes:
    """Return the causes of what a loop does; `action` is the sign that the process's gain must have, 0 if unknown."""
    rows = rows_of(record, oscillation)
    held = _hold(rows, action, DELAYS)
    friction = _refined(rows, held, action)
    process = friction.process
    return Causes(
        held.costs,
        Evidence(held.witness, of_output(rows)),
        friction,
        process.lag * rows.period_s,
        (process.second_lag + process.delay) * rows.period_s,
        process.gain * rows.pv_unit / rows.output_pct,
    )


def of_output(rows: Rows) -> Witness:
    """Return what the output alone says of friction."""
    return _hold(replace(rows, pv=averaged(rows.output, rows.coarse)), NEGATIVE_FEEDBACK, WAYS_ROUND).witness


def of_output_backwards(rows: Rows) -> Witness:
    """Return what the output says of friction by the PV that a PI law would have made it of, up to sign and size.

    Of unknown reset times the mean is taken.
    """
    said = []
    for reset in RESETS:
        pv = averaged(respond(rows.output, 1, reset * rows.cycle, 0.0, 0) - rows.output, rows.coarse)
        said.append(_hold(replace(rows, pv=pv), -NEGATIVE_FEEDBACK, DELAYS).witness)
    return mean_witness(said)


@dataclass(frozen=True, slots=True)
class _Held:
    """Trials of the output itself and of stems, and the costs of a disturbance, of any phase, of a curve."""

    plain: _Trials
    trials: _Trials
    alone: float
    phases: float
    curve: float

    @property
    def costs(self) -> dict[str, float]:
        """Cost of each cause, nats: of the mean likelihood where many are tried, of more weights by what they cost."""
        return {
            "friction": -self.trials.mean_likelihood,
            "linear": min(-self.plain.mean_likelihood, self.phases + MORE_WEIGHTS),
            "nonlinear": self.curve + MORE_WEIGHTS,
            "disturbance": self.alone,
        }

    @property
    def witness(self) -> Witness:
        """What it says of friction."""
        friction, *others = self.costs.values()
        return Witness(min(others) - friction, max(0.0, self.alone - friction))


def _hold(rows: Rows, action: int, delays: Sequence[float]) -> _Held:
    none = np.zeros(1)
    processes = rows.cycle * np.array(LAGS), rows.cycle * np.array(delays)
    plain = _try(rows, none, none, none > 0.0, action, *processes)
    sizes, ratios, manners = _grid(np.ptp(rows.output) * np.array(SHARES), JUMPS, [False, True])
    trials = _try(rows, sizes, sizes * ratios, manners, action, *processes)
    best = [plain.best(), trials.best()]
    return _Held(
        plain,
        trials,
        cost_of(np.zeros((0, rows.pv.size)), rows.pv)[0],
        min(_of_phases(rows, each, action) for each in best),
        min(_of_curve(rows, each, action) for each in best),
    )


def _of_phases(rows: Rows, process: Process, action: int) -> float:
    """Return the cost of a sum of the response to the output and the same a tenth and a fifth of a cycle later.

    It has any phase: no stem is preferred because a process has two lags, or the grid misses its own.
    """
    later = (round(each * rows.cycle) for each in (0.0, 0.1, 0.2))
    shapes = np.stack([_response(rows, rows.output, process, each) for each in later])
    cost, weights = cost_of(shapes, rows.pv)
    return cost if weights.sum() * action >= 0.0 else np.inf


def _of_curve(rows: Rows, process: Process, action: int) -> float:
    """Return the cost of a characteristic that rises, or falls, throughout."""
    output = rows.output
    shapes = np.stack([_response(rows, output**each, process) for each in (1, 2, 3)])
    cost, weights = cost_of(shapes, rows.pv)
    span = np.linspace(float(output.min()), float(output.max()), 50)
    slope = weights[0] + 2.0 * weights[1] * span + 3.0 * weights[2] * span**2
    return cost if (slope * (action or np.sign(slope.mean())) >= 0.0).all() else np.inf


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
    pct, every = rows.output_pct, rows.coarse
    size, jump = friction.size.stiction_pct / pct, friction.slip_jump_pct / pct
    stem = rest_positions(rows.output, size, jump, friction.slides_on)
    told = _response(rows, stem, friction.process)
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


def _refined(rows: Rows, held: _Held, action: int) -> Friction:
    """Return the best stem, sought ever nearer from the best few; its interval in nats that count, as evidence."""
    trials = held.trials
    starts = np.argsort(trials.least)[:STARTS].tolist()
    tried = [trials, *(near for start in starts for near in _nearer(rows, trials, start, action))]
    best = min(tried, key=lambda each: float(each.least.min()))
    stem = int(np.argmin(best.least))
    size, jump, process = float(best.stiction[stem]), float(best.slip_jump[stem]), best.process(stem)
    most = process.cost + LIMITS.interval_cost * max(1.0, held.alone - process.cost) ** 0.5
    inside, pct = np.concatenate([t.stiction[t.least < most] for t in tried]), rows.output_pct
    sized = Size.of(size * pct, float(inside.min()) * pct, float(inside.max()) * pct)
    return Friction(sized, jump * pct, bool(best.slides_on[stem]), process)


def _nearer(rows: Rows, best: _Trials, stem: int, action: int) -> Iterator[_Trials]:
    """Yield trials ever nearer about the best of a stem."""
    for step, jump_step in NEARER:
        process, size, jump = best.process(stem), best.stiction[stem], best.slip_jump[stem]
        sizes, ratios = _grid(
            np.minimum(size * np.exp(step * np.array(ABOUT)), 0.98 * np.ptp(rows.output)),
            np.unique(np.clip(jump / size + jump_step * np.array(ABOUT[1:-1]), 0.0, 1.0)),
        )
        lags = _two_lags(np.array(LONGER) * (process.lag or FIRST_LAG * rows.cycle), rows.cycle)
        delays = process.delay + rows.cycle * np.array(LATER)
        near = _try(rows, sizes, sizes * ratios, np.full(sizes.size, best.slides_on[stem]), action, lags, delays)
        yield near
        if near.least.min() < process.cost:
            best, stem = near, int(np.argmin(near.least))


def _two_lags(lags: Array, cycle: float) -> Array:
    """Return lags, each alone and with a second one, (2 l, 2)."""
    return np.column_stack([np.tile(lags, 2), np.concatenate([0.0 * lags, np.minimum(lags, SECOND_LAG * cycle)])])


def _grid(*axes: npt.ArrayLike) -> list[Any]:
    """Return each with each of some axes' values, as columns."""
    return [each.ravel() for each in np.meshgrid(*axes, indexing="ij")]


def _response(rows: Rows, stem: Array, process: Process, later: int = 0) -> Array:
    return respond(stem, rows.coarse, process.lag, process.second_lag, process.delay + later)


def _try(
    rows: Rows, sizes: Array, jumps: Array, manners: npt.NDArray[np.bool_], action: int, lags: Array, delays: Array
) -> _Trials:
    """Return stems with each lag and delay, in rows of the stem."""
    whole = np.unique(np.maximum(np.round(delays), 0.0)).astype(np.int64)
    costs, gains = costs_of_stems(rows.output, rows.pv, rows.coarse, sizes, jumps, manners, lags, whole, action)
    return _Trials(sizes, jumps, manners, lags, whole, costs, gains)
