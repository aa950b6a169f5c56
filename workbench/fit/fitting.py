"""Fit: the parameters with which one free run through the whole recording comes closest.

`objective` has the cost, `starts` where searches begin, `descent` how they go on, `agreement` which came to the same,
`uncertainty` what the recording says about the result, `parameters` the coordinates.

Searches from all starts go down at the wide scale, the best of these at the middling one, and of those, the best
first, each to where it stays, until searches from independent starts have come to the same. The result does not depend
on the number of workers, which are threads.

A stem whose slides are not seen is simulated without inertia. If that leaves something, it is simulated with, too:
where a stem that swings past its balance comes to rest hangs on its viscous friction, and that is not known before.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.valve_file import EffectTable, ValveFile, ValveParameters
from sim.composition import BASE, SPRING, STATIC, Composition
from sim.effect import Effect, find_effects
from workbench.data.motion import slips
from workbench.data.record import Record, ready, require_few_samples, require_units
from workbench.data.stretches import informative
from workbench.fit.agreement import Place
from workbench.fit.begun_fit import LEAVES, BegunFit, Effort, Progress, widely
from workbench.fit.fit_result import Fit, with_profile
from workbench.fit.objective import SimulationError
from workbench.fit.setpoint_starts import FREE as FREE_BY_SETPOINT
from workbench.fit.setpoint_starts import setpoint_starts
from workbench.fit.starts import base_starts, effect_starts, forces_regressed
from workbench.fit.threads import linear_algebra_alone
from workbench.model.free_run import FreeRun
from workbench.model.parameters import AT_REST, DEFAULT, LANDED, free_parameters
from workbench.model.sampling import Motion, Sampling, affords_inertia, sampling, swing_m, with_inertia

OF_BASE, OF_EFFECT, OF_ONE = Effort(8, 6, 3, near=5.0), Effort(5, 4, 2, near=500.0), Effort(1, 1, 1, near=5.0)
DRAWS = 8
LEAST_SLIPS = 3
SWINGS = 1.5
"""Factor on the cost: a missing effect, too, is a little better imitated with a parameter more."""


@linear_algebra_alone()
@kinds_held
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
    by: Sampling | None = None,
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
        by: how the recording is simulated; by default, with `effects` as for the base, as this valve asks for.
        profile: follow the cost for the intervals; without, they are those of the derivatives, at half the time.
        progress: called with the fraction done.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect or parameter.
    """
    record = _fittable(recording, valve)
    if effects:
        ground = base or fit(
            recording, valve, seed=seed, workers=workers, from_pressure=from_pressure, free=_of_base(free), by=by
        )
        begun = _begun(record, valve, effects, ground, free, workers, progress)
        return begun.all_begun().carried().finished(profile=profile)
    searched = partial(_base, record, valve, free, seed, workers, from_pressure, profile=profile)
    found = searched(by or sampling(record, valve.valve), progress or (lambda _: None))
    if by is None and free is None and _may_swing(found, record):
        swinging = searched(with_inertia(record, valve.valve), lambda _: None)
        found = swinging if _told(swinging, found, record) else found
    return found


def _may_swing(found: Fit, record: Record) -> bool:
    """Whether a stem that was simulated without inertia may swing past its balance, where it is seen in rests alone."""
    still = found.by.motion is Motion.QUASI_STATIC and not record.by_setpoint and affords_inertia(record)
    return still and found.cost > LEAVES * found.count


def _told(swinging: Fit, found: Fit, record: Record) -> bool:
    """Whether the record shows that the stem swings: it does so visibly, and that explains much of what was left."""
    return found.cost > SWINGS * swinging.cost and swing_m(swinging.valve.valve) > record.scale_m


