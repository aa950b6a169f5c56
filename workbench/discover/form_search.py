"""The search for a form: ranked, fitted, judged as effects are (`select.effect_acceptance`).

The likeliest are fitted first, and those of the second turn only where none of the first leaves nothing to explain.
Where the best is accepted, near, and leaves something, its curve is tried: the same place and variable, a free shape.
"""

import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path

from config.errors import InputError
from config.results.result import Brief
from config.valve_file import ValveFile
from sim.effect import Effect, find_effect, written_here
from workbench.data.held_out import Split
from workbench.discover.added_force import variable_range
from workbench.discover.curve import curve_of, has_curve
from workbench.discover.form_file import write_forms
from workbench.discover.form_proposal import Point, propose_forms
from workbench.discover.found_form import FoundForm
from workbench.discover.grammar import FORMS, Form
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import advance, finish, glimpse, problem_of, settled
from workbench.fit.threads import on_threads
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import Progress, evaluated

FIRST_TURN_FORMS, MOST_FORMS = 5, 15
"""Forms fitted in the first turn, and in both."""
CURVED_BELOW = 0.5
"""Factor on the cost of the valve as it is, below which a form is near enough for its curve to be tried."""
FAR = "comes to nothing near what was named"


@dataclass(frozen=True, slots=True, repr=False)
class SearchedForms(Brief):
    """What a search for a form came to."""

    candidates: tuple[EffectCandidate, ...]
    """All that was fitted, by evidence, named by the forms' names."""
    found: tuple[FoundForm, ...]
    """What explains the recordings, the best first, then what does as well."""
    untried: tuple[str, ...]
    """Forms that were not fitted."""


def search_forms(
    parts: Split,
    valve: ValveFile,
    base: EvaluatedModel,
    *,
    workers: int,
    progress: Progress,
    on_proposal: Callable[[tuple[str, ...]], None] | None = None,
    most: int = MOST_FORMS,
    elsewhere_than: Collection[str] = (),
    most_cost: float = inf,
) -> SearchedForms:
    """Search for a form beside a valve that a recording does not explain.

    Args:
        parts: of the record, fitted and held out.
        valve: as it was before any fit; its own effects stay.
        base: the same, fitted.
        workers: threads; the result does not depend on it.
        progress: called with what is being done, and the fraction of it done.
        on_proposal: given the forms' names, the likeliest first, as soon as they are there.
        most: forms that are fitted at most, the likeliest.
        elsewhere_than: places on the path at which no form is sought; nor is one before a measured pressure.
        most_cost: of a coarse search, up to which a form is fitted to its end.
    """
    nowhere = {*elsewhere_than, *({"pressure"} if base.fit.from_pressure else ())}
    of = problem_of(base.fit, parts.train.record)
    with tempfile.TemporaryDirectory(prefix="forms-") as folder, written_here(Path(folder)):
        written = write_forms([each for each in FORMS if each.place.function not in nowhere], Path(folder))
        effects = {path: find_effect(path, "forms") for path in written}
        shown = {path: each for path, each in effects.items() if not of.by.left_out(each)}
        search = FormSearch(parts, of, valve, base, written, shown, workers, progress, most_cost)
        return search.run(on_proposal or (lambda _names: None), most)


