"""Discover: the form of an effect that nobody has written down. A form, not a cause.

The valve is fitted as it is. If that leaves nothing to explain, no form is sought. Else forms of the grammar are
ranked (`proposal`) and fitted one beside another, as effects' files, by the machinery of a diagnosis: the same
searches, the same rule on what was held out, the same floor. A form is believed only if it passes that rule and
leaves nothing to explain: a falling error alone proves nothing, of many forms less than of few. What does as well
stands beside it. Forms of the first turn are all fitted; the others only where none of these explains the recordings.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from os import cpu_count
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from config.errors import InputError
from config.recording import Recording
from config.results.block import Block
from config.results.result import Result
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import Effect, find_effect
from workbench.data.held_out import Split, split
from workbench.data.noise_floor import told_mm
from workbench.discover.added_force import AddedForce, Landing, added_force, landings, variable_range
from workbench.discover.form_file import form_text, write_forms
from workbench.discover.grammar import FORMS, Form
from workbench.discover.proposal import Proposal, proposed
from workbench.fit.fitted_parameter import parameter_table
from workbench.fit.fitting import BegunFit, Fit, begun_fit, profiled
from workbench.fit.threads import on_threads
from workbench.model.sampling import sampling
from workbench.select.block_errors import block_errors
from workbench.select.candidate_table import MILLIMETRES, Tried, candidate_columns, candidate_table
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import BETTER, OUT_OF_RACE, EffectSearch, Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIRST, MOST = 5, 15
"""Forms fitted in the first turn, and in both: the second where none of the first explains all."""
ROUNDS, NEAREST = 2, 2
"""Rounds in which so many forms that came nearest are taken further."""
LAGS = 5.0
"""Time constants over which a picture shows what fades."""
Outcome = Literal["found", "one_of", "none", "explained", "unjudged"]


@dataclass(frozen=True, slots=True, repr=False)
class FoundForm:
    """A form that explains the recordings: its parameters, and over which range of its variable they show it."""

    form: Form
    model: EvaluatedModel
    values: Mapping[str, float]
    span: tuple[float, float]
    added: AddedForce

    def text(self, source: str) -> str:
        """Return it as an effect's file; `source` says what it was found in."""
        low, high = self.span
        errors = self.model.errors
        values = ", ".join(f"{key} = {value:.6g}" for key, value in self.values.items())
        remarks = (
            "",
            f"Found by `positioner discover` in {source}: {values}. Beside it the valve leaves "
            f"{1e3 * errors.train_rmse_m:.4g} mm rms of what was fitted and {1e3 * errors.test_rmse_m:.4g} mm of what "
            "was held out.",
            f"The recordings show it {_range(self.form, low, high)}; beyond, nothing is known of it.",
        )
        return form_text(self.form, self.values, remarks)


def _range(form: Form, low: float, high: float) -> str:
    if form.variable.name in {"", "direction"}:
        return "as far as the stem went"
    unit = f" {added_unit}" if (added_unit := form_unit(form)) else ""
    return f"over {form.variable.words} from {low:.4g} to {high:.4g}{unit}"


def form_unit(form: Form) -> str:
    """Return the unit of a form's variable, for people."""
    from workbench.discover.added_force import UNITS

    return UNITS.get(form.variable.name, "of the stroke")


