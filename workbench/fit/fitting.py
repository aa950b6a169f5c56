"""Fit: the parameters with which one free run through the whole recording comes closest.

`objective` has the cost, `starts` where searches begin, `descent` how they go on, `agreement` which came to the same,
`uncertainty` what the recording says about the result, `parameters` the coordinates.

Searches from all starts go down at the wide scale, the best of these at the middling one, and of those, the best
first, each to where it stays, until searches from independent starts have come to the same. The result does not depend
on the number of workers, which are threads.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from config.errors import InputError
from config.recording import Column, Recording
from config.results.block import Block
from config.results.result import Result
from config.valve_file import EffectTable, ValveFile, ValveParameters
from sim.composition import BASE, SPRING, STATIC, Composition
from sim.effect import Effect, find_effect
from sim.karnopp import Vector
from workbench.compare.comparison_sentences import shortened
from workbench.compare.measures import fit_percent
from workbench.data.motion import slips
from workbench.data.noise_floor import told_mm
from workbench.data.record import Record, ready, require_few_samples, require_units
from workbench.data.stretches import informative
from workbench.fit.agreement import WITHIN, Place, agreeing
from workbench.fit.descent import MIDDLING, WIDE, descended, settled
from workbench.fit.fitted_parameter import Fitted, draw_parameters, parameter_columns, parameter_table
from workbench.fit.guesses import FINEST
from workbench.fit.objective import MIDDLE, SimulationError, smoothed
from workbench.fit.setpoint_starts import FREE as FREE_BY_SETPOINT
from workbench.fit.setpoint_starts import setpoint_starts
from workbench.fit.shooting import shooting_starts
from workbench.fit.starts import base_starts, effect_starts, forces_regressed, moved_starts, weakest_start
from workbench.fit.strewing import proved, strewn
from workbench.fit.threads import linear_algebra_alone, on_threads
from workbench.fit.uncertainty import Combination, Uncertainty, uncertainty
from workbench.model.free_run import FreeRun
from workbench.model.parameters import AT_REST, DEFAULT, LANDED, Parameter, free_parameters
from workbench.model.sampling import DYNAMIC, Motion, Sampling, sampling

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Effort:
    """How much a search takes upon itself."""

    carried: int
    """Of the searches begun at the wide scale the best are carried on,"""
    settled: int
    """of those at most so many, two at a time, are brought to where they stay,"""
    agreeing: int
    """until searches from so many origins have come to the same."""
    improves_below: float = inf
    """Cost above which an effect makes nothing better than the base: such ends are not scanned for stairs, and do not
    agree, as the place where the effect is off can be reached from everywhere."""


OF_BASE, OF_EFFECT, OF_ONE = Effort(8, 6, 3), Effort(5, 4, 2), Effort(1, 1, 1)
DRAWS = 8
ELSEWHERE = 0.01
"""Of a log-parameter: searches that end nearer to each other have found the same place."""
FLAT = 0.5
"""Rise of the cost that is nothing: within it static friction is put in the middle."""
AT_BOUND = 1e-3
WANTS_OUT = 2.0
"""Slope of the cost at the bound times the deviation, in rises of 95 %: the least lies four deviations beyond it."""
LEAST_SLIPS = 3
LEAVES = 0.6
"""Cost a sample above which a fit leaves something to explain; that of white residuals of the noise is 0.485."""

Progress = Callable[[float], None]
T = TypeVar("T")
S = TypeVar("S")


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

    def predict(self, recording: Recording) -> Column:
        """Return the indicated position of a free run, m; NaN in rows that are not simulated."""
        return self._run(ready(recording))

    def score(self, recording: Recording) -> float:
        """Return 1 - ||measured - simulated|| / ||measured - mean||: 1 is perfect, below 0 worse than the mean."""
        record = ready(recording)
        return fit_percent(record, self._run(record)) / 100.0

    def blocks(self) -> list[Block]:
        """Say the error, whether the searches agree, and each parameter with its interval."""
        agreement = "searches agree" if self.trusted else "search came to this alone, or to nothing better: not trusted"
        return [
            f"error {1e3 * self.rms_m:.4g} mm rms, floor {told_mm(self.floor_m)}; {self.agreement} {agreement}",
            parameter_table(self.parameters),
            *([self.by.sentence] if self.by.slow else []),
            *(f"recording: {note}" for note in shortened(self.notes)),
        ]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a parameter: name, value, standard deviation, 95 % interval, at its bound, physical."""
        return parameter_columns(self.parameters)

    def plot(self) -> "Figure":
        """Draw the parameters' 95 % intervals in per cent of their values."""
        return draw_parameters(self.parameters)

    def _run(self, record: Record) -> Column:
        composition = Composition.from_file(self.valve)
        by = self.by.of(record, self.valve.valve)
        return FreeRun(composition, record, from_pressure=self.from_pressure, by=by).position_m(composition.theta)


