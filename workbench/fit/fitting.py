"""Fit: the valve under which a record is most likely, told when its stem moves.

`likelihood` has the cost, `minimiser` lowers it, `starts` says from where, `uncertainty` what the record says of the
result. Searches begin at the data sheet, or beside an added effect at what it declares and at the fit without it, so
that no effect makes a valve worse.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.valve_file import EffectTable, ValveFile, ValveParameters
from sim.composition import BASE, STATIC, Composition
from sim.effect import Effect, find_effects
from sim.karnopp import Vector
from workbench.data.record import Record, ready, require_few_samples
from workbench.data.stretches import informative
from workbench.fit.ends import search_about, settle
from workbench.fit.fit_problem import Problem, problem
from workbench.fit.fit_result import Fit, Terms, fit_at, terms_of_all
from workbench.fit.fit_thresholds import FIT, Effort
from workbench.fit.likelihood import Likelihood, cost_of
from workbench.fit.minimiser import End, begin_by_landings, derivatives, descend
from workbench.fit.onsets import with_onsets
from workbench.fit.starts import (
    Origin,
    base_starts,
    in_other_order,
    near_start,
    starts_by_landings,
    strewn,
    swinging_starts,
    with_strengths,
)
from workbench.fit.threads import linear_algebra_alone, on_threads
from workbench.model.search_coordinates import DEFAULT
from workbench.model.simulation_regime import DYNAMIC, MOST_WITH_INERTIA, Motion, Sampling
from workbench.model.told_run import told_moves

Progress = Callable[[float], None]


@linear_algebra_alone()
@kinds_held
def fit(
    recording: Recording,
    valve: ValveFile,
    *,
    effects: Sequence[str] = (),
    free: Sequence[str] | None = None,
    workers: int | None = None,
    from_pressure: bool = False,
    base: Fit | None = None,
    by: Sampling | None = None,
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
        workers: threads, by default one a core.
        from_pressure: simulate from the measured pressure instead of the command, without the pressure path.
        base: the fit without `effects`, if it is there already.
        by: how the recording is simulated; by default, with `effects` as for the base, as this valve asks for.
        progress: called with the fraction done.

    Raises:
        InputError: the recording holds too little, other units than SI, or an unknown effect or parameter.
    """
    require_few_samples(recording)
    record = ready(informative(recording))
    pressed = from_pressure if base is None else base.from_pressure
    of = problem(record, valve.valve, from_pressure=pressed, by=base.by if base and by is None else by)
    tell = progress or (lambda _: None)
    of_base = None if free is None else [name for name in free if name in BASE or name.partition(".")[0] not in effects]
    ground = base or base_fit(of, valve, free=of_base, workers=workers)
    tell(0.5 if effects else 1.0)
    if not effects:
        return ground
    found = finish(of, settled(advance(glimpse(of, valve, effects, ground, free=free, workers=workers))))
    tell(1.0)
    return found


@linear_algebra_alone()
def base_fit(of: Problem, valve: ValveFile, *, free: Sequence[str] | None = None, workers: int | None = 1) -> Fit:
    """Fit a valve as it is.

    Raises:
        InputError: an unknown parameter, or a valve that the record cannot drive.
    """
    found, left = _base_fit(of, valve, free, workers, base_starts)
    if left and of.by.motion is Motion.QUASI_STATIC and len(of.record) <= MOST_WITH_INERTIA:
        # A stem that swings past its balance sticks there: that shows where it lands, however seldom it is seen.
        swinging, left = _base_fit(replace(of, by=DYNAMIC), valve, free, workers, swinging_starts)
        return found if left else swinging
    return found


def _base_fit(
    of: Problem,
    valve: ValveFile,
    free: Sequence[str] | None,
    workers: int | None,
    starts: Callable[[Likelihood], list[Vector]],
) -> tuple[Fit, bool]:
    """Fit a valve as it is, sampled as the problem says; return whether anything is left above the noise."""
    composition = Composition.from_file(valve)
    like = of.likelihood(composition, free)
    first, *others = starts(like)
    ends = [*settle(like, _from_afar(like.eased, first))]
    if not at_the_noise(_cheapest(ends).cost, like.count):
        for each in on_threads(lambda z: settle(like, _from_afar(like.eased, z)), others, workers):
            ends += each
    return _best(of, like, ends), not at_the_noise(_cheapest(ends).cost, like.count)


@dataclass(frozen=True, slots=True)
class Trial:
    """A valve with effects added, searched for a while: enough to tell whether it is worth going on."""

    like: Likelihood
    valleys: tuple[End, ...]
    """Of eased searches, by cost, the best first."""
    begun: Terms
    """The eased likelihood of the valve without the effects."""

    @property
    def cost(self) -> float:
        """Of the best valley."""
        return self.valleys[0].cost

    @property
    def terms(self) -> Terms:
        """The eased likelihood of the best valley."""
        return terms_of_all(self.like, self.valleys[0].groups)


