"""The search for a form: ranked, fitted, judged as effects are, the nearest taken further.

Forms of the first turn are all fitted; those of the second only where none of the first explains the recordings.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from config.errors import InputError
from config.results.result import Brief
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.discover.found_form import FoundForm
from workbench.discover.grammar import Form
from workbench.discover.proposal import Proposal, proposed
from workbench.fit.fitting import BegunFit, Fit, begun_fit, profiled
from workbench.fit.threads import on_threads
from workbench.select.block_errors import block_errors
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import BETTER, OUT_OF_RACE, EffectSearch, Progress

FIRST, MOST = 5, 15
"""Forms fitted in the first turn, and in both."""
ROUNDS, NEAREST = 2, 2
"""Rounds in which so many forms that came nearest are taken further."""


@dataclass(frozen=True, slots=True, repr=False)
class SearchedForms(Brief):
    """What a search for a form came to."""

    base: EvaluatedModel
    """The valve without a form, fitted again where that did better."""
    candidates: tuple[EffectCandidate, ...]
    """All that was fitted, by evidence, named by the forms' names."""
    found: tuple[FoundForm, ...]
    """What explains the recordings, the best first, then what does as well."""
    untried: tuple[str, ...]
    """Forms that were not fitted."""


@dataclass(frozen=True, slots=True)
class FormSearch:
    """The search for a form over one split recording."""

    split: Split
    valve: ValveFile
    forms: Mapping[str, Form]
    """By the names of their files,"""
    effects: Mapping[str, Effect]
    """the same as effects."""
    seed: int
    workers: int
    tell: Progress

    def run(self, base: EvaluatedModel, on_proposal: Callable[[tuple[str, ...]], None]) -> SearchedForms:
        """Rank and fit the forms, the likeliest first, until one explains all."""
        self.tell("ranking the forms", 0.0)
        order = proposed(base.fit, self.split, self.forms, self.effects, self.workers)
        on_proposal(tuple(self.forms[each.name].name for each in order))
        models: dict[str, EvaluatedModel | str] = {}
        step = judged_step(base, models, 1, self.effects)
        turns = (order[:FIRST], order[FIRST:MOST])
        for turn in turns:
            models |= self._fitted(step.before, turn)
            step = self._judged(step.before, models)
            for _ in range(ROUNDS):
                if _explains(step):
                    break
                models |= self._taken_further(step.before, models)
                step = self._judged(step.before, models)
            if _explains(step):
                break
        rest = tuple(self.forms[each.name].name for each in order if each.name not in models)
        named = tuple(replace(each, name=self.forms[each.name].name) for each in step.candidates)
        return SearchedForms(step.before, named, self._found(step), rest)

    def _fitted(self, base: EvaluatedModel, turn: Sequence[Proposal]) -> dict[str, EvaluatedModel | str]:
        """Fit the valve with each form by two searches; by one where that ends far behind another form's.

        Whether searches agree does not matter here: a form is believed for what it leaves, wherever it was found.
        """
        train, what = self.split.train.recording, f"fitting {len(turn)} forms"

        def begun(each: Proposal) -> BegunFit | str:
            try:
                begun = begun_fit(train, self.valve, (each.name,), base.fit, points=each.points)
                return begun.landed().carried().settled(1)
            except InputError as error:
                return error.problem

        fits: list[BegunFit | str] = []
        for each in on_threads(begun, turn, self.workers):
            fits.append(each)
            self.tell(what, 0.7 * len(fits) / len(turn))
        least = min((each.cost for each in fits if not isinstance(each, str)), default=inf)

        def finished(each: BegunFit | str) -> EvaluatedModel | str:
            if isinstance(each, str):
                return each
            lost = each.cost > OUT_OF_RACE * least
            return evaluated((each if lost else each.settled(1)).judged(profile=False), self.split)

        models: dict[str, EvaluatedModel | str] = {}
        for one, model in zip(turn, on_threads(finished, fits, self.workers), strict=True):
            models[one.name] = model
            self.tell(what, 0.7 + 0.3 * len(models) / len(turn))
        return models

    def _taken_further(
        self, base: EvaluatedModel, models: Mapping[str, EvaluatedModel | str]
    ) -> dict[str, EvaluatedModel | str]:
        """Search again for the forms that came nearest, from where they came to: a stair may have held them up."""
        fitted = {name: each for name, each in models.items() if isinstance(each, EvaluatedModel)}
        nearest = sorted(fitted, key=lambda name: fitted[name].fit.cost)[:NEAREST]

        def again(name: str) -> EvaluatedModel:
            here = fitted[name].fit
            theta = Composition.from_file(here.valve).theta
            bare = theta[: base.fit.seeds[0].size]
            declared = self.effects[name].parameters.values()
            point = tuple(v for v, each in zip(theta[bare.size :].tolist(), declared, strict=True) if not each.given)
            ground = replace(base.fit, seeds=(bare, *base.fit.seeds[-2:]))
            begun = begun_fit(self.split.train.recording, self.valve, (name,), ground, points=[point])
            found = begun.landed().carried().settled(2).judged(profile=False)
            return evaluated(found, self.split) if found.cost < here.cost else fitted[name]

        self.tell(f"taking {len(nearest)} forms further", 0.0)
        return dict(zip(nearest, on_threads(again, nearest, self.workers), strict=True))

    def _judged(self, base: EvaluatedModel, models: Mapping[str, EvaluatedModel | str]) -> EffectStep:
        """Judge the forms, against the bare valve fitted again from the best one's own spring and friction.

        A failure of the bare valve's search must not look like physics.
        """
        step = judged_step(base, models, 1, self.effects)
        if step.added is None or step.added.model is None:
            return step
        bare = ValveFile(valve=step.added.model.fit.valve.valve, effect=base.fit.valve.effect)
        search = EffectSearch(
            self.split, {}, self.valve.valve, seed=self.seed, workers=self.workers, progress=self.tell
        )
        again = search.base(bare)
        return step if again.fit.cost > BETTER * base.fit.cost else judged_step(again, models, 1, self.effects)

    def _found(self, step: EffectStep) -> tuple[FoundForm, ...]:
        """Return what explains the recordings: what a step would add, and what is not told from it."""
        if not _explains(step):
            return ()
        believed = {each.name: each for each in (step.added, *step.indistinguishable) if each}
        models = {name: each.model for name, each in believed.items() if each.model and each.model.explained}
        best, *others = models
        fit = profiled(models[best].fit, self.split.train.recording)
        models[best] = replace(models[best], fit=fit)
        return tuple(FoundForm.of(self.forms[n], self.effects[n], models[n], self.split) for n in (best, *others))


def _explains(step: EffectStep) -> bool:
    """Whether what a step would add passes the rule and leaves nothing to explain."""
    return step.added is not None and step.added.model is not None and step.added.model.explained


def evaluated(fit: Fit, split: Split) -> EvaluatedModel:
    """Return a fit with how it does on what was held out."""
    errors = block_errors(fit, split)
    return EvaluatedModel(fit, errors, errors.at_floor(split.floor_m))