@dataclass(slots=True)
class FormSearch:
    """The search for a form over one split recording."""

    split: Split
    of: Problem
    valve: ValveFile
    base: EvaluatedModel
    forms: dict[str, Form]
    """By the names of their files,"""
    effects: dict[str, Effect]
    """the same as effects."""
    workers: int
    tell: Progress
    most_cost: float
    """Of a coarse search, beyond which a form is not fitted to its end."""

    def run(self, on_proposal: Callable[[tuple[str, ...]], None], most: int) -> SearchedForms:
        """Rank and fit the forms, the likeliest first, until one leaves nothing to explain."""
        order = propose_forms(
            self.base.fit, self.of, self.effects, self.workers, lambda done: self.tell("ranking the forms", done)
        )
        on_proposal(tuple(self.forms[each.name].name for each in order))
        models: dict[str, EvaluatedModel | str] = {}
        step = self._judge(models)
        for turn in filter(None, (order[:FIRST_TURN_FORMS], order[FIRST_TURN_FORMS:most])):
            models |= self._fit_forms({each.name: each.points for each in turn})
            step = self._judge(models)
            if curve := self._curve(step):
                models |= curve
                step = self._judge(models)
            if _leaves_nothing(step):
                break
        untried = tuple(self.forms[each.name].name for each in order if each.name not in models)
        named = tuple(replace(each, name=self.forms[each.name].name) for each in step.candidates)
        return SearchedForms(named, self._found(step), untried)

    def _fit_forms(self, points: Mapping[str, Sequence[Point]]) -> dict[str, EvaluatedModel | str]:
        """Fit the valve with each form, from these points."""
        found: dict[str, EvaluatedModel | str] = {}
        names, base = tuple(points), self.base.fit
        fitted = on_threads(lambda name: self._model(name, points[name], base), names, self.workers)
        for name, model in zip(names, fitted, strict=True):
            found[name] = model
            self.tell(f"fitting {len(points)} forms", len(found) / len(points))
        return found

    def _model(self, name: str, points: Sequence[Point], base: Fit) -> EvaluatedModel | str:
        """Return the model with a form, or why there is none."""
        known = ValveFile(valve=self.valve.valve, effect=base.valve.effect)
        try:
            trial = advance(glimpse(self.of, known, (name,), base, points=points))
            return FAR if trial.cost > self.most_cost else evaluated(finish(self.of, settled(trial)), self.split)
        except InputError as error:
            return error.problem

    def _curve(self, step: EffectStep) -> dict[str, EvaluatedModel | str]:
        """Fit the curve of the best form where it is accepted, near, and leaves something to explain."""
        added = step.added
        if added is None or added.model is None or _leaves_nothing(step) or not has_curve(self.forms[added.name]):
            return {}
        fit = added.model.fit
        if fit.cost > CURVED_BELOW * self.base.fit.cost:
            return {}
        form, values = self.forms[added.name], _values(fit, self.effects[added.name])
        self.tell(f"giving {form.name} a free shape", 0.0)
        curve, heights = curve_of(form, values, variable_range(form, fit, self.split))
        (path,) = write_forms([curve], Path(added.name).parent)
        self.forms[path], self.effects[path] = curve, find_effect(path, "forms")
        bare = ValveFile(valve=fit.valve.valve, effect=self.base.fit.valve.effect)
        return {path: self._model(path, [heights], replace(self.base.fit, valve=bare, onsets_s=fit.onsets_s))}

    def _judge(self, models: Mapping[str, EvaluatedModel | str]) -> EffectStep:
        return judged_step(self.base, models, 1, self.effects)

    def _found(self, step: EffectStep) -> tuple[FoundForm, ...]:
        """Return what explains the recordings: what a step would add, and what is not told from it."""
        if step.added is None or not (step.added.model and step.added.model.explained):
            return ()
        believed = {each.name: each.model for each in (step.added, *step.indistinguishable)}
        return tuple(
            FoundForm.of(self.forms[name], self.effects[name], model, self.split)
            for name, model in believed.items()
            if model and model.explained
        )


def _values(fit: Fit, effect: Effect) -> dict[str, float]:
    """Return the parameters of the form that was fitted last."""
    return {key: float(fit.valve.effect[-1].parameters[key]) for key in effect.parameters}


def _leaves_nothing(step: EffectStep) -> bool:
    """Whether what a step would add passes the rule, explains the recordings, and leaves no more than the floor."""
    model = step.added.model if step.added else None
    return model is not None and model.explained and model.errors.leaves_nothing(model.floor_m)
