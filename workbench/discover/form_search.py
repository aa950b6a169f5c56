"""The search for a form: ranked, fitted, judged as effects are, the nearest taken further.

The forms of a turn race: one whose searches are far behind another's waits, or that makes nothing of the valve as it is
better, and is told by what it had come to. Where the best of a turn is accepted and leaves something to explain, its
curve is tried: the same place and variable with a free shape. The forms of the second turn are fitted only where none
of this explains the recordings.
"""

import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import TypeVar

from config.errors import InputError
from config.results.result import Brief
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import Effect, find_effect, written_here
from workbench.data.held_out import Split
from workbench.discover.added_force import variable_range
from workbench.discover.curve import curve_of, has_curve
from workbench.discover.form_file import write_forms
from workbench.discover.found_form import FoundForm
from workbench.discover.grammar import FORMS, Form
from workbench.discover.proposal import Proposal, proposed
from workbench.fit.begun_fit import BegunFit
from workbench.fit.fitting import begun_fit, profiled
from workbench.fit.threads import on_threads
from workbench.model.sampling import sampling
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import BETTER, OUT_OF_RACE, EffectSearch, Progress, evaluated

FIRST, MOST = 5, 15
"""Forms fitted in the first turn, and in both."""
IN_RACE = 3.0
"""Factor on the cost of the best of a turn at the same stage, above which a form waits; beside those that are fitted
already it is `OUT_OF_RACE`: on the way costs are higher than where searches stay."""
GAINED = 0.98
"""Factor on the cost of the valve as it is: a form that comes through the middling scale above it is not brought to
where it stays, nor taken further: what it left there would have to be believed for a fiftieth."""
CURVED_BELOW = 0.5
"""Factor on the cost of the valve as it is, below which a form is near enough for its curve to be tried."""
ROUNDS, NEAREST = 2, 2
"""Rounds in which so many forms that came nearest are taken further."""


S = TypeVar("S")
T = TypeVar("T")


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