@linear_algebra_alone()
def glimpse(
    of: Problem,
    valve: ValveFile,
    effects: Sequence[str],
    base: Fit,
    *,
    free: Sequence[str] | None = None,
    workers: int | None = 1,
    points: Sequence[tuple[float, ...]] = (),
) -> Trial:
    """Look for a valve with effects added to a base fit of the same problem, from every start.

    Args:
        of: the problem.
        valve: as it was before any fit: what is given on a drawing is as known there.
        effects: names, or paths of own effects' files.
        base: the fit without them.
        free: as of `fit`.
        workers: threads.
        points: values of what is fitted of the effects from which searches begin, in place of what they declare.

    Raises:
        InputError: an unknown effect, one that is there, or one that the record cannot show.
    """
    composition = extended(base.valve, effects, valve.valve)
    added_effects = composition.effects[len(base.valve.effect) :]
    of.require_shown(added_effects)
    whole = of.likelihood(composition, free, _scale(base, valve.valve), valve.valve)
    like = whole.eased
    names = {each.name for each in added_effects}
    added = [each for each in like.parameters if each.name.partition(".")[0] in names]
    fitted = Origin(composition.theta, base.onsets_s)
    sheet = composition.theta.copy()
    for i, name in enumerate(BASE):
        sheet[i] = getattr(valve.valve, name)
    off = like.coordinates(fitted.theta)
    without = like.at(like.theta(off), base.onsets_s)
    searches: list[Callable[[], End]] = []
    if like.run.hidden:  # friction stands in for a play where slides land: landings do not choose its width
        begins = [like.coordinates(theta) for theta in strewn(like, added, fitted, points)]
        searches += [lambda z=z: _from_afar(like, z, FIT.descent.glimpse) for z in begins]  # type: ignore[misc]
    else:
        near = near_start(like, added, fitted, points)
        searches.append(lambda: descend(like, near, base.onsets_s, FIT.descent.glimpse))
        if not at_the_noise(base.cost, base.count):
            chosen = partial(with_strengths, like, added, points=points)
            begins = starts_by_landings(like, added, fitted, Origin(sheet), points)
            searches += [lambda z=z: _from_afar(like, z, FIT.descent.glimpse, chosen) for z in begins]  # type: ignore[misc]
    ends = list(on_threads(lambda search: search(), searches, workers))
    if cost_of(without.whole) < min((each.cost for each in ends), default=inf):  # an own effect may declare no start
        ends.append(descend(like, off, base.onsets_s, FIT.descent.glimpse))
    best = _cheapest(ends)
    other_order = in_other_order(like, best.z)
    if other_order is not None and not at_the_noise(best.cost, like.count):
        onsets_s, _ = with_onsets(like, like.theta(other_order), FIT.onsets.coarse_rounds)
        ends.append(descend(like, other_order, onsets_s, FIT.descent.glimpse))
    return Trial(whole, tuple(sorted(ends, key=lambda each: each.cost)), terms_of_all(like, without))


@linear_algebra_alone()
def advance(trial: Trial) -> Trial:
    """Search on in the best valley of a trial, and in the next best if that leaves something."""
    like, (first, *others) = trial.like.eased, trial.valleys
    ends = [descend(like, first.z, first.onsets_s, FIT.descent.coarse)]
    if not at_the_noise(ends[0].cost, like.count) and others and others[0].cost < FIT.ends.near_cost * first.cost:
        ends.append(descend(like, others[0].z, others[0].onsets_s, FIT.descent.coarse))
    valleys = sorted((*ends, *others[len(ends) - 1 :]), key=lambda each: each.cost)
    return replace(trial, valleys=tuple(valleys))


@dataclass(frozen=True, slots=True)
class Settled:
    """A valve with effects added, searched to the ends of its valleys, by either law within moves."""

    like: Likelihood
    ends: tuple[End, ...]

    @property
    def cost(self) -> float:
        """Of the best end."""
        return _cheapest(self.ends).cost


@linear_algebra_alone()
def settled(trial: Trial) -> Settled:
    """Search to the end from the best valley of a trial, and from the next if it is nearly as good."""
    like, (first, *others) = trial.like, trial.valleys
    near = [first, *(each for each in others[:1] if each.cost < FIT.ends.near_cost * first.cost)]
    found = [settle(like, descend(like.eased, each.z, each.onsets_s)) for each in near]
    return Settled(like, tuple(end for ends in found for end in ends))


