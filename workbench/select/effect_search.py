"""The search by simulation: a beam of models, every effect of the library fitted beside each.

    score(model) = evidence(model, base) + 2 (log-likelihood of what is held out, less the base's)

A round extends each of the best models, the bare one by every effect, others by those whose tangents promise most, and
ranks all that it comes to by their scores. Rounds go on while some extension is evident, and more than the noise is
left, up to three effects. Of an answer of three the later two are tried without the first. The best
model of all is, of those as likely as the likeliest, that of the fewest effects. Its steps are read off the beam: each
adds the effect that the beam added there, beside all that were tried there.

An effect that comes after another (`AFTER` in its file) is tried where that one has evidence. A class of effects that
are one by algebra stands in a model once. Where several effects explain all, what had evidence in an earlier step is
asked again beside the others: while an effect is missing, its error hides what acts in few places.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from math import inf
from typing import TypeVar

from config.errors import InputError
from config.valve_file import ValveFile
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.fit.fit_problem import Problem, problem
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import Trial, advance, base_fit, finish, glimpse, leave_off, settled
from workbench.fit.threads import on_threads
from workbench.select.block_errors import block_errors
from workbench.select.effect_acceptance import evidence_for, promise
from workbench.select.effect_candidates import (
    EffectStep,
    EvaluatedModel,
    indistinguishable,
    judged_step,
    may_be_there,
    outdoes,
    pressure_speaks_against,
    score_above,
    with_added,
)
from workbench.select.equivalence import algebraic_class, classes
from workbench.select.forward_selection import without_missing
from workbench.select.pressure_errors import pressure_errors
from workbench.select.pressure_scatter import with_pressure_scatter
from workbench.select.selection_thresholds import SELECTION
from workbench.select.separating_experiment import Experiment, experiment
from workbench.select.tangent_preview import Changes, Left, changes, rank

T = TypeVar("T")
S = TypeVar("S")
Progress = Callable[[str, float], None]
Race = Callable[[int, str, float], None]
"""Told of a candidate that is fitted: step, effect, and the rms error, m, that it leaves."""


@dataclass(slots=True)
class _Round:
    """A model, and all that was tried beside it, by the effect's name: a model, or why there is none."""

    before: EvaluatedModel
    added: tuple[str, ...]
    """What the library has added to the base, in order."""
    models: dict[str, EvaluatedModel | str] = field(default_factory=dict)