def searched_forms(
    parts: Split,
    valve: ValveFile,
    base: EvaluatedModel,
    *,
    seed: int,
    workers: int,
    progress: Progress,
    on_proposal: Callable[[tuple[str, ...]], None] | None = None,
    most: int = MOST,
    against: float = inf,
    elsewhere_than: Collection[str] = (),
) -> SearchedForms:
    """Search for a form beside a valve that a recording does not explain.

    Args:
        parts: of the record, fitted and held out.
        valve: where fits begin; its own effects stay.
        base: the same, fitted.
        seed: of the searches.
        workers: threads; the result does not depend on it.
        progress: called with what is being done, and the fraction of it done.
        on_proposal: given the forms' names, the likeliest first, as soon as they are there.
        most: forms that are fitted at most, the likeliest.
        against: cost of what they are held against.
        elsewhere_than: places on the path at which no form is sought; nor is one before a measured pressure.
    """
    by, before_it = sampling(parts.train.record, valve.valve), {"pressure"} if base.fit.from_pressure else set[str]()
    nowhere = before_it.union(elsewhere_than)
    with tempfile.TemporaryDirectory(prefix="forms-") as folder, written_here(Path(folder)):
        written = write_forms([each for each in FORMS if each.place.function not in nowhere], Path(folder))
        effects = {path: find_effect(path, "forms") for path in written}
        effects = {path: each for path, each in effects.items() if not by.left_out(each)}
        forms = {path: written[path] for path in effects}
        search = FormSearch(parts, valve, forms, effects, seed, workers, progress, most, against)
        return search.run(base, on_proposal or (lambda _names: None))


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
    most: int
    """Forms that are fitted at most."""
    against: float
    """Cost of what they are held against: a form far above it waits."""

    def run(self, base: EvaluatedModel, on_proposal: Callable[[tuple[str, ...]], None]) -> SearchedForms:
        """Rank and fit the forms, the likeliest first, until one explains all."""

        def ranking(done: float) -> None:
            self.tell("ranking the forms", done)

        ranking(0.0)
        order = proposed(base.fit, self.split, self.forms, self.effects, self.workers, ranking)
        on_proposal(tuple(self.forms[each.name].name for each in order))
        models: dict[str, EvaluatedModel | str] = {}
        here = _Tried(judged_step(base, models, 1, self.effects), dict(self.forms), dict(self.effects))
        for turn in filter(None, (order[:FIRST], order[FIRST : self.most])):
            models |= self._fitted(here.step.before, turn, min(self.against, _least(models)))
            here = self._judged(here, models)
            for _ in range(ROUNDS):
                if _explains(here.step) or _least(models) > IN_RACE * self.against:
                    break
                models |= self._taken_further(here, models)
                here = self._judged(here, models)
            here = self._with_curve(here, models)
            if _explains(here.step):
                break
        step = here.step
        rest = tuple(self.forms[each.name].name for each in order if each.name not in models)
        named = tuple(replace(each, name=here.forms[each.name].name) for each in step.candidates)
        return SearchedForms(step.before, named, self._found(here), rest)

    def _fitted(self, base: EvaluatedModel, turn: Sequence[Proposal], least: float) -> dict[str, EvaluatedModel | str]:
        """Fit the valve with each form by two searches; those wait that are far behind another's on the way.

        Whether searches agree does not matter here: a form is believed for what it leaves, wherever it was found.
        """
        train, what = self.split.train.record, f"fitting {len(turn)} forms"

        def begun(each: Proposal) -> BegunFit | str:
            try:
                return begun_fit(train, self.valve, (each.name,), base.fit, points=each.points).all_begun()
            except InputError as error:
                return error.problem

        racers = self._each(begun, {each.name: each for each in turn}, what, 0.0, 0.4)
        refused: dict[str, EvaluatedModel | str] = {n: each for n, each in racers.items() if isinstance(each, str)}
        fast = {name: each for name, each in racers.items() if not isinstance(each, str)}
        waiting: dict[str, BegunFit] = {}
        stages: tuple[Callable[[BegunFit], BegunFit], ...] = (BegunFit.carried, lambda each: each.settled(1))
        for i, further in enumerate(stages):
            fast, slower = _parted(fast, least, inf if i == 0 else GAINED)
            waiting |= slower
            fast = self._each(further, fast, what, 0.4 + 0.2 * i, 0.6 + 0.2 * i)
        ended = min((each.cost for each in fast.values()), default=inf)

        def finished(each: BegunFit) -> EvaluatedModel:
            lost = each.cost > IN_RACE * min(least, ended)
            return evaluated((each if lost else each.settled(1)).judged(profile=False), self.split)

        models = self._each(finished, fast, what, 0.8, 1.0)
        left = {name: evaluated(each.left(), self.split) for name, each in waiting.items()}
        return refused | left | models

    def _each(
        self, function: Callable[[S], T], by_name: Mapping[str, S], what: str, begin: float, end: float
    ) -> dict[str, T]:
        """Apply a function to what is there of each form, on the workers."""
        found: dict[str, T] = {}
        for name, each in zip(by_name, on_threads(function, tuple(by_name.values()), self.workers), strict=True):
            found[name] = each
            self.tell(what, begin + (end - begin) * len(found) / len(by_name))
        return found

    def _with_curve(self, here: "_Tried", models: dict[str, EvaluatedModel | str]) -> "_Tried":
        """Try the curve of the best form where it is accepted, near, and leaves something to explain."""
        added = here.step.added
        if added is None or added.model is None or _explains(here.step) or not has_curve(here.forms[added.name]):
            return here
        fit, before = added.model.fit, here.step.before
        if fit.cost > CURVED_BELOW * before.fit.cost:
            return here
        form, effect = here.forms[added.name], here.effects[added.name]
        self.tell(f"giving {form.name} a free shape", 0.0)
        values = {key: float(fit.valve.effect[-1].parameters[key]) for key in effect.parameters}
        curve, heights = curve_of(form, values, variable_range(form, fit, self.split))
        (path,) = write_forms([curve], Path(added.name).parent)
        effects = {**here.effects, path: find_effect(path, "forms")}
        ground = replace(before.fit, seeds=(Composition.from_file(fit.valve).theta[: before.fit.seeds[0].size],))
        begun = begun_fit(self.split.train.record, self.valve, (path,), ground, landed=False, points=[heights])
        models[path] = evaluated(begun.carried().settled(2).judged(profile=False), self.split)
        return self._judged(_Tried(here.step, {**here.forms, path: curve}, effects), models)

    def _taken_further(
        self, tried: "_Tried", models: Mapping[str, EvaluatedModel | str]
    ) -> dict[str, EvaluatedModel | str]:
        """Search again for the forms that came nearest, from where they came to: a stair may have held them up."""
        base = tried.step.before
        fitted = {
            name: each
            for name, each in models.items()
            if isinstance(each, EvaluatedModel) and each.fit.cost <= GAINED * base.fit.cost
        }
        nearest = sorted(fitted, key=lambda name: fitted[name].fit.cost)[:NEAREST]

        def again(name: str) -> EvaluatedModel:
            here = fitted[name].fit
            theta = Composition.from_file(here.valve).theta
            bare = theta[: base.fit.seeds[0].size]
            declared = tried.effects[name].parameters.values()
            point = tuple(v for v, each in zip(theta[bare.size :].tolist(), declared, strict=True) if not each.given)
            ground = replace(base.fit, seeds=(bare, *base.fit.seeds[-2:]))
            begun = begun_fit(self.split.train.record, self.valve, (name,), ground, points=[point])
            found = begun.all_begun().carried().settled(2).judged(profile=False)
            return evaluated(found, self.split) if found.cost < here.cost else fitted[name]

        self.tell(f"taking {len(nearest)} forms further", 0.0)
        return dict(zip(nearest, on_threads(again, nearest, self.workers), strict=True))

    def _judged(self, here: "_Tried", models: Mapping[str, EvaluatedModel | str]) -> "_Tried":
        """Judge the forms, against the bare valve fitted again from the best one's own spring and friction.

        A failure of the bare valve's search must not look like physics.
        """
        base = here.step.before
        step = judged_step(base, models, 1, here.effects)
        if step.added is None or step.added.model is None:
            return replace(here, step=step)
        bare = ValveFile(valve=step.added.model.fit.valve.valve, effect=base.fit.valve.effect)
        search = EffectSearch(
            self.split,
            {},
            self.valve.valve,
            seed=self.seed,
            workers=self.workers,
            progress=self.tell,
            from_pressure=base.fit.from_pressure,
        )
        again = search.base(bare)
        better = again.fit.cost <= BETTER * base.fit.cost
        return replace(here, step=judged_step(again, models, 1, here.effects) if better else step)

    def _found(self, here: "_Tried") -> tuple[FoundForm, ...]:
        """Return what explains the recordings: what a step would add, and what is not told from it."""
        step = here.step
        if not _explains(step):
            return ()
        believed = {each.name: each for each in (step.added, *step.indistinguishable) if each}
        models = {name: each.model for name, each in believed.items() if each.model and each.model.complete}
        best, *others = models
        fit = profiled(models[best].fit, self.split.train.recording)
        models[best] = replace(models[best], fit=fit)
        return tuple(FoundForm.of(here.forms[n], here.effects[n], models[n], self.split) for n in (best, *others))


@dataclass(frozen=True, slots=True)
class _Tried:
    """A step of the search so far, and what its candidates are: forms by their files' names, the same as effects."""

    step: EffectStep
    forms: Mapping[str, Form]
    effects: Mapping[str, Effect]


def _least(models: Mapping[str, EvaluatedModel | str]) -> float:
    return min((each.fit.cost for each in models.values() if isinstance(each, EvaluatedModel)), default=inf)


def _parted(
    racers: Mapping[str, BegunFit], least: float, gained: float
) -> tuple[dict[str, BegunFit], dict[str, BegunFit]]:
    """Return those that are in the race on their way and gain something, and those that are not."""
    here = {name: each.screening_cost for name, each in racers.items()}
    limit = min(IN_RACE * min(here.values(), default=inf), OUT_OF_RACE * least)
    fast = {name: each for name, each in racers.items() if here[name] <= limit and each.gain <= gained}
    return fast, {name: each for name, each in racers.items() if name not in fast}


def _explains(step: EffectStep) -> bool:
    """Whether what a step would add passes the rule and leaves nothing to explain."""
    return step.added is not None and step.added.model is not None and step.added.model.complete
