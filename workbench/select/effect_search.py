"""The forward search by simulation: every effect of the library refitted, step by step.

A step fits the valve with each effect added. They race: one that is far behind another at the wide scale, with its
first searches or with all, or at the middling one waits there, and is searched on only if what the step adds leaves
something to explain. One whose first search ends far behind another's is not searched further, unless the step would
name it. Beside a model that leaves nothing to explain each is searched once, and on where that shows any evidence. An
effect that comes after another (`AFTER` in its file) is fitted only where that one has evidence, or is in the model
already, and what the step would add leaves something to explain. Before they are judged, the valve without is fitted
once more from the base parameters of the best of those with: an optimiser's failure must not look like physics.
Steps go on until the added model explains all and leaves no room for another effect, nothing more is accepted, or three
effects are added. Where two steps leave something to explain, the first is tried with each of its runners-up added,
too, and taken back if that leads farther; not where they leave most of what was there before them. Where the second
brings next to nothing, the search ends: what is missing is none of the library. Of three effects, one that is not
needed beside the others has stood in for them, and is taken out. Where several explain all, what had evidence in an
earlier step is asked again beside what was added later.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import TypeVar

from config.errors import InputError
from config.valve_file import ValveFile, ValveParameters
from sim.composition import Composition
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.fit.begun_fit import BegunFit
from workbench.fit.crossing import SURELY, leaves_noise
from workbench.fit.descent import NARROW, descended
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import begun_fit, fit, profiled
from workbench.fit.objective import SimulationError
from workbench.fit.threads import on_threads
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters
from workbench.model.sampling import Sampling
from workbench.select.block_errors import block_errors, indistinguishable
from workbench.select.effect_acceptance import LEAST_BIC, LEAST_INDEPENDENT, bic, gain, log_likelihood_difference
from workbench.select.effect_candidates import (
    EffectCandidate,
    EffectStep,
    EvaluatedModel,
    judged_step,
    leads_farther,
    pressure_speaks_against,
    runners_up,
    with_added,
)
from workbench.select.equivalence import algebraic_class, bare_imitation, classes
from workbench.select.experiment import Experiment, experiment
from workbench.select.forward_selection import MOST_ADDED, without_missing
from workbench.select.pressure_errors import pressure_errors
from workbench.select.pressure_scatter import with_pressure_scatter

MOST_STEPS = 5
"""Steps made at most: a step that is judged anew is followed by others."""
BETTER = 0.999
"""Factor on the cost at which a base fit counts as better than the one before."""
MOST, NEARLY_ALL = 0.5, 0.8
"""Of the squared error held out, less the floor's: what two steps, and the second of them, leave in vain."""
LEFT_BEHIND = 1.0
"""Of BIC: less is nothing."""
OUT_OF_RACE = 10.0
"""Factor on the cost of the best search of a step, above which an effect is not searched further;"""
BEHIND = 2.0
"""above which another's searches are not gone on from where they stay, which lowers costs by some per cent."""

Progress = Callable[[str, float], None]
Race = Callable[[int, str, float], None]
"""Told of a candidate that is refitted: step, effect, and the rms error, m, that its search has come to so far."""
S = TypeVar("S")
T = TypeVar("T", bound="BegunFit | EvaluatedModel | str")
MAY_BE_NONE = "its interval holds none, and what is left without it is at the floor"


@dataclass(slots=True)
class _Known:
    """What a search knows so far: the steps made, and in the one being made what is there before it and beside that."""

    steps: tuple[EffectStep, ...] = ()
    before: EvaluatedModel | None = None
    models: dict[str, EvaluatedModel | str] = field(default_factory=dict)


