"""What a fit comes to: a valve, its parameters with their intervals, the searches behind it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import log
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from config.arguments import kinds_held
from config.drive import Kind
from config.recording import Column, Recording
from config.results.block import Block
from config.results.result import Brief, Result
from config.valve_file import ValveFile
from signals.independence import independent_share
from sim.composition import STATIC, Composition
from sim.karnopp import Vector
from workbench.compare.comparison_sentences import shorten_notes
from workbench.compare.measures import fit_percent
from workbench.data.noise_floor import say_m
from workbench.data.record import Record, ready
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_thresholds import FIT
from workbench.fit.likelihood import Groups, Likelihood, Rows, cost_of, soft
from workbench.fit.minimiser import End
from workbench.fit.parameter_estimate import Fitted, draw_parameters, parameter_columns, parameter_table
from workbench.fit.uncertainty import Combination, Uncertainty, uncertainty
from workbench.model.free_run import FreeRun
from workbench.model.search_coordinates import Parameter
from workbench.model.simulation_regime import DYNAMIC, Sampling

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Term(NamedTuple):
    """What one kind of residual says: how many are independent, and their mean square, soft, at least the noise's."""

    independent: float
    mean_square: float


NO_TERM = Term(0.0, 1.0)
"""Of a kind without residuals."""


@dataclass(frozen=True, slots=True, repr=False)
class Terms(Brief):
    """The likelihood of a fit, kind by kind (`workbench.fit.likelihood`)."""

    motion: Term
    landings: Term
    rests: Term
    break_aways: Term
    moved: Term = NO_TERM
    """How far the parameters had to go from where another record has them, in deviations."""

    def nats_above(self, other: "Terms") -> float:
        """Return the log-likelihood of these less that of another fit's, each kind at the scale that it leaves."""
        pairs = zip(self.each, other.each, strict=True)
        return 0.5 * sum(min(a.independent, b.independent) * log(b.mean_square / a.mean_square) for a, b in pairs)

    @property
    def each(self) -> tuple[Term, ...]:
        """All of them."""
        return self.motion, self.landings, self.rests, self.break_aways, self.moved

    @property
    def events(self) -> float:
        """Landings and break-aways: the independent things that the parameters of a valve follow from."""
        return self.landings.independent + self.break_aways.independent


@dataclass(frozen=True, slots=True, repr=False)
class Known(Brief):
    """Free parameters, and R: R times what their coordinates are off is as unlikely as so many deviations."""

    parameters: tuple[Parameter, ...]
    root: Vector
    """(parameters, parameters)."""

    @property
    def deviations(self) -> Vector:
        """Of the coordinates, (parameters,)."""
        return np.asarray(np.sqrt(np.diag(np.linalg.pinv(self.root.T @ self.root))))

    @property
    def share_left(self) -> Vector:
        """What is left open of each coordinate's range, as a share: sqrt(2 pi) deviations, (parameters,)."""
        width = np.array([high - low for low, high in (each.bounds for each in self.parameters)])
        return np.asarray(np.minimum(1.0, np.sqrt(2.0 * np.pi) * self.deviations / width))


NOTHING = Known((), np.zeros((0, 0)))
"""Of a valve that was not fitted: nothing of it is free."""