@linear_algebra_alone()
def fit(
    recording: Recording,
    valve: ValveFile,
    *,
    effects: Sequence[str] = (),
    free: Sequence[str] | None = None,
    seed: int = 0,
    workers: int | None = None,
    from_pressure: bool = False,
    base: Fit | None = None,
    profile: bool = True,
    progress: Progress | None = None,
) -> Fit:
    """Fit a valve to a recording.

    Args:
        recording: what was measured.
        valve: where to begin, and what an effect's given parameters are scaled by; its area, mass, Stribeck velocity
            and stroke are kept unless named in `free`.
        effects: names of effects to be added to those of the valve file.
        free: parameters to be fitted, an effect's as `effect.parameter`; by default spring, viscous, Coulomb and static
            friction and all that the effects have.
        seed: of the draws.
        workers: threads, by default one a core.
        from_pressure: simulate from the measured pressure instead of the command, without the pressure path.
        base: the fit without `effects`, if it is there already.
        profile: follow the cost for the intervals; without, they are those of the derivatives, at half the time.
        progress: called with the fraction done.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect or parameter.
    """
    record = _fittable(recording, valve)
    if effects:
        ground = base or fit(
            recording, valve, seed=seed, workers=workers, from_pressure=from_pressure, free=_of_base(free)
        )
        begun = _begun(record, valve, effects, ground, free, workers, progress)
        return begun.landed().carried().finished(profile=profile)
    composition = Composition.from_file(valve)
    error = _error(composition, record, free, from_pressure, sampling(record, valve.valve))
    tell = progress or (lambda _: None)
    if record.by_setpoint and not from_pressure:
        origins = composition.theta, composition.theta
        begins = setpoint_starts(error, composition.theta, seed, workers, lambda done: tell(0.5 * done))
    else:
        origins = composition.theta, forces_regressed(composition.theta, record, valve.valve, from_pressure)
        begins = base_starts(error, origins, seed, DRAWS)
    begun = _widely(BegunFit(composition, error, (), OF_BASE, workers, tell), begins)
    found = begun.carried().finished(profile=profile)
    return replace(found, seeds=(*found.seeds, *origins))


@linear_algebra_alone()
def local_fit(recording: Recording, valve: ValveFile) -> Fit:
    """Fit a valve by the one search that begins where the valve file is, intervals by the derivatives.

    It takes a fifth of the time of `fit`. As no other search can agree it is never trusted: who takes it judges by the
    error that it leaves, and asks `fit` where that is not at the floor.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect.
    """
    record = _fittable(recording, valve)
    composition = Composition.from_file(valve)
    error = _error(composition, record, None, False, sampling(record, valve.valve))
    begun = BegunFit(composition, error, (), OF_ONE, 1, lambda _: None)
    here = Place(error.coordinates(composition.theta), "valve file")
    return _widely(begun, [here]).carried().finished(profile=False)


@linear_algebra_alone()
def begun_fit(
    recording: Recording,
    valve: ValveFile,
    effects: Sequence[str],
    base: Fit,
    *,
    landed: bool = True,
    points: Sequence[tuple[float, ...]] = (),
) -> "BegunFit":
    """Fit a valve with effects added to a base fit, on one thread, as far as through the wide scale.

    Searches that begin at landings are begun by `BegunFit.landed`. Without `landed` there are none: those of an earlier
    base fit were the same. With `points`, values of what is fitted of the effects, searches begin at these in place of
    where the effects declare it.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect.
    """
    return _begun(_fittable(recording, valve), valve, effects, base, None, 1, None, landed=landed, points=points)


