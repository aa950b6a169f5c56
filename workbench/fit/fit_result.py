"""What a fit comes to: a valve, its parameters with their intervals, the searches behind it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from config.arguments import kinds_held
from config.drive import Kind
from config.recording import Column, Recording
from config.results.block import Block
from config.results.result import Result
from config.valve_file import ValveFile
from sim.composition import STATIC, Composition
from sim.karnopp import Vector
from workbench.compare.comparison_sentences import shortened
from workbench.compare.measures import fit_percent
from workbench.data.noise_floor import told
from workbench.data.record import Record, ready
from workbench.fit.fitted_parameter import Fitted, draw_parameters, parameter_columns, parameter_table
from workbench.fit.objective import SimulationError
from workbench.fit.uncertainty import Combination, Uncertainty, uncertainty
from workbench.model.free_run import FreeRun
from workbench.model.sampling import DYNAMIC, Sampling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ELSEWHERE = 0.01
"""Of a log-parameter: searches that end nearer to each other have found the same place."""
FLAT = 0.5
"""Rise of the cost that is nothing: within it static friction is put in the middle."""
AT_BOUND = 1e-3
WANTS_OUT = 2.0
"""Slope of the cost at the bound times the deviation, in rises of 95 %: the least lies four deviations beyond it."""


@dataclass(frozen=True, slots=True)
class Search:
    """What one search came to."""

    cost: float
    rms_m: float
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True, repr=False)
class Fit(Result):
    """A fitted valve, in the habits of scikit-learn: predict, score, and the attributes."""

    valve: ValveFile
    parameters: Mapping[str, Fitted]
    rms_m: float
    floor_m: float | None
    """The error that no model undercuts: noise, or repeatability where the command repeats itself; None: unknown."""
    cost: float
    """Soft-L1 cost of scale 5, in units of the noise; half the number of samples for white residuals."""
    count: int
    """Valid samples."""
    starts: tuple[Search, ...]
    """The searches, best first."""
    agreement: int
    """From how many independent starts searches came to the best, in cost and in parameters (`agreement`); 1 where an
    added effect makes nothing better, or rounds more finely than the noise shows."""
    condition: float
    undetermined: tuple[Combination, ...]
    notes: tuple[str, ...]
    from_pressure: bool
    seeds: tuple[Vector, ...] = field(repr=False)
    """Parameter vectors at which an effect is added: the best search's, another's that ended elsewhere, the origins."""
    by: Sampling = DYNAMIC
    """How the recording was simulated."""

    @property
    def trusted(self) -> bool:
        """Whether searches from more than one independent start came to the same cost and parameters."""
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
            f"error {self.kind.length.said(self.rms_m, '.4g')} rms, floor {told(self.floor_m, self.kind.length)}; "
            f"{self.agreement} {agreement}",
            parameter_table(self.parameters, self.kind),
            *([self.by.sentence] if self.by.sentence else []),
            *(f"recording: {note}" for note in shortened(self.notes)),
        ]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a parameter: name, value, standard deviation, 95 % interval, at its bound, physical."""
        return parameter_columns(self.parameters)

    def plot(self) -> "Figure":
        """Draw the parameters' 95 % intervals in per cent of their values."""
        return draw_parameters(self.parameters, self.kind)


def fit_at(
    error: SimulationError, composition: Composition, ends: Sequence[Vector], agreement: int, *, profile: bool
) -> Fit:
    """Return the fit by what searches came to.

    Args:
        error: of the free run that was fitted.
        composition: the valve.
        ends: coordinates of where the searches stay, best first.
        agreement: from how many independent starts they came to the best.
        profile: follow the cost for the intervals; else they are those of the derivatives.
    """
    best = _centred(error, ends[0])
    determined = uncertainty(error, best, ends, profile=profile)
    return Fit(
        composition.file(error.theta(best)),
        {each.name: _fitted(error, best, determined, i) for i, each in enumerate(error.parameters)},
        error.rms_m(best),
        error.run.record.floor_m,
        error.cost(best),
        error.count,
        tuple(_search(error, z) for z in ends),
        agreement,
        determined.condition,
        determined.undetermined,
        error.run.record.notes,
        error.run.from_pressure,
        tuple(error.theta(z) for z in (best, *_elsewhere(ends))),
        error.run.by,
    )


def with_profile(found: Fit, error: SimulationError) -> Fit:
    """Return a fit with the intervals that following its cost gives; `error` is that of the run that was fitted."""
    z = error.coordinates(Composition.from_file(found.valve).theta)
    determined = uncertainty(error, z)
    parameters = {each.name: _fitted(error, z, determined, i) for i, each in enumerate(error.parameters)}
    return replace(found, parameters=parameters, condition=determined.condition, undetermined=determined.undetermined)


def _elsewhere(ends: Sequence[Vector]) -> list[Vector]:
    """Return the best search that came to another place than the best of all, if there is one."""
    away = [z for z in ends if np.max(np.abs(z - ends[0])) > ELSEWHERE]
    return away[:1]


def _centred(error: SimulationError, z: Vector) -> Vector:
    """Put static friction in the middle of the interval that gives the same slips."""
    at = [i for i, each in enumerate(error.parameters) if each.index == STATIC]
    if not at:
        return z
    limit = error.cost(z) + FLAT
    ends = []
    for way in (-1.0, 1.0):
        reach = 1e-5
        while reach < 0.2 and error.cost(_moved(error, z, at[0], 2.0 * way * reach)) < limit:
            reach *= 2.0
        ends.append(way * reach)
    middle = _moved(error, z, at[0], 0.5 * sum(ends))
    return middle if error.cost(middle) < limit else z


def _moved(error: SimulationError, z: Vector, i: int, way: float) -> Vector:
    there = z.copy()
    there[i] = np.clip(z[i] + way, error.lower[i], error.upper[i])
    return there


def _fitted(error: SimulationError, z: Vector, determined: Uncertainty, i: int) -> Fitted:
    parameter = error.parameters[i]

    def value(coordinate: float) -> float:
        there = z.copy()
        there[i] = coordinate
        return float(error.theta(there)[parameter.index])

    low, high = error.lower[i], error.upper[i]
    near = AT_BOUND * (high - low)
    at_bound = bool(z[i] < low + near or z[i] > high - near)
    inward = 10.0 * near if z[i] < low + near else -10.0 * near
    wants_out = at_bound and _wants_out(error, z, determined, i, inward)
    slope = (value(z[i] + 1e-6) - value(z[i] - 1e-6)) / 2e-6
    return Fitted(
        value(z[i]),
        abs(slope) * float(determined.std[i]),
        value(max(low, float(determined.lower[i]))),
        value(min(high, float(determined.upper[i]))),
        at_bound,
        not wants_out,
    )


def _wants_out(error: SimulationError, z: Vector, determined: Uncertainty, i: int, inward: float) -> bool:
    """Whether the cost rises so steeply into the range that its least must lie beyond the end."""
    steepness = (error.cost(_moved(error, z, i, inward)) - error.cost(z)) / abs(inward)
    return steepness > 0.0 and steepness * float(determined.std[i]) > WANTS_OUT * determined.rise


def _search(error: SimulationError, z: Vector) -> Search:
    theta = error.theta(z)
    return Search(error.cost(z), error.rms_m(z), {each.name: float(theta[each.index]) for each in error.parameters})