@dataclass(frozen=True, slots=True, repr=False)
class Fit(Result):
    """A fitted valve, in the habits of scikit-learn: predict, score, and the attributes."""

    valve: ValveFile
    parameters: Mapping[str, Fitted]
    rms_m: float
    floor_m: float | None
    """The error that no model undercuts: noise, or repeatability where the command repeats itself; None: unknown."""
    cost: float
    """Soft-L1 cost of scale 5 of the residuals, in units of the noise; half their number where they are white."""
    count: int
    """Residuals."""
    terms: Terms = field(repr=False)
    moves: int
    """How often the stem moves in what was fitted."""
    agreement: int
    """From how many starts searches came to the best cost."""
    condition: float
    undetermined: tuple[Combination, ...]
    notes: tuple[str, ...]
    from_pressure: bool
    onsets_s: Vector = field(repr=False)
    """When each move begins, s."""
    load_n: float = field(repr=False)
    """To which a break-away tells static friction, N."""
    known: Known = field(repr=False)
    """What the record says of the coordinates of its parameters."""
    by: Sampling = DYNAMIC
    """How the recording was simulated."""
    eased: bool = False
    """Whether a stem that stops within a move was let go on at F_c (`sim.told`)."""

    @property
    def trusted(self) -> bool:
        """Whether searches from more than one start came to the same."""
        return self.agreement > 1

    @kinds_held
    def predict(self, recording: Recording) -> Column:
        """Return the indicated position of a free run, m; NaN in rows that are not simulated."""
        return self.indicated_m(ready(recording))

    @property
    def kind(self) -> Kind:
        """Whose it is: its names and units."""
        return self.valve.valve.own

    def indicated_m(self, record: Record) -> Column:
        """Return the same of a recording made ready.

        Raises:
            InputError: the model has no answer, as an effect of one's own may be without (`FreeRun.require_answer`).
        """
        run, theta = self._run_through(record)
        return run.require_answer(run.position_m(theta))

    def pressure_pa(self, record: Record) -> Column:
        """Return the actuator's pressure in a free run through a recording made ready, Pa; NaN as above."""
        run, theta = self._run_through(record)
        return run.run(theta).pressure_pa

    def _run_through(self, record: Record) -> tuple[FreeRun, Vector]:
        composition = Composition.from_file(self.valve)
        by = self.by.of(record, self.valve.valve)
        return FreeRun(composition, record, from_pressure=self.from_pressure, by=by), composition.theta

    @kinds_held
    def score(self, recording: Recording) -> float:
        """Return 1 - ||measured - simulated|| / ||measured - mean||: 1 is perfect, below 0 worse than the mean."""
        record = ready(recording)
        return fit_percent(record, self.indicated_m(record)) / 100.0

    def blocks(self) -> list[Block]:
        """Say the error, whether the searches agree, and each parameter with its interval."""
        agreement = "searches agree" if self.trusted else "search came to this alone, or to nothing better: not trusted"
        return [
            f"error {self.kind.length.said(self.rms_m, '.4g')} rms, floor {say_m(self.floor_m, self.kind.length)}; "
            f"{self.agreement} {agreement}",
            parameter_table(self.parameters, self.kind),
            *([self.by.sentence] if self.by.sentence else []),
            *(f"recording: {note}" for note in shorten_notes(self.notes)),
        ]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a parameter: name, value, standard deviation, 95 % interval, at its bound, physical."""
        return parameter_columns(self.parameters)

    def plot(self) -> "Figure":
        """Draw the parameters' 95 % intervals in per cent of their values."""
        return draw_parameters(self.parameters, self.kind)


def fit_at(problem: Problem, like: Likelihood, end: End, agreement: int) -> Fit:
    """Return the fit of where searches have ended, from so many starts; of a coarse one none agrees with another."""
    determined, record = uncertainty(like, end), problem.record
    end = _as_runs_freely(like, end, determined) if agreement else end
    theta = like.theta(end.z)
    error_m = like.off_m(like.path(theta, end.onsets_s), theta)
    return Fit(
        valve=like.composition.file(theta),
        parameters={each.name: _fitted(like, end, determined, i) for i, each in enumerate(like.parameters)},
        rms_m=float(np.sqrt(np.nanmean(np.where(record.valid, error_m, np.nan) ** 2))),
        floor_m=record.floor_m,
        cost=end.cost,
        count=like.count,
        terms=terms_of_all(like, end.groups),
        moves=len(problem.told),
        agreement=agreement,
        condition=determined.condition,
        undetermined=determined.undetermined,
        notes=record.notes,
        from_pressure=problem.from_pressure,
        onsets_s=end.onsets_s,
        load_n=problem.load_n,
        known=Known(like.parameters, determined.root),
        by=problem.by,
        eased=like.is_eased,
    )