@dataclass(frozen=True, slots=True, repr=False)
class Discovery(Result):
    """The form of what is missing, and all that led to it."""

    outcome: Outcome
    base: EvaluatedModel
    found: tuple[FoundForm, ...]
    """The best first, then those that do as well."""
    candidates: tuple[EffectCandidate, ...]
    """All that was fitted, by evidence, named by the forms' names."""
    untried: tuple[str, ...]
    split: Split
    landings: tuple[Landing, ...]

    @property
    def sentence(self) -> str:
        """What was found, in one sentence."""
        floor = told_mm(self.split.floor_m)
        match self.outcome:
            case "explained":
                return "nothing is left to explain: the valve as it is, refitted, is at the floor; no form is sought"
            case "unjudged":
                return "the noise is unknown, and with it whether anything is missing: say it, --noise-m M"
            case "none":
                return f"no form explains the recordings: {self._best_so_far()}, floor {floor}"
        best = self.found[0]
        error = f"{1e3 * best.model.errors.test_rmse_m:.4g} mm rms held out, floor {floor}"
        rivals = f"; {len(self.found) - 1} more do as well" if len(self.found) > 1 else ""
        return f"a form, not a cause: {best.form.words}; {error}{rivals}"

    def _best_so_far(self) -> str:
        fitted = [each for each in self.candidates if each.model]
        if not fitted or not fitted[0].model:
            return "none could be fitted"
        errors = fitted[0].model.errors
        return f"the best, {fitted[0].name}, leaves {1e3 * errors.test_rmse_m:.4g} mm rms held out"

    def blocks(self) -> list[Block]:
        """Say what was found, its equation and parameters, and what was tried."""
        errors = self.base.errors
        title = (
            f"without: error {1e3 * errors.train_rmse_m:.4f} mm rms fitted, {1e3 * errors.test_rmse_m:.4f} held out, "
            f"floor {told_mm(self.split.floor_m)}"
        )
        said: list[Block] = [self.sentence]
        for each in self.found[:1]:
            said += ["\n".join(f"    {line}" for line in each.form.equations)]
            said.append(f"shown {_range(each.form, *each.span)}; beyond, nothing is known of it")
            said.append(parameter_table(each.model.fit.parameters))
        said += [f"does as well: {each.form.words}: {each.form.equations[1]}" for each in self.found[1:]]
        if self.candidates:
            said.append(candidate_table([_tried(each) for each in self.candidates], MILLIMETRES, title))
        if self.untried:
            said.append(f"not fitted in full, behind or not needed: {', '.join(self.untried)}")
        return said

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a form: errors, m, evidence, accepted or why not."""
        return candidate_columns([_tried(each) for each in self.candidates], MILLIMETRES)

    def plot(self) -> "Figure":
        """Draw what the best form adds over its variable, and what the landings miss where it is a force at rest."""
        from config.results.drawing import BETTER, MEASURED, MODEL, QUIET, legend, line, panels

        figure, (axes,) = panels((4.0,))
        if not self.found:
            axes.set_xlabel("position, of the stroke")
            self._draw_landings(axes, {1.0: MEASURED, -1.0: MODEL})
        for each, colour in zip(self.found[:1], (BETTER,), strict=False):
            added = each.added
            if each.form.is_static and each.form.variable.name == "position":
                self._draw_landings(axes, {1.0: MEASURED, -1.0: QUIET})
            for number, (name, values) in enumerate(added.added.items()):
                line(axes, added.over, values, (colour, MODEL, MEASURED, QUIET)[number % 4], name)
            axes.set_xlabel(f"{added.words}, {added.unit}" if added.words else "everywhere")
            axes.set_ylabel(f"added, {added.of}")
            axes.set_title(f"a form, not a cause: {each.form.words}", pad=24, fontsize=10)
        legend(axes)
        return figure

    def _draw_landings(self, axes: object, colours: Mapping[float, str]) -> None:
        """Mark what the balance without the form misses where slides ended in rest."""
        stroke_m = self.base.fit.valve.valve.stroke_m
        for way, words in ((1.0, "missing, landed opening"), (-1.0, "missing, landed closing")):
            there = [each for each in self.landings if each.direction == way]
            x, y = [each.position_m / stroke_m for each in there], [each.missing_n for each in there]
            axes.scatter(x, y, s=14, color=colours[way], label=words, alpha=0.7)  # type: ignore[attr-defined]


def _tried(each: EffectCandidate) -> Tried:
    if each.model is None:
        return Tried(each.step, each.name, None, None, None, each.gain, each.rejection_reason)
    errors = each.model.errors
    rms_m = (errors.train_rmse_m, errors.test_rmse_m, errors.test_block_m)
    return Tried(each.step, each.name, *rms_m, each.gain, each.rejection_reason)


def discover(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    *,
    test: Recording | None = None,
    seed: int = 0,
    workers: int | None = None,
    on_proposal: Callable[[tuple[str, ...]], None] | None = None,
    progress: Progress | None = None,
) -> Discovery:
    """Find the form of what a valve file lacks to explain a recording.

    Args:
        recording: one or several.
        valve: where the fit begins; its own effects stay.
        test: held out; by default the last third of the recording.
        seed: of the searches.
        workers: threads, by default one a core; the result does not depend on it.
        on_proposal: given the forms' names, the likeliest first, as soon as they are there.
        progress: called with what is being done, and the fraction of it done.

    Raises:
        InputError: the recording holds too little or other units than SI.
    """
    parts = split([recording] if isinstance(recording, Recording) else recording, test)
    threads = workers or cpu_count() or 1
    tell = progress or (lambda _what, _done: None)
    by = sampling(parts.train.record, valve.valve)
    base = EffectSearch(parts, {}, valve.valve, seed=seed, workers=threads, progress=tell).base(valve)
    if base.explained or parts.floor_m is None:
        return Discovery("explained" if base.explained else "unjudged", base, (), (), (), parts, ())
    with tempfile.TemporaryDirectory(prefix="forms-") as folder:
        written = write_forms(FORMS, Path(folder))
        effects = {path: find_effect(path, "forms") for path in written}
        effects = {path: each for path, each in effects.items() if not by.left_out(each)}
        search = _FormSearch(parts, valve, {path: written[path] for path in effects}, effects, seed, threads, tell)
        return search.run(base, on_proposal or (lambda _names: None))


@dataclass(frozen=True, slots=True)
class _FormSearch:
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

    def run(self, base: EvaluatedModel, on_proposal: Callable[[tuple[str, ...]], None]) -> Discovery:
        """Rank, race and fit the forms, the likeliest first, until one explains all."""
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
        return self._discovery(step, [each.name for each in order if each.name not in models])

    def _fitted(self, base: EvaluatedModel, turn: Sequence[Proposal]) -> dict[str, EvaluatedModel | str]:
        """Fit the valve with each form by two searches; by one where that ends far behind another form's.

        Whether searches agree does not matter here: a form is believed for what it leaves, wherever it was found.
        """
        train, what = self.split.train.recording, f"fitting {len(turn)} forms"

        def begun(each: Proposal) -> BegunFit | str:
            try:
                return begun_fit(train, self.valve, (each.name,), base.fit, points=each.points)
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
            found = begun.settled(1).judged(profile=False)
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

    def _discovery(self, step: EffectStep, rest: Sequence[str]) -> Discovery:
        believed = (
            {each.name: each for each in (step.added, *step.indistinguishable) if each} if _explains(step) else {}
        )
        explaining = [each for each in believed.values() if each.model and each.model.explained]
        found = tuple(self._found(each, best=i == 0) for i, each in enumerate(explaining))
        outcome: Outcome = "none" if not found else "found" if len(found) == 1 else "one_of"
        return Discovery(
            outcome,
            step.before,
            found,
            tuple(replace(each, name=self.forms[each.name].name) for each in step.candidates),
            tuple(self.forms[name].name for name in rest),
            self.split,
            tuple(landings(step.before.fit, self.split)),
        )

    def _found(self, each: EffectCandidate, *, best: bool) -> FoundForm:
        assert each.model
        form, effect = self.forms[each.name], self.effects[each.name]
        fit = profiled(each.model.fit, self.split.train.recording) if best else each.model.fit
        table = fit.valve.effect[-1]
        values = {key: float(table.parameters[key]) for key in effect.parameters}
        span = variable_range(form, fit, self.split)
        if form.variable.name == "past":
            span = (0.0, LAGS * values["time_constant_s"])
        return FoundForm(form, replace(each.model, fit=fit), values, span, added_force(form, effect, values, span, fit))


def _explains(step: EffectStep) -> bool:
    """Whether what a step would add passes the rule and leaves nothing to explain."""
    return step.added is not None and step.added.model is not None and step.added.model.explained


def evaluated(fit: Fit, split: Split) -> EvaluatedModel:
    """Return a fit with how it does on what was held out."""
    errors = block_errors(fit, split)
    return EvaluatedModel(fit, errors, errors.at_floor(split.floor_m))