class EffectSearch:
    """The search over one split recording, and what it holds on to.

    `known` is the valve before any fit: what an effect's drawing gives is scaled by it.
    """

    def __init__(
        self,
        split: Split,
        library: Mapping[str, Effect],
        known: ValveFile,
        *,
        workers: int,
        progress: Progress,
        race: Race | None = None,
        from_pressure: bool = False,
    ) -> None:
        self._split = split
        self._library = library
        self._known = known
        self._workers = workers
        self._progress = progress
        self._race = race or (lambda _step, _name, _rms_m: None)
        self._problem = problem(split.train.record, known.valve, from_pressure=from_pressure)
        self._rounds: dict[tuple[str, ...], _Round] = {}
        self._changes: Changes = {}

    @property
    def problem(self) -> Problem:
        """What is fitted."""
        return self._problem

    @property
    def split(self) -> Split:
        """What it searches in; behind a measured pressure, once a base is fitted, with what that one's noise does."""
        return self._split

    def base(self, valve: ValveFile) -> EvaluatedModel:
        """Fit a valve as it is.

        Raises:
            InputError: the recording holds too little.
        """
        self._progress("fitting the valve as it is", 0.0)
        found = base_fit(self._problem, valve, workers=self._workers)
        self._problem = replace(self._problem, by=found.by)
        self._split = with_pressure_scatter(self._split, found)
        self._progress("fitting the valve as it is", 1.0)
        return self.evaluated(found)

    def evaluated(self, found: Fit) -> EvaluatedModel:
        """Return a fit with how it does on what was held out."""
        return evaluated(found, self._split)

    def steps(self, base: EvaluatedModel) -> tuple[EffectStep, ...]:
        """Search from a fitted valve."""
        beam = [_Round(base, ())]
        for number in range(1, SELECTION.most_added + 1):
            for each in beam:
                self._try_all(number, each)
            found = [model for each in beam for model, _ in self._extended(each)]
            if not found:
                break
            found.sort(key=lambda each: -score_above(each.before, base))
            beam = _one_of_each(found)[: SELECTION.beam]
            if self._leaves_nothing(beam[0].before):
                break
            if beam[0].before.explained:
                beam = beam[:1]
        if without := self._without_first(base):
            self._try_all(2, without)
        steps = self._path(base)
        return tuple(self._asked_beside(each, steps[i:]) for i, each in enumerate(steps, start=1))

    def _without_first(self, base: EvaluatedModel) -> _Round | None:
        """Return the second effect of an answer alone, where the third was not tried beside it: the first may be idle.

        What imitates two effects is ahead of either, and is left in when both are found (floating search; Pudil 1994).
        """
        names = self._best_path(base)
        if len(names) < SELECTION.most_added:
            return None
        _, second, third = names
        alone = self._rounds[()].models.get(second, "comes after another")
        tried = {frozenset((*added, name)) for added, here in self._rounds.items() for name in here.models}
        return None if isinstance(alone, str) or {second, third} in tried else _Round(alone, (second,))

    def so_far(self, base: EvaluatedModel) -> tuple[EffectStep, ...]:
        """Return the steps made so far, as far as they have come; for a search broken off."""
        return tuple(self._path(base))

    def experiment(self, steps: Sequence[EffectStep]) -> Experiment | None:
        """Return the input that separates what the last step does not tell apart; None if none is left to separate."""
        for step in steps:
            fits = {each.name: each.model.fit for each in step.indistinguishable if each.model}
            apart = [fits[min(names)] for names in classes(fits, self._library)]
            if len(apart) > 1:
                return experiment(apart, self._split.train.record, workers=self._workers)
        return None

    def _beside(self, here: _Round) -> dict[str, Effect]:
        """Return the effects that a model does not have, by any name."""
        there = {name for each in here.added for name in algebraic_class(each, self._library)}
        return {name: each for name, each in self._library.items() if name not in there}

    def _screen(self, here: _Round, names: Sequence[str]) -> list[str]:
        """Return the effects whose tangents promise most beside a model, first of them what the best one has.

        The best one is asked about first: by its tangents they are ranked beside all others, too.
        """
        left = Left(here.before.fit, self._problem)
        if not self._changes:
            self._changes = changes(left, {name: self._library[name] for name in names}, self._workers)
        shown = {name: self._changes[name] for name in names if name in self._changes}
        best_one_has = [name for name in names if name not in shown]
        by_tangents = [each.name for each in rank(left, shown)]
        return [*best_one_has, *by_tangents][: SELECTION.screened]

    def _try_all(self, number: int, here: _Round) -> None:
        """Fit every effect beside a model."""
        here.models.clear()
        self._rounds[here.added] = here
        beside = self._beside(here)
        first = [name for name, each in beside.items() if each.after not in self._library]
        self._fit_beside(number, here, first if number == 1 else self._screen(here, first))
        fitted = {name: each for name, each in here.models.items() if not isinstance(each, str)}
        before, least = here.before.fit, SELECTION.least_evidence
        evident = {name for name, each in fitted.items() if evidence_for(each.fit, before) > least}
        after = [
            name
            for name, each in beside.items()
            if each.after in self._library and (each.after in evident or each.after in here.added)
        ]
        if after and not any(map(self._leaves_nothing, fitted.values())):
            self._fit_beside(number, here, after)

    def _fit_beside(self, number: int, here: _Round, names: Sequence[str]) -> None:
        """Race effects beside a model: a glimpse of all, more of the better half, the end of what comes near."""
        # The dearest, which have the most parameters, first: begun last, they would keep one thread alone at work.
        ordered = sorted(names, key=lambda name: -len(self._library[name].parameters))
        before = here.before.fit
        known = ValveFile(valve=self._known.valve, effect=before.valve.effect)
        trials: dict[str, Trial | str] = {}
        alone = {name: (name,) for name in ordered}
        for name, trial in self._each(lambda effects: glimpse(self._problem, known, effects, before), alone):
            trials[name] = trial
            self._progress(f"step {number}: trying {len(ordered)} effects", len(trials) / len(ordered))
        found = {name: each for name, each in trials.items() if not isinstance(each, str)}
        better = sorted(found, key=lambda name: found[name].cost)[: max(SELECTION.beam, (len(found) + 1) // 2)]
        advanced = dict(self._each(advance, {name: found[name] for name in better}))
        found |= {name: each for name, each in advanced.items() if not isinstance(each, str)}
        promised = {
            name: promise(each.terms, each.begun, len(each.like.parameters) - len(before.parameters))
            for name, each in found.items()
        }
        least = min((each.cost for each in found.values()), default=0.0)
        go_on = set(sorted(better, key=lambda name: found[name].cost)[: SELECTION.beam])
        most = SELECTION.going_on_cost * least
        go_on |= {name for name in better if promised[name] > 0.0 and found[name].cost < most}
        trials |= found
        self._fit(number, here, {name: trials[name] for name in ordered if name in go_on}, to_the_end=True)
        step = judged_step(here.before, here.models, number, self._library)
        enough = here.before.explained or any(each.accepted for each in step.candidates)
        # Before it is said that no effect explains a record, each is searched to its end.
        self._fit(number, here, {name: trials[name] for name in ordered if name not in go_on}, to_the_end=not enough)

    def _fit(self, number: int, here: _Round, trials: Mapping[str, Trial | str], *, to_the_end: bool) -> None:
        """Fit what was tried beside a model, to the end or as far as it came."""
        if to_the_end:
            ends = dict(self._each(settled, trials))
            least = min((each.cost for each in ends.values() if not isinstance(each, str)), default=inf)
            fits = self._each(lambda each: self.evaluated(finish(self._problem, each, least)), ends)
        else:
            fits = self._each(lambda each: self.evaluated(leave_off(self._problem, each)), trials)
        for name, model in fits:
            here.models[name] = model
            if not isinstance(model, str):
                self._race(number, name, model.fit.rms_m)

    def _each(self, function: Callable[[T], S], of: Mapping[str, T | str]) -> Iterator[tuple[str, S | str]]:
        """Yield what a function makes of each by its name, or why it makes nothing."""

        def made(each: T | str) -> S | str:
            try:
                return each if isinstance(each, str) else function(each)
            except InputError as error:
                return error.problem

        with closing(on_threads(made, tuple(of.values()), self._workers)) as results:
            yield from zip(of, results, strict=True)

    def _extended(self, here: _Round) -> list[tuple[_Round, bool]]:
        """Return the models to which the effects tried beside a model lead, if evident, and which are accepted.

        What is evident may be gone on from: while another effect is missing, what was held out need not show it.
        """
        if not here.models:
            return []
        step = judged_step(here.before, here.models, len(here.added) + 1, self._library)
        return [
            (_Round(each.model, (*here.added, each.name)), each.accepted)
            for each in step.candidates
            if each.model and (each.accepted or may_be_there(each, self._library))
        ]

    def _leaves_nothing(self, model: EvaluatedModel) -> bool:
        """Whether what is left is the noise: what repeats badly may yet be explained."""
        return model.explained and model.errors.leaves_nothing(self._split.train.record.scale_m)

    def _path(self, base: EvaluatedModel) -> list[EffectStep]:
        """Return the steps that lead to the best model of all."""
        if () not in self._rounds:
            return [judged_step(base, {}, 1, self._library)]
        names = self._best_path(base)
        steps = []
        for i in range(len(names) + 1):
            here = self._rounds.get(names[:i])
            if here is None:
                break
            step = judged_step(here.before, here.models, i + 1, self._library)
            if i < len(names):
                chosen = next(each for each in step.candidates if each.name == names[i])
                step = with_added(step, chosen, self._library)
            elif step.added:
                step = replace(step, added=None, indistinguishable=())
            steps.append(step)
        for i, following in enumerate(steps[1:]):
            if steps[i].added:
                steps[i] = without_missing(steps[i], following, self._library)
        return steps

    def _best_path(self, base: EvaluatedModel) -> tuple[str, ...]:
        """Return what the best model adds: of those as likely as the likeliest, that with the fewest effects.

        Of several, the likeliest that a measured pressure does not speak against.
        """
        found = [
            each
            for here in self._rounds.values()
            for each, accepted in self._extended(here)
            if accepted and outdoes(each.before, base)
        ]
        if not found:
            return ()
        scores = [score_above(each.before, base) for each in found]
        least = max(scores) - SELECTION.least_evidence
        as_good = [each for each, score in zip(found, scores, strict=True) if score > least]
        fewest = min(len(each.added) for each in as_good)
        of_fewest = [each for each in as_good if len(each.added) == fewest]
        models = [each.before for each in of_fewest]
        backed = [each for each in of_fewest if not pressure_speaks_against(each.before, models)]
        best = max(backed or of_fewest, key=lambda each: score_above(each.before, base))
        return min(each.added for each in as_good if self._classes(each) == self._classes(best))

    def _classes(self, here: _Round) -> list[frozenset[str]]:
        """Return the algebraic classes of what a model adds: inside them nothing is ranked."""
        return [frozenset(algebraic_class(name, self._library)) for name in here.added]

    def _asked_beside(self, step: EffectStep, later: Sequence[EffectStep]) -> EffectStep:
        """Return a step with what does as well as the added one beside what later steps have added, too."""
        added, last = step.added, model_after(later[-1] if later else step)
        if added is None or all(each.added is None for each in later) or not last.explained:
            return step
        own = algebraic_class(added.name, self._library)
        # What has evidence alone may do better beside others.
        evident = [each.name for each in step.candidates if each.physical and each.evidence > SELECTION.least_evidence]
        asked = [name for name in evident if name not in own | {*last.effects}]
        if not asked:
            return step
        valve = last.fit.valve
        others = tuple(each for each in valve.effect if each.name != self._library[added.name].name)
        without = self.evaluated(base_fit(self._problem, ValveFile(valve=valve.valve, effect=others)))
        beside = _Round(without, ())
        self._fit_beside(added.step, beside, asked)
        as_good = {
            member
            for name, each in beside.models.items()
            if isinstance(each, EvaluatedModel)
            and indistinguishable(last, each)
            and not pressure_speaks_against(each, [last])
            for member in algebraic_class(name, self._library)
        }
        own_rivals = {each.name for each in step.indistinguishable if each.name in own}
        rivals = tuple(each for each in step.candidates if each.name in own_rivals | as_good and each.physical)
        return replace(step, indistinguishable=rivals)


def evaluated(fit: Fit, split: Split) -> EvaluatedModel:
    """Return a fit with how it does on what was held out."""
    return EvaluatedModel(
        fit, block_errors(fit, split), split.floor_m, pressure_errors(fit, split), split.train.record.scale_m
    )


def _one_of_each(found: Sequence[_Round]) -> list[_Round]:
    """Return rounds without those that have the same effects as one before, in another order."""
    kept: dict[frozenset[str], _Round] = {}
    for each in found:
        kept.setdefault(frozenset(each.added), each)
    return list(kept.values())


def model_after(step: EffectStep) -> EvaluatedModel:
    """Return what a step has come to."""
    return step.added.model if step.added and step.added.model else step.before