@linear_algebra_alone()
def finish(of: Problem, found: Settled, rival_cost: float = inf) -> Fit:
    """Return the fit of the best end; its neighbourhood is searched, too, unless a rival's cost is far below."""
    return _best(of, found.like, found.ends, is_near=found.cost < FIT.ends.near_cost * rival_cost)


@linear_algebra_alone()
def leave_off(of: Problem, trial: Trial) -> Fit:
    """Return the fit of a trial that is not gone on with, as far as it came."""
    like, best = trial.like, trial.valleys[0]
    groups = like.at(like.theta(best.z), best.onsets_s)
    cost = cost_of(groups.whole)
    end = best if best.cost < cost else replace(best, cost=cost, groups=groups, is_eased=like.is_eased)
    like = _law(like, end)
    return fit_at(of, like, replace(end, jacobian=derivatives(like, end.z, end.onsets_s)), agreement=0)


def problem_of(found: Fit, record: Record) -> Problem:
    """Return the problem of another record, driven and sampled as what a fit was made of; it need not move."""
    return Problem(
        record,
        told_moves(record),
        found.by.of(record, found.valve.valve),
        found.from_pressure,
        found.load_n,
        found.eased,
    )


@linear_algebra_alone()
def refit(of: Problem, found: Fit) -> Fit:
    """Fit the same valve to another problem, from where a fit has ended."""
    composition = Composition.from_file(found.valve)
    like = of.likelihood(composition, tuple(found.parameters))
    z = like.coordinates(composition.theta)
    onsets_s, _ = with_onsets(like, composition.theta)
    return _best(of, like, [descend(like, z, onsets_s)])


def extended(valve: ValveFile, effects: Sequence[str], known: ValveParameters) -> Composition:
    """Compose a fitted valve with effects added, each switched off; what is given on a drawing is as known before.

    Raises:
        InputError: an unknown effect, or one that is there.
    """
    there = [each.name for each in valve.effect]
    for name in effects:
        if name in there:
            raise InputError("valve file", f"effect {name} is there already")
    found = find_effects(effects, "effects")
    tables = [_switched_off(effect, name, known) for effect, name in zip(found, effects, strict=True)]
    return Composition.from_file(ValveFile(valve=valve.valve, effect=(*valve.effect, *tables)))


def _switched_off(effect: Effect, name: str, valve: ValveParameters) -> EffectTable:
    """Return an effect's table as it vanishes, drawing data as declared."""
    return EffectTable.model_validate({"name": name, **dict(zip(effect.parameters, effect.off(valve), strict=True))})


def _scale(base: Fit, known: ValveParameters) -> ValveParameters:
    """Return the valve by which an effect's starts are scaled: the base fit's, but where that ran into its bounds."""
    at_bound = [name for name in DEFAULT if name in base.parameters and base.parameters[name].at_bound]
    return base.valve.valve.model_copy(update={name: getattr(known, name) for name in at_bound if name != BASE[STATIC]})


def _from_afar(
    like: Likelihood,
    z: Vector,
    effort: Effort = FIT.descent.whole,
    chosen: Callable[[Vector], Vector] = lambda landed: landed,
) -> End:
    """Search from a place of which nothing is known: landings first, then what acts in time, onsets, and all."""
    landed = chosen(begin_by_landings(like, z))
    rounds = None if effort == FIT.descent.whole else FIT.onsets.coarse_rounds
    onsets_s, _ = with_onsets(like, like.theta(landed), rounds)
    return descend(like, landed, onsets_s, effort)


def at_the_noise(cost: float, count: int) -> bool:
    """Whether the cost of so many residuals leaves nothing that another start might find."""
    return cost <= FIT.ends.at_the_noise * 0.5 * count


def _best(of: Problem, like: Likelihood, ends: Sequence[End], *, is_near: bool = True) -> Fit:
    """Return the fit of the best of these ends, searched about, if it is near, by each law that comes to its cost."""
    laws = [[each for each in ends if each.is_eased == eased] for eased in (False, True)]
    least, best_of = _cheapest(ends).cost, [_cheapest(each) for each in laws if each]
    if is_near:
        best_of = [
            search_about(_law(like, each), each)
            for each in best_of
            if each.cost <= FIT.ends.same_cost * least + FIT.ends.same_nats
        ]
    best = _cheapest(best_of)
    same = max(1, sum(each.cost <= FIT.ends.same_cost * best.cost + FIT.ends.same_nats for each in laws[best.is_eased]))
    return fit_at(of, _law(like, best), best, same + 1 if at_the_noise(best.cost, like.count) else same)


def _cheapest(ends: Sequence[End]) -> End:
    return min(ends, key=lambda each: each.cost)


def _law(like: Likelihood, end: End) -> Likelihood:
    """Return the likelihood by which a search has ended."""
    return like.eased if end.is_eased else like