@linear_algebra_alone()
def profiled(found: Fit, recording: Recording) -> Fit:
    """Return a fit with the intervals that following its cost gives."""
    composition = Composition.from_file(found.valve)
    error = _error(composition, ready(recording), tuple(found.parameters), found.from_pressure, found.by)
    z = error.coordinates(composition.theta)
    determined = uncertainty(error, z)
    parameters = {each.name: _fitted(error, z, determined, i) for i, each in enumerate(error.parameters)}
    return replace(found, parameters=parameters, condition=determined.condition, undetermined=determined.undetermined)


FREE = {Motion.DYNAMIC: DEFAULT, Motion.QUASI_STATIC: AT_REST, Motion.LANDINGS: LANDED}
"""What of the bare valve is fitted by default."""


def _require_shown(effects: Sequence[Effect], by: Sampling) -> None:
    for each in effects:
        why = by.left_out(each)
        if why:
            raise InputError("recording", f"{each.name} cannot be fitted: it {why}")


def _error(
    composition: Composition,
    record: Record,
    free: Sequence[str] | None,
    from_pressure: bool,
    by: Sampling,
    scale: ValveParameters | None = None,
) -> SimulationError:
    run = FreeRun(composition, record, from_pressure=from_pressure, by=by)
    reached = [
        f"{each.name}.{key}"
        for each in composition.effects
        if not (from_pressure and "pressure" in each.functions) and not by.left_out(each)
        for key, declared in each.parameters.items()
        if not declared.given
    ]
    of_base = list(FREE_BY_SETPOINT if record.by_setpoint and not from_pressure else FREE[by.motion])
    if composition.theta[SPRING] == 0.0 and BASE[SPRING] in of_base:
        of_base.remove(BASE[SPRING])
    parameters = free_parameters(composition, [*of_base, *reached] if free is None else free, scale)
    return SimulationError(run, composition, parameters, composition.theta)


def _of_base(free: Sequence[str] | None) -> Sequence[str] | None:
    return None if free is None else [name for name in free if name in BASE]


def _require_motion(record: Record) -> None:
    found = [
        each
        for first, end in record.segments
        for each in slips(np.where(record.valid, record.position_m, np.nan)[first:end], record.scale_m)
    ]
    if len(found) < LEAST_SLIPS:
        raise InputError(
            "recording", f"the stem moves {len(found)} times, at least {LEAST_SLIPS} are needed to fit anything"
        )
    if len({each.direction for each in found}) < 2:
        way = "opens" if found[0].direction > 0 else "closes"
        raise InputError(
            "recording", f"the stem only {way}: friction and spring cannot be told apart without both ways"
        )


def _extended(valve: ValveFile, effects: Sequence[str], known: ValveParameters) -> Composition:
    """Compose a fitted valve with effects added, each switched off; what is given on a drawing is as known before."""
    there = [each.name for each in valve.effect]
    for name in effects:
        if name in there:
            raise InputError("valve file", f"effect {name} is there already")
    tables = [_switched_off(find_effect(name, "effects"), name, known) for name in effects]
    return Composition.from_file(ValveFile(valve=valve.valve, effect=(*valve.effect, *tables)))


def _scale(base: Fit, known: ValveParameters) -> ValveParameters:
    """Return the valve by which an effect's starts are scaled: the base fit's, but where that ran into its bounds."""
    at_bound = [name for name in DEFAULT if name in base.parameters and base.parameters[name].at_bound]
    return base.valve.valve.model_copy(update={name: getattr(known, name) for name in at_bound if name != BASE[STATIC]})


def _switched_off(effect: Effect, name: str, valve: ValveParameters) -> EffectTable:
    """Return an effect's table as it vanishes, drawing data as declared."""
    return EffectTable.model_validate({"name": name, **dict(zip(effect.parameters, effect.off(valve), strict=True))})


def _fittable(recording: Recording, valve: ValveFile) -> Record:
    require_few_samples(recording)
    record = ready(informative(recording))
    require_units(record, valve.valve)
    _require_motion(record)
    return record