class EffectSearch:
    """The forward search over one split recording, and what it holds on to.

    `known` is the valve before any fit: what an effect's drawing gives is scaled by it.
    """

    def __init__(
        self,
        split: Split,
        library: Mapping[str, Effect],
        known: ValveParameters,
        *,
        seed: int,
        workers: int,
        progress: Progress,
        race: Race | None = None,
        from_pressure: bool = False,
    ) -> None:
        self._split = split
        self._from_pressure = from_pressure
        self._library = library
        self._drawn = known
        self._seed = seed
        self._workers = workers
        self._progress = progress
        self._race = race or (lambda _step, _name, _rms_m: None)
        self._known = _Known()
        self._by: Sampling | None = None
        """As the first fit came out; of all models alike, lest one be judged by landings that another is not."""

    def base(self, valve: ValveFile) -> EvaluatedModel:
        """Fit a valve as it is, without intervals.

        Raises:
            InputError: the recording holds too little.
        """
        found = fit(
            self._split.train.recording,
            valve,
            seed=self._seed,
            workers=self._workers,
            by=self._by,
            from_pressure=self._from_pressure,
            profile=False,
            progress=lambda done: self._progress("fitting the valve as it is", done),
        )
        if self._by is None:
            self._split = with_pressure_scatter(self._split, found)
        self._by = found.by
        return self._evaluated(found)

    @property
    def split(self) -> Split:
        """What it searches in; behind a measured pressure, once a base is fitted, with what that one's noise does."""
        return self._split

    def steps(self, base: EvaluatedModel) -> tuple[EffectStep, ...]:
        """Search from a fitted valve; a base that was fitted again, and better, stands in the first step."""
        steps = self._without_stand_in(self._forward([], base))
        return tuple(self._asked_beside(each, steps[i:]) for i, each in enumerate(steps, start=1))

    def so_far(self, base: EvaluatedModel) -> tuple[EffectStep, ...]:
        """Return the steps made so far, and the one being made as far as it has come; for a search broken off.

        What is tried beside other effects than those that the steps have added, to judge one of them anew, is left out.
        """
        known = self._known
        before = (_best(known.steps[-1]) if known.steps else known.before) or base
        models = {name: each for name, each in known.models.items() if self._is_beside(before, name, each)}
        return (*known.steps, judged_step(before, models, len(known.steps) + 1, self._library))

    def _is_beside(self, before: EvaluatedModel, name: str, tried: EvaluatedModel | str) -> bool:
        """Whether a model is that before it with the named effect added, and nothing else."""
        if isinstance(tried, str):
            return name not in before.effects
        return sorted(tried.effects) == sorted((*before.effects, self._library[name].name))

    def _forward(self, steps: list[EffectStep], here: EvaluatedModel) -> list[EffectStep]:
        """Go on from the model that the steps so far have come to."""
        for _ in range(MOST_STEPS):
            self._known = _Known(tuple(steps), here)
            following = self._step(len(steps) + 1, here)
            if steps:
                if not _leaves(MOST, steps[0].before, _best(following)):
                    steps[-1], following = self._taken_back(steps[-1], following)
                steps[-1] = without_missing(steps[-1], following, self._library)
            steps = self._judged_anew([*steps, following])
            added = steps[-1].added
            if added is None or added.model is None or len(steps) == MOST_ADDED or self._leaves_nothing(added.model):
                break
            if len(steps) > 1 and _leaves(NEARLY_ALL, steps[-1].before, added.model):
                break
            here = added.model
        return steps

    def _leaves_nothing(self, model: EvaluatedModel) -> bool:
        return model.explained and model.errors.leaves_nothing(model.floor_m)

    def _without_stand_in(self, steps: list[EffectStep]) -> list[EffectStep]:
        """Search anew without an effect that is not needed beside those that were added after it.

        Of two effects, the second alone has been fitted already (`_judged_anew`).
        """
        last, added = _best(steps[-1]), [step.added.name for step in steps if step.added]
        for i, name in enumerate(added[:-1] if len(added) > 2 else ()):
            valve = last.fit.valve
            others = tuple(each for each in valve.effect if each.name != name)
            without = self.base(ValveFile(valve=valve.valve, effect=others))
            if leads_farther(last, without):
                continue
            step = self._with_tried(steps[i], added[i + 1])
            following = next(each for each in step.candidates if each.name == added[i + 1])
            if following.model:
                turned = [*steps[:i], with_added(step, following, self._library)]
                return turned if following.model.explained else self._forward(turned, following.model)
        return steps

    def _with_tried(self, step: EffectStep, name: str) -> EffectStep:
        """Return a step with an effect among its candidates that waited for another to have evidence."""
        models = _models_of(step)
        if name in models:
            return step
        number = step.candidates[0].step
        return judged_step(step.before, models | self._refitted(number, step.before, [name]), number, self._library)

    def _taken_back(self, step: EffectStep, following: EffectStep) -> tuple[EffectStep, EffectStep]:
        """Return a step and the one after it, with a runner-up added in the first where that leads farther.

        Of two effects that are missing together the first is chosen before the second is known: another may stand in
        for both, and have more evidence than either.
        """
        for other in runners_up(step, self._library):
            if _best(following).explained or other.model is None:
                break
            turned = self._step(other.step + 1, other.model)
            if leads_farther(_best(turned), _best(following)):
                step, following = with_added(step, other, self._library), turned
        return step, following

    def _asked_beside(self, step: EffectStep, later: Sequence[EffectStep]) -> EffectStep:
        """Return a step with what does as well as the added one beside what later steps have added, too.

        While an effect is missing its error is in most blocks: it hides what acts in few, and rivals that are worse
        only because they do nothing for what is missing. So all that had evidence are asked.
        """
        added, last = step.added, _best(later[-1] if later else step)
        if added is None or all(each.added is None for each in later) or not last.explained:
            return step
        own = algebraic_class(added.name, self._library)
        asked = [each.name for each in step.candidates if _may_stand(each) and each.name not in own | {*last.effects}]
        if not asked:
            return step
        valve = last.fit.valve
        others = tuple(each for each in valve.effect if each.name != added.name)
        beside = self._refitted(added.step, self.base(ValveFile(valve=valve.valve, effect=others)), asked)
        as_good = {
            member
            for name, each in beside.items()
            if isinstance(each, EvaluatedModel)
            and indistinguishable(last.errors.all_logs, each.errors.all_logs)
            and not pressure_speaks_against(each, [last])
            for member in algebraic_class(name, self._library)
        }
        own_rivals = {each.name for each in step.indistinguishable if each.name in own}
        rivals = tuple(each for each in step.candidates if each.name in own_rivals | as_good and each.physical)
        return replace(step, indistinguishable=rivals)

    def proved(self, steps: tuple[EffectStep, ...]) -> tuple[tuple[EffectStep, ...], EvaluatedModel, EvaluatedModel]:
        """Return the steps as far as they hold, and the model they begin with and the one they come to, with intervals.

        The interval of an effect's strength follows the cost with all else given way. Where it holds none, the evidence
        may be another's: beside the effect something was searched anew, and ended lower. So the valve without is
        searched from where it ended beside the effect, and the step is judged anew if that leaves the effect nothing.
        Where the valve without leaves no more than the floor, evidence alone does not prove what may be none.
        """
        base, best = self.with_intervals((steps[0].before, _best(steps[-1])))
        for _ in range(MOST_ADDED):
            fewer = self._without_evidence(steps, best)
            if fewer is None:
                break
            steps = fewer
            base, best = self.with_intervals((steps[0].before, _best(steps[-1])))
        return steps, base, best

    def _without_evidence(self, steps: tuple[EffectStep, ...], best: EvaluatedModel) -> tuple[EffectStep, ...] | None:
        """Return the steps with the last that added an effect judged anew; None where the effect has evidence."""
        i = max((i for i, step in enumerate(steps) if step.added), default=None)
        added = steps[i].added if i is not None else None
        if i is None or added is None or not best.explained or not _may_be_none(best.fit, self._library[added.name]):
            return None
        valve = best.fit.valve
        own = self._library[added.name].name
        without = self.base(
            ValveFile(valve=valve.valve, effect=tuple(each for each in valve.effect if each.name != own))
        )
        has_evidence = bic(without.fit) - bic(best.fit) > LEAST_BIC
        if has_evidence and not without.at_floor:
            return None
        self._known = _Known(steps[:i], without)
        models = _models_of(steps[i])
        if has_evidence:
            models[added.name] = MAY_BE_NONE
        fits = {name: each.fit for name, each in models.items() if isinstance(each, EvaluatedModel)}
        behind = [name for name, each in fits.items() if log_likelihood_difference(without.fit, each) > LEFT_BEHIND]
        models |= self._refitted(i + 1, without, behind, landed=False)
        return (*steps[:i], self._judged_in_full(without, models, i + 1))

    def with_intervals(self, models: Sequence[EvaluatedModel]) -> tuple[EvaluatedModel, ...]:
        """Return models with the profile intervals of their parameters; equal ones once."""

        def found(model: EvaluatedModel) -> EvaluatedModel:
            return replace(model, fit=profiled(model.fit, self._split.train.recording))

        different = list({id(each): each for each in models}.values())
        by_model = dict(zip(map(id, different), on_threads(found, different, self._workers), strict=True))
        return tuple(by_model[id(each)] for each in models)

    def experiment(self, steps: Sequence[EffectStep]) -> Experiment | None:
        """Choose the input for the first set with more than one class: one valve of each class."""
        for step in steps:
            fits = {each.name: each.model.fit for each in step.indistinguishable if each.model}
            apart = [fits[min(each)] for each in classes(fits, self._library)]
            if len(apart) > 1:
                self._progress("choosing the experiment", 0.0)
                record = self._split.test.record
                return experiment(apart, record, seed=self._seed, workers=self._workers)
        return None

    def _step(self, number: int, before: EvaluatedModel) -> EffectStep:
        self._known = _Known(self._known.steps, before)
        missing = [name for name in self._library if name not in before.effects]
        names = [name for name in missing if self._library[name].after not in missing]
        begun = self._begun(number, before, names)
        little = before.explained or self._noise(before.fit)
        models, waiting = (self._beside(number, before, begun), {}) if little else self._raced(number, begun)
        left = dict(zip(waiting, on_threads(self._left, tuple(waiting.values()), self._workers), strict=True))
        before, models = self._with_base_again(number, before, models, models)
        step = self._judged_in_full(before, {**left, **models}, number)
        if waiting and not _best(step).explained:
            late = self._settled(number, waiting)
            before, models = self._with_base_again(number, before, late, models | late)
            step = self._judged_in_full(before, models, number)
        later = self._worth_trying_after(step)
        if not later:
            return step
        models = _models_of(step)
        models |= self._refitted(number, step.before, later)
        return self._judged_in_full(step.before, models, number)

    def _with_base_again(
        self,
        number: int,
        before: EvaluatedModel,
        new: Mapping[str, EvaluatedModel | str],
        models: dict[str, EvaluatedModel | str],
    ) -> tuple[EvaluatedModel, dict[str, EvaluatedModel | str]]:
        """Return the model before, fitted again where new ones show how, and the models that it has not left behind."""
        before = self._base_from(before, [each for each in new.values() if isinstance(each, EvaluatedModel)])
        # No effect makes a valve worse: what the base has left behind is refitted from it.
        fitted = {name: each.fit for name, each in models.items() if isinstance(each, EvaluatedModel)}
        behind = [name for name, each in fitted.items() if log_likelihood_difference(before.fit, each) > LEFT_BEHIND]
        return before, models | self._refitted(number, before, behind, landed=False)

    def _worth_trying_after(self, step: EffectStep) -> list[str]:
        """Return the effects that come after one that has evidence, if the step leaves something to explain."""
        if _best(step).explained:
            return []
        evident = {each.name for each in step.candidates if each.evidence > LEAST_BIC}
        tried = {each.name for each in step.candidates}
        return [name for name, each in self._library.items() if each.after in evident and name not in tried]

    def _judged_in_full(
        self, before: EvaluatedModel, models: dict[str, EvaluatedModel | str], number: int
    ) -> EffectStep:
        """Judge a step; again as long as it names an effect that was out of the race, refitted in full before."""
        step = judged_step(before, models, number, self._library)
        least = min(map(_cost, models.values()), default=inf)
        full: set[str] = set()
        while short := {each for each in _named(step) if _cost(models[each]) > OUT_OF_RACE * least} - full:
            models = models | self._refitted(number, step.before, sorted(short), racing=False)
            full |= short
            step = judged_step(step.before, models, number, self._library)
        return step

    def _judged_anew(self, steps: list[EffectStep]) -> list[EffectStep]:
        """Judge an earlier step anew if what was added last does better in it than its own search had found.

        A search that failed there is no reason to keep what was added in its place; all later steps are dropped then.
        """
        last = steps[-1].added
        if last is None or last.model is None:
            return steps
        valve = last.model.fit.valve
        for i, step in enumerate(steps[:-1]):
            effects = (*step.before.fit.valve.effect, *(each for each in valve.effect if each.name == last.name))
            alone = self.base(ValveFile(valve=valve.valve, effect=effects))
            models = _models_of(step)
            tried = models.get(last.name)
            if tried is None and not leads_farther(alone, _best(step)):
                continue  # it comes after an effect that had no evidence there
            if not isinstance(tried, EvaluatedModel) or log_likelihood_difference(alone.fit, tried.fit) > LEAST_BIC:
                return [*steps[:i], judged_step(step.before, models | {last.name: alone}, i + 1, self._library)]
        return steps

    def _base_from(self, before: EvaluatedModel, models: Sequence[EvaluatedModel]) -> EvaluatedModel:
        """Return the model before, fitted again where a search from a better one's parameters ends below it."""
        better = [each.fit.valve for each in models if bic(before.fit) - bic(each.fit) > LEAST_BIC]
        imitated = [(bare_imitation(each), each) for each in better]
        # What was added before may be off, too: a dead time that ended on a step of its stair, say.
        had = {each.name for each in before.fit.valve.effect}
        bare = [
            ValveFile(valve=valve, effect=tuple(each for each in of.effect if each.name in had))
            for valve, of in [*((each.valve, each) for each in better), *imitated]
            if valve
        ]
        costs = list(on_threads(partial(self._local_minimum, before.fit), bare, self._workers))
        if not costs or min(costs) > BETTER * before.fit.cost:
            return before
        return self.base(bare[costs.index(min(costs))])

    def _local_minimum(self, base: Fit, valve: ValveFile) -> float:
        """Return the cost at which a search from this valve's parameters ends."""
        error = self._error(base, valve)
        return error.cost(descended(error, error.coordinates(error.composition.theta), NARROW))

    def _error(self, base: Fit, valve: ValveFile) -> SimulationError:
        """Return the error of a valve over the parameters of a fit of it, simulated as that."""
        composition = Composition.from_file(valve)
        run = FreeRun(composition, self._split.train.record, from_pressure=base.from_pressure, by=base.by)
        parameters = free_parameters(composition, tuple(base.parameters))
        return SimulationError(run, composition, parameters, composition.theta)

    def _refitted(
        self, number: int, before: EvaluatedModel, names: Sequence[str], *, racing: bool = True, landed: bool = True
    ) -> dict[str, EvaluatedModel | str]:
        """Refit the named effects beside the model before; where that is not possible, say why.

        Args:
            number: of the step, from 1.
            before: the model they are added to.
            names: of the effects.
            racing: leave it at one search where another effect's comes to a cost `OUT_OF_RACE` times lower.
            landed: search from landings too; where that was done and has come to nothing better than the base, without.
        """
        return self._settled(number, self._begun(number, before, names, landed=landed), racing=racing)

    def _begun(
        self, number: int, before: EvaluatedModel, names: Sequence[str], *, landed: bool = True
    ) -> dict[str, BegunFit | str]:
        """Begin to refit the named effects, as far as through the wide scale."""
        train, here = self._split.train.record, before.fit
        known = ValveFile(valve=self._drawn, effect=here.valve.effect)

        def begun(name: str) -> BegunFit | str:
            try:
                found = begun_fit(train, known, (name,), here, landed=landed)
            except InputError as error:
                return error.problem
            # What explains all lacks little, which lies beside it: there is no valley to be crossed.
            return found.gone_on_up_to(0.0) if before.explained else found

        # The dearest, which have the most parameters, first: begun last, they would keep one thread alone at work.
        dearest_first = sorted(names, key=lambda name: -len(self._library[name].parameters))
        return self._each(number, "searching", begun, {name: name for name in dearest_first}, 0.0, 0.5)

    def _raced(
        self, number: int, racers: Mapping[str, BegunFit | str]
    ) -> tuple[dict[str, EvaluatedModel | str], dict[str, BegunFit]]:
        """Refit the effects that are not far behind another on the way; return their models, and those that wait."""
        refused: dict[str, BegunFit | str] = {name: each for name, each in racers.items() if isinstance(each, str)}
        fast, waiting = _parted({name: each for name, each in racers.items() if not isinstance(each, str)})
        for further in (lambda each: each.all_begun(), lambda each: each.carried()):
            fast, slower = _parted(self._each(number, "searching", further, fast, 0.5, 0.6))
            waiting |= slower
        return self._settled(number, refused | fast), waiting

    def _beside(
        self, number: int, before: EvaluatedModel, racers: Mapping[str, BegunFit | str]
    ) -> dict[str, EvaluatedModel | str]:
        """Refit effects beside a model that leaves nothing to explain.

        What it lacks is small, and near: one search tells of any evidence, and only where there is some all are made.
        """
        by_one = partial(self._evaluated_by, lambda each: each.by_one())
        first = self._each(number, "refitting", by_one, racers, 0.5, 0.8, self._known.models)
        evident = {name: racers[name] for name, each in first.items() if _evidence(before, each) > LEAST_INDEPENDENT}
        return first | self._settled(number, evident, racing=False)

    def _evaluated_by(self, search: Callable[[BegunFit], Fit], racer: BegunFit | str) -> EvaluatedModel | str:
        """Return what a search comes to; of one that was refused, or is here, why."""
        try:
            return racer if isinstance(racer, str) else self._evaluated(search(racer))
        except InputError as error:
            return error.problem

    def _noise(self, found: Fit) -> bool:
        """Whether what a fit leaves cannot be told from noise."""
        error = self._error(found, found.valve)
        return leaves_noise(error, error.coordinates(error.composition.theta), SURELY)

    def _settled(
        self, number: int, racers: Mapping[str, BegunFit | str], *, racing: bool = True
    ) -> dict[str, EvaluatedModel | str]:
        """Bring searches to where they stay; one of each effect where that is far behind another's."""
        # Where few effects are left, the searches of each share the threads.
        searched = sum(not isinstance(each, str) for each in racers.values())
        workers, together = max(1, self._workers // max(1, searched)), 2 if searched == 1 else 1

        def first(each: BegunFit | str) -> BegunFit | str:
            if isinstance(each, str):
                return each
            return replace(each, workers=workers).all_begun().carried().settled(together)

        fits = self._each(number, "refitting", first, racers, 0.6, 0.8)
        least = min((each.cost for each in fits.values() if not isinstance(each, str)), default=inf)

        def finished(each: BegunFit) -> Fit:
            lost = racing and each.cost > OUT_OF_RACE * least
            # Of many effects few act in this valve: what has come to nothing is not gone on from here, as a fit would.
            near = each.gone_on_up_to(BEHIND * least if each.shows else 0.0)
            return near.judged(profile=False) if lost else near.finished(profile=False)

        evaluated = partial(self._evaluated_by, finished)
        return self._each(number, "refitting", evaluated, fits, 0.8, 1.0, self._known.models)

    def _each(
        self,
        number: int,
        what: str,
        function: Callable[[S], T],
        by_name: Mapping[str, S],
        begin: float,
        end: float,
        known: dict[str, T] | None = None,
    ) -> dict[str, T]:
        """Apply a function to what is there of each effect, on the workers; tell how far the step is by then."""
        found: dict[str, T] = {}
        known = {} if known is None else known
        with closing(on_threads(function, tuple(by_name.values()), self._workers)) as results:
            for name, each in zip(by_name, results, strict=True):
                found[name] = known[name] = each
                rms_m = _rms_so_far_m(each)
                if rms_m is not None:
                    self._race(number, name, rms_m)
                done = begin + (end - begin) * len(found) / len(by_name)
                self._progress(f"step {number}: {what} {len(by_name)} effects", done)
        return found

    def _left(self, waiting: BegunFit) -> EvaluatedModel:
        return self._evaluated(waiting.left())

    def _evaluated(self, found: Fit) -> EvaluatedModel:
        return evaluated(found, self._split)


def evaluated(fit: Fit, split: Split) -> EvaluatedModel:
    """Return a fit with how it does on what was held out."""
    return EvaluatedModel(fit, block_errors(fit, split), split.floor_m, pressure_errors(fit, split))


def _parted(racers: Mapping[str, BegunFit]) -> tuple[dict[str, BegunFit], dict[str, BegunFit]]:
    """Return those that are in the race on their way, and those that are not."""
    least = min((each.screening_cost for each in racers.values()), default=inf)
    fast = {name: each for name, each in racers.items() if each.screening_cost <= OUT_OF_RACE * least}
    return fast, {name: each for name, each in racers.items() if name not in fast}


def _rms_so_far_m(found: BegunFit | EvaluatedModel | str) -> float | None:
    """Return the rms error, m, of what a search has come to; None if it was refused."""
    if isinstance(found, str):
        return None
    return found.fit.rms_m if isinstance(found, EvaluatedModel) else found.rms_m


def _best(step: EffectStep) -> EvaluatedModel:
    return step.added.model if step.added and step.added.model else step.before


def _models_of(step: EffectStep) -> dict[str, EvaluatedModel | str]:
    """Return the models of a step's candidates by name, or why one could not be fitted, as `judged_step` takes them."""
    return {each.name: each.model or each.rejection_reason for each in step.candidates}


def _leaves(share: float, before: EvaluatedModel, after: EvaluatedModel) -> bool:
    """Whether a model explains not all and leaves more than a share of another's squared errors, rms and typical."""
    floor_m2 = (after.floor_m or 0.0) ** 2
    errors = (
        (before.errors.test_block_m, after.errors.test_block_m),
        (before.errors.test_rmse_m, after.errors.test_rmse_m),
    )
    so_much = all(after_m**2 - floor_m2 > share * (before_m**2 - floor_m2) for before_m, after_m in errors)
    return so_much and not after.explained


def _may_be_none(found: Fit, effect: Effect) -> bool:
    """Whether the interval of an effect's strength holds the value at which it vanishes."""
    return any(
        each.lower <= declared.off <= each.upper
        for key, declared in effect.parameters.items()
        if declared.off is not None and (each := found.parameters.get(f"{effect.name}.{key}"))
    )


def _evidence(before: EvaluatedModel, model: EvaluatedModel | str) -> float:
    """Return the BIC of a model before less that of one with an effect, in independent samples."""
    if isinstance(model, str):
        return -inf
    return gain(before.fit, model.fit, before.errors, model.errors).independent_bic


def _may_stand(candidate: EffectCandidate) -> bool:
    """Whether an effect that was tried may be what is missing, better beside others than alone."""
    return candidate.model is not None and candidate.physical and candidate.evidence > LEAST_BIC


def _cost(model: EvaluatedModel | str) -> float:
    return model.fit.cost if isinstance(model, EvaluatedModel) else inf


def _named(step: EffectStep) -> set[str]:
    """Return the effects that a step's verdict is about."""
    one = (each for each in (step.added, step.bare_equivalent) if each)
    return {each.name for each in (*one, *step.indistinguishable, *step.suspected) if each.model}