def _as_runs_freely(like: Likelihood, end: End, determined: Uncertainty) -> End:
    """Return an end at the static friction, of those that break-aways leave open, with which a free run does best.

    Seen seldom, or behind a positioner, a free run soon goes its own way: there it is asked where nothing breaks loose.
    """
    rows = [i for i, each in enumerate(like.parameters) if each.index == STATIC]
    goes_its_own_way = like.by.slow or like.record.by_setpoint
    if not rows or (goes_its_own_way and like.broken.size):
        return end
    (i,) = rows
    low, high = like.parameters[i].bounds
    open_ = np.linspace(max(low, determined.lower[i]), min(high, determined.upper[i]), FIT.intervals.static_values)
    run = FreeRun(like.composition, like.record, from_pressure=like.from_pressure, by=like.by)
    seen_m = np.where(like.record.valid, like.record.position_m, np.nan)

    def placed(value: np.float64) -> Vector:
        z = end.z.copy()
        z[i] = value
        return z

    def cost(z: Vector) -> float:
        return cost_of(like.at(like.theta(z), end.onsets_s).whole)

    trials = [end.z, *(each for each in map(placed, open_) if cost(each) <= end.cost + FIT.intervals.rise_nats)]
    errors = [np.nanmean((run.position_m(like.theta(z)) - seen_m) ** 2) for z in trials]
    best = trials[int(np.nanargmin(errors))] if np.isfinite(errors).any() else end.z
    groups = like.at(like.theta(best), end.onsets_s)
    return replace(end, z=best, groups=groups, cost=cost_of(groups.whole))


class Counted(NamedTuple):
    """Residuals that are counted: of all moves or of some, the rest that each block is of, how many moves."""

    groups: Groups
    rest_of: Rows
    moves: int


def terms(counted: Counted, moved: Vector | None = None) -> Terms:
    """Return what the residuals say, kind by kind; and how far the parameters had to go for them, in deviations.

    Samples in motion that hang together count for fewer, a move for one witness at the least; landings and break-aways
    are as many as they are. A rest is one witness, however long: one that a model gets wrong is one event.
    """
    motion, landings, rests, break_aways = counted.groups
    return Terms(
        _term(motion, max(independent_share(motion) * motion.size, counted.moves)),
        _term(landings, landings.size),
        _term_of_rests(rests, counted.rest_of),
        _term(break_aways, break_aways.size),
        NO_TERM if moved is None else _term(moved, moved.size),
    )


def terms_of_all(like: Likelihood, groups: Groups) -> Terms:
    """Return what all residuals of a likelihood say."""
    return terms(Counted(groups, like.layout.rest_of, len(like.moves)))


def _term(r: Vector, independent: float) -> Term:
    return Term(independent, max(1.0, 2.0 * float(soft(r).mean()))) if r.size else NO_TERM


def _term_of_rests(r: Vector, rest_of: Rows) -> Term:
    """Return the term of rests: the geometric mean of the mean squares of each."""
    if not r.size:
        return NO_TERM
    _, of = np.unique(rest_of, return_inverse=True)
    squares = np.bincount(of, 2.0 * soft(r)) / np.bincount(of)
    return Term(float(squares.size), float(np.exp(np.mean(np.log(np.maximum(squares, 1.0))))))


def _fitted(like: Likelihood, end: End, determined: Uncertainty, i: int) -> Fitted:
    parameter, z = like.parameters[i], end.z

    def value(coordinate: float) -> float:
        there = z.copy()
        there[i] = coordinate
        return float(like.theta(there)[parameter.index])

    low, high = parameter.bounds
    near = FIT.intervals.bound_of_range * (high - low)
    at_low, at_high = bool(z[i] < low + near), bool(z[i] > high - near)
    outward = -determined.off[i] if at_low else determined.off[i] if at_high else 0.0
    by_z = (value(z[i] + 1e-6) - value(z[i] - 1e-6)) / 2e-6
    lower = value(max(low, float(determined.lower[i]))) if np.isfinite(determined.lower[i]) else -np.inf
    upper = value(min(high, float(determined.upper[i]))) if np.isfinite(determined.upper[i]) else np.inf
    return Fitted(
        value(z[i]),
        abs(by_z) * float(determined.std[i]),
        lower,
        upper,
        at_low or at_high,
        bool(outward <= FIT.intervals.out_deviations),
    )