def _begun(
    record: Record,
    valve: ValveFile,
    effects: Sequence[str],
    base: Fit,
    free: Sequence[str] | None,
    workers: int | None,
    progress: Progress | None,
    *,
    landed: bool = True,
    points: Sequence[tuple[float, ...]] = (),
) -> "BegunFit":
    """Search with effects added to a base fit, as far as through the wide scale."""
    composition = _extended(base.valve, effects, valve.valve)
    _require_shown(composition.effects[len(base.valve.effect) :], base.by)
    error = _error(composition, record, free, base.from_pressure, base.by, _scale(base, valve.valve))
    names = {find_effect(name, "effects").name for name in effects}
    added = [each for each in error.parameters if each.name.partition(".")[0] in names]
    seeds = [np.concatenate([each, composition.theta[each.size :]]) for each in base.seeds]
    effort = replace(OF_EFFECT, improves_below=base.cost / WITHIN)
    starts = effect_starts(error, added, seeds, landed=landed and not record.by_setpoint, points=points)
    tell = progress or (lambda _: None)
    weakest = weakest_start(error, added, seeds[0])
    begun = BegunFit(
        composition,
        error,
        (),
        effort,
        workers,
        tell,
        weakest=weakest,
        waiting=starts.at_landings,
        added=added,
        grid=starts.grid,
    )
    return _widely(begun, [*starts.begins, *starts.at_landings[:1]])


def _widely(fit: "BegunFit", begins: Sequence[Place]) -> "BegunFit":
    """Search from more starts at the wide scale."""
    rough = fit.error.rough

    def begun(start: Place) -> Place:
        return replace(start, z=descended(smoothed(rough, start.z), start.z, WIDE))

    found = [*fit.places, *_each(begun, begins, fit.workers, lambda done: fit.tell(0.3 * done))]
    ordered = sorted(found, key=lambda place: rough.cost(place.z, MIDDLE))
    return replace(fit, places=ordered[: fit.effort.carried])