def _base(
    record: Record,
    valve: ValveFile,
    free: Sequence[str] | None,
    seed: int,
    workers: int | None,
    from_pressure: bool,
    by: Sampling,
    tell: Progress,
    *,
    profile: bool,
) -> Fit:
    """Fit a valve as it is, simulated so."""
    composition = Composition.from_file(valve)
    error = _error(composition, record, free, from_pressure, by)
    if record.by_setpoint and not from_pressure:
        origins = composition.theta, composition.theta
        begins = setpoint_starts(error, composition.theta, seed, workers, lambda done: tell(0.5 * done))
    else:
        origins = composition.theta, forces_regressed(composition.theta, record, valve.valve, from_pressure)
        begins = base_starts(error, origins, seed, DRAWS)
    begun = widely(BegunFit(composition, error, (), OF_BASE, workers, tell), begins)
    found = begun.carried().finished(profile=profile)
    return replace(found, seeds=(*found.seeds, *origins))


@linear_algebra_alone()
def local_fit(
    recording: Recording,
    valve: ValveFile,
    *,
    free: Sequence[str] | None = None,
    from_pressure: bool = False,
    by: Sampling | None = None,
) -> Fit:
    """Fit a valve by the one search that begins where the valve file is, intervals by the derivatives.

    It takes a fifth of the time of `fit`. As no other search can agree it is never trusted: who takes it judges by the
    error that it leaves, and asks `fit` where that is not at the floor.

    Args:
        recording: what was measured.
        valve: where it begins.
        free: as of `fit`.
        from_pressure: as of `fit`.
        by: as of `fit`.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect.
    """
    record = _fittable(recording, valve)
    composition = Composition.from_file(valve)
    error = _error(composition, record, free, from_pressure, by or sampling(record, valve.valve))
    begun = BegunFit(composition, error, (), OF_ONE, 1, lambda _: None)
    here = Place(error.coordinates(composition.theta), "valve file")
    return widely(begun, [here]).carried().finished(profile=False)


@linear_algebra_alone()
def begun_fit(
    record: Record,
    valve: ValveFile,
    effects: Sequence[str],
    base: Fit,
    *,
    landed: bool = True,
    points: Sequence[tuple[float, ...]] = (),
) -> BegunFit:
    """Fit a valve with effects added to a base fit of the same record, on one thread, as far as through the wide scale.

    The first searches are; the others are begun by `BegunFit.all_begun`. Without `landed` none begins at landings:
    those of an earlier base fit were the same. With `points`, values of what is fitted of the effects, searches begin
    at these in place of where the effects declare it.

    Raises:
        InputError: an unknown effect, or one that the record cannot show.
    """
    return _begun(record, valve, effects, base, None, 1, None, landed=landed, points=points)


@linear_algebra_alone()
def profiled(found: Fit, recording: Recording) -> Fit:
    """Return a fit with the intervals that following its cost gives."""
    composition = Composition.from_file(found.valve)
    error = _error(composition, ready(recording), tuple(found.parameters), found.from_pressure, found.by)
    return with_profile(found, error)


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
    known: ValveParameters | None = None,
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
    parameters = free_parameters(composition, [*of_base, *reached] if free is None else free, scale, known)
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
    found = find_effects(effects, "effects")
    tables = [_switched_off(effect, name, known) for effect, name in zip(found, effects, strict=True)]
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
) -> BegunFit:
    """Search with effects added to a base fit, as far as through the wide scale."""
    composition = _extended(base.valve, effects, valve.valve)
    _require_shown(composition.effects[len(base.valve.effect) :], base.by)
    error = _error(composition, record, free, base.from_pressure, base.by, _scale(base, valve.valve), valve.valve)
    names = {each.name for each in find_effects(effects, "effects")}
    added = [each for each in error.parameters if each.name.partition(".")[0] in names]
    seeds = [np.concatenate([each, composition.theta[each.size :]]) for each in base.seeds]
    effort = replace(OF_EFFECT, base=base.cost)
    starts = effect_starts(error, added, seeds, landed=landed and not record.by_setpoint, points=points)
    tell = progress or (lambda _: None)
    begun = BegunFit(
        composition,
        error,
        (),
        effort,
        workers,
        tell,
        weakest=starts.weakest,
        others=starts.others,
        added=added,
        strengths=starts.strengths,
    )
    return widely(begun, starts.first)