@dataclass(frozen=True, slots=True)
class BegunFit:
    """A fit whose searches have come through the wide scale or the middling one, or the best to where they stay."""

    composition: Composition
    error: SimulationError
    places: Sequence[Place]
    """Where the searches have come to, the best first; through the middling scale, in the order in which they go on."""
    effort: Effort
    workers: int | None
    tell: Progress
    ends: tuple[Place, ...] = ()
    """Where the first of them stay, best first."""
    weakest: Place | None = None
    """Where what is added makes next to nothing of the base."""
    added: Sequence[Parameter] = ()
    """The parameters of what is added."""
    waiting: Sequence[Place] = ()
    """Starts from landings that no search has begun at."""
    grid: Sequence[Vector] = ()
    """Coordinates of strengths of what is added, from which multiple shooting chooses."""
    through: bool = False
    """Whether the searches have come through the middling scale."""

    @property
    def cost(self) -> float:
        """Cost of the best end."""
        return self.error.cost(self.ends[0].z)

    @property
    def screening_cost(self) -> float:
        """Cost by which searches are compared on their way, that of the best of them."""
        return min(self.error.rough.cost(place.z, MIDDLE) for place in self.places)

    @property
    def gain(self) -> float:
        """The cost by which searches are compared on their way, over that with next to nothing of what is added."""
        assert self.weakest is not None
        return self.screening_cost / self.error.rough.cost(self.weakest.z, MIDDLE)

    def landed(self) -> "BegunFit":
        """Begin the searches from landings, which take more to begin than others, if they are not there yet."""
        if not self.waiting:
            return self
        return replace(_widely(self, moved_starts(self.error, self.waiting, self.added)), waiting=())

    def carried(self) -> "BegunFit":
        """Carry the searches from the wide scale through the middling one, if they are not there yet."""
        rough = self.error.rough
        if self.through:
            return self

        def carried(place: Place) -> Place:
            return replace(place, z=descended(smoothed(rough, place.z), place.z, MIDDLING))

        found = _each(carried, self.places, self.workers, lambda done: self.tell(0.3 + 0.2 * done))
        ordered = sorted(found, key=lambda place: rough.cost(place.z, MIDDLE))
        return replace(self, places=_by_origins(ordered), through=True)

    @property
    def rms_m(self) -> float:
        """The rms error of the best that its searches have come to so far, m."""
        return self.error.rms_m((self.ends or self.places)[0].z)

    def settled(self, count: int) -> "BegunFit":
        """Bring at most so many more of the searches to where they stay."""
        chosen = self.places[len(self.ends) : len(self.ends) + count]
        found = _each(self._ended, chosen, self.workers, lambda done: self.tell(0.5 + 0.4 * done))
        return replace(self, ends=self._ordered([*self.ends, *found]))

    def _ended(self, start: Place) -> Place:
        z = settled(self.error, start.z, self.effort.improves_below)
        return replace(start, z=strewn(self.error, z) if self._rounds(z) else z)

    def _ordered(self, ends: Sequence[Place]) -> tuple[Place, ...]:
        return tuple(sorted(ends, key=lambda end: self.error.cost(end.z)))

    def finished(self, *, profile: bool) -> Fit:
        """Return the fit, searches brought to where they stay two at a time until they agree.

        Where a sensor rounds by more than the noise hides, places about the best are tried before the agreement counts.

        Args:
            profile: follow the cost for the intervals.
        """
        here, most = self, min(self.effort.settled, len(self.places))
        while len(here.ends) < most and (not here.ends or agreeing(here.error, here.ends) < here.effort.agreeing):
            # One that was there already is the first of two: the fit is the same whether it was begun apart or not.
            here = here.settled(min(2 - len(here.ends) % 2, most - len(here.ends)))
        here = here.shot()
        best = here.ends[0].z
        if here._rounds(best) and here._shows(best):
            here = replace(here, ends=proved(here.error, here.ends))
        return here.judged(profile=profile)

    def shot(self) -> "BegunFit":
        """Search from starts by multiple shooting too, where the best end leaves something to explain."""
        if self.cost <= LEAVES * self.error.count:
            return self
        begins = shooting_starts(self.error, self.grid, self.ends[0].z)
        found = _each(self._ended, begins, self.workers, lambda done: self.tell(0.9 + 0.05 * done))
        return replace(self, ends=self._ordered([*self.ends, *found]))

    def left(self) -> Fit:
        """Return the fit by the best place on the way: nothing has settled, and nothing is brought there."""
        return replace(self, ends=tuple(self.ends or self.places)[:1], weakest=None).judged(profile=False)

    def judged(self, *, profile: bool) -> Fit:
        """Return the fit by what has settled so far.

        Args:
            profile: follow the cost for the intervals.
        """
        error, ends = self.error, self._never_worse().ends
        found = [end.z for end in ends]
        best = _centred(error, found[0])
        determined = uncertainty(error, best, found, profile=profile)
        self.tell(1.0)
        return Fit(
            self.composition.file(error.theta(best)),
            {each.name: _fitted(error, best, determined, i) for i, each in enumerate(error.parameters)},
            error.rms_m(best),
            error.run.record.floor_m,
            error.cost(best),
            error.count,
            tuple(_search(error, z) for z in found),
            agreeing(error, ends) if self._shows(found[0]) else 1,
            determined.condition,
            determined.undetermined,
            error.run.record.notes,
            error.run.from_pressure,
            tuple(error.theta(z) for z in (best, *_elsewhere(found))),
            error.run.by,
        )

    def _never_worse(self) -> "BegunFit":
        """Search from the base too where all ends are worse than that."""
        if self.weakest is None or self.cost <= self.error.cost(self.weakest.z):
            return self
        end = replace(self.weakest, z=settled(self.error, self.weakest.z, self.effort.improves_below))
        return replace(self, ends=(end, *self.ends))

    def _shows(self, z: Vector) -> bool:
        """Whether what is added makes something better than the base, a quantum by more than the noise hides."""
        theta, noise_m = self.error.theta(z), self.error.run.record.scale_m
        quanta_m = [theta[each.index] for each in self.error.parameters if each.guess == "quantum"]
        return self.error.cost(z) < self.effort.improves_below and all(each >= FINEST * noise_m for each in quanta_m)

    def _rounds(self, z: Vector) -> bool:
        """Whether the sensor rounds at z, and that makes something better than the base."""
        return smoothed(self.error, z) is not self.error and self.error.cost(z) < self.effort.improves_below


def _by_origins(places: Sequence[Place]) -> list[Place]:
    """Return the first of each origin, then the second of each, and so on: those that can agree come first."""
    turns = [sum(other.origin == each.origin for other in places[:i]) for i, each in enumerate(places)]
    return [places[i] for i in sorted(range(len(places)), key=turns.__getitem__)]


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


def _each(function: Callable[[T], S], arguments: Sequence[T], workers: int | None, tell: Progress) -> list[S]:
    """Apply a function to each argument on the workers; results in the order of the arguments."""
    results = []
    with closing(on_threads(function, arguments, workers)) as found:
        for result in found:
            results.append(result)
            tell(len(results) / len(arguments))
    return results
