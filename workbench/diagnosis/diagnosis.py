"""Diagnose: which effect is missing. Every candidate is refitted; none is believed for a falling error alone.

The search (`effect_search`) adds effects one after another. From the fit and the errors of each follows what is
accepted (`effect_candidates`, by the rule of `effect_acceptance`), from all steps the verdict and its sentence.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import cpu_count
from typing import TYPE_CHECKING, TypeVar

from config.arguments import kinds_held
from config.drive import Kind
from config.recording import Recording
from config.results.block import Block
from config.results.result import Result
from config.valve_file import ValveFile
from sim.effect import find_effects, tried_effects
from workbench.compare.comparison_sentences import shorten_notes
from workbench.data.held_out import Split, split
from workbench.data.noise_floor import UNKNOWN, say_m
from workbench.diagnosis.doubt import Case, Doubt
from workbench.diagnosis.doubts import with_doubts
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.judged_landings import judged_landings
from workbench.diagnosis.positioner_or_packing import PositionerOrPacking, positioner_or_packing
from workbench.diagnosis.pressure_scale import PressureScale
from workbench.diagnosis.verdict import Verdict, by_another_name, verdict
from workbench.diagnosis.verdict_sentence import floor_by_pressure, verdict_line, verdict_sentence
from workbench.fit.breaking_off import BrokenOff, ending
from workbench.fit.fit_result import Fit
from workbench.fit.threads import linear_algebra_alone
from workbench.model.simulation_regime import sampling
from workbench.select.candidate_table import candidate_columns, candidate_table, draw_race, lengths
from workbench.select.effect_candidates import EffectCandidate, EvaluatedModel
from workbench.select.effect_search import EffectSearch, Progress, Race, model_after
from workbench.select.equivalence import undetectable, unseen_without_spring
from workbench.select.forward_selection import ForwardSelection
from workbench.select.separating_experiment import Experiment
from workbench.select.tangent_preview import TangentScore, preview

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DoubtT = TypeVar("DoubtT", bound=Doubt)
BEFORE_IT = "acts before the measured pressure, which drives the stem"


@dataclass(frozen=True, slots=True, repr=False)
class Diagnosis(Result, ForwardSelection[EvaluatedModel, EffectCandidate]):
    """What is missing, and all that led to it."""

    verdict: Verdict
    base: EvaluatedModel
    best: EvaluatedModel
    preview: tuple[TangentScore, ...]
    experiment: Experiment | None
    split: Split
    given: AsGiven
    """What the valve file leaves before anything is fitted."""
    sentence: str
    unseen: Mapping[str, str] = field(default_factory=dict)
    """Effects that were not tried, and why a recording sampled like this one cannot show them."""
    positioner: PositionerOrPacking | None = None
    """Of a recording of set point and travel: what holds the stem."""
    doubts: tuple[Doubt, ...] = ()
    """What speaks against it as it stands."""

    @property
    def kind(self) -> Kind:
        """Whose it is: its names and units."""
        return self.best.fit.kind

    @property
    def parameters_off(self) -> bool:
        """Whether no effect is missing, and yet the valve file is off: its parameters are."""
        return self.verdict == "adequate" and self.given.is_off(self.best.errors)

    @property
    def nothing_off(self) -> bool:
        """Whether the valve file holds as it is: no effect is missing, and nothing in it is off."""
        return self.verdict == "adequate" and not self.doubts and not by_another_name(self.steps)

    @property
    def sure(self) -> bool:
        """Whether what is missing, or which parameters are off, is known, by forces that are the valve's."""
        another_scale = self.best.fit.from_pressure and self.doubt(PressureScale)
        return (self.verdict == "missing" or self.parameters_off) and not another_scale

    def doubt(self, kind: type[DoubtT]) -> DoubtT | None:
        """Return the doubt of a kind; None if there is none."""
        return next((each for each in self.doubts if isinstance(each, kind)), None)

    @property
    def suspected(self) -> tuple[str, ...]:
        """Effects that may be there, but that nothing proves: the valve without them is at the floor."""
        return tuple(each.name for each in self.steps[-1].suspected)

    @property
    def contradicted(self) -> tuple[str, ...]:
        """Effects that do as well as what was added but for a pressure that was not measured."""
        return tuple(each.name for step in self.steps for each in step.contradicted)

    @property
    def choices(self) -> tuple[tuple[str, ...], ...]:
        """The sets of effects that may be added: what was found first, then one a rival; none where nothing helps.

        Where the parameters alone were off, the empty set: the valve refitted as it is.
        """
        added = self.missing
        if self.parameters_off:
            return ((),)
        if self.verdict not in ("missing", "one_of") or not added:
            return ()
        rivals = [
            (*added[:i], each.name, *added[i + 1 :])
            for i, step in enumerate(step for step in self.steps if step.added)
            for each in step.indistinguishable
            if each.name != added[i]
        ]
        return (added, *rivals)

    def with_those_before(self, step: int, name: str) -> tuple[str, ...]:
        """Return the effects of a candidate's model: those that the steps before the `step`-th added, and it."""
        return (*(each.added.name for each in self.steps[: step - 1] if each.added), name)

    def fit_with(self, effects: Sequence[str]) -> Fit | None:
        """Return the fit of these effects, added to the valve that it began with; None where none was tried."""
        for each in self.candidates:
            if each.model is not None and self.with_those_before(each.step, each.name) == tuple(effects):
                return each.model.fit
        return None

    @property
    def verdict_line(self) -> str:
        """The verdict and its sentence."""
        return verdict_line(self.verdict, self.sentence)

    def blocks(self) -> list[Block]:
        """Say the verdict, what was tried in each step, and what the recordings would not show."""
        said: list[Block] = [self.verdict_line]
        if self.best.fit.by.sentence:
            said.append(self.best.fit.by.sentence)
        records = self.split.records
        noted = dict.fromkeys(note for each in records for note in each.notes)
        in_verdict = {UNKNOWN, *(each.early.sentence for each in records if each.early)}
        said += [f"recording: {note}" for note in shorten_notes([note for note in noted if note not in in_verdict])]
        said += [f"not tried: {', '.join(names)}: it {why}" for why, names in _by_reason(self.unseen).items()]
        if self.best.fit.from_pressure:
            said += floor_by_pressure(self.split, self.kind)
        if self.positioner:
            said.append(self.positioner.sentence)
        length = self.kind.length
        for number, step in enumerate(self.steps, start=1):
            errors = step.before.errors
            title = (
                f"step {number}: error {length.said(errors.train_rmse_m, '.4g')} rms fitted, "
                f"{length.number(errors.test_rmse_m, '.4g')} held out, floor {say_m(self.split.floor_m, length)}"
            )
            said.append(candidate_table([each.tried for each in step.candidates], lengths(self.kind), title))
        if self.experiment:
            said.append(f"experiment: {self.experiment.sentence}")
        return said + [f"not detectable: {each.sentence}" for each in undetectable(self.split, self.best.fit.valve)]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a candidate of each step: errors, m, evidence, accepted or why not."""
        return candidate_columns([each.tried for each in self.candidates], lengths(self.kind))

    def plot(self) -> "Figure":
        """Draw the held-out error with each effect in the first step; those added and their rivals in colour."""
        step = self.steps[0]
        chosen = {*self.missing, *(each.name for each in step.indistinguishable)}
        tried = [each.tried for each in step.candidates]
        return draw_race(tried, chosen, step.before.errors.test_rmse_m, self.split.floor_m, lengths(self.kind))


def _by_reason(unseen: Mapping[str, str]) -> dict[str, list[str]]:
    reasons: dict[str, list[str]] = {}
    for name, why in unseen.items():
        reasons.setdefault(why, []).append(name)
    return reasons


@linear_algebra_alone()
@kinds_held
def diagnose(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    *,
    test: Recording | None = None,
    effects: Sequence[str] | None = None,
    workers: int | None = None,
    on_preview: Callable[[tuple[TangentScore, ...]], None] | None = None,
    progress: Progress | None = None,
    race: Race | None = None,
    over: Callable[[], bool] | None = None,
    from_pressure: bool = False,
) -> Diagnosis:
    """Find the effects that a valve file lacks to explain a recording.

    Broken off by Ctrl-C or by `over`, it says what is known so far: the verdict is then "unfinished".

    Args:
        recording: one or several.
        valve: where the fit begins; its own effects stay.
        test: held out; by default the last third of the recording.
        effects: names, or paths of own effects' files, to be tried; by default all that come with the package.
        workers: threads, by default one a core; the result does not depend on it.
        on_preview: given the tangent preview as soon as it is there.
        progress: called with what is being done, and the fraction of it done.
        race: called with each candidate's error as its search goes on.
        over: asked before each simulation; true breaks the diagnosis off.
        from_pressure: the stem is driven by its measured pressure, and what acts before that is not tried.

    Raises:
        BrokenOff: it is over before the valve as it is was fitted, so that nothing is known.
        KeyboardInterrupt: the same by Ctrl-C.
        InputError: the recording holds too little or other units than SI, an unknown effect.
    """
    parts = split([recording] if isinstance(recording, Recording) else recording, test)
    there = {each.name for each in valve.effect}
    named = find_effects(tried_effects() if effects is None else effects, "effects")
    by = sampling(parts.train.record, valve.valve)
    why = {each.written: by.left_out(each) or unseen_without_spring(each, valve.valve) for each in named}
    if from_pressure:
        why |= {each.written: BEFORE_IT for each in named if "pressure" in each.functions}
    unseen = {name: each for name, each in why.items() if each}
    library = {each.written: each for each in named if each.written not in there and each.written not in unseen}
    threads = workers or cpu_count() or 1
    tell = progress or (lambda _what, _done: None)
    search = EffectSearch(parts, library, valve, workers=threads, progress=tell, race=race, from_pressure=from_pressure)
    is_over = over or (lambda: False)
    with ending(is_over):
        base = search.base(valve)
    parts = search.split
    case = Case(
        verdict="unfinished",
        best=base,
        steps=(),
        valve=valve,
        library=library,
        parts=parts,
        given=AsGiven.of(valve, parts, base.fit),
        workers=threads,
        progress=tell,
    )
    chosen = None
    scores: tuple[TangentScore, ...] = ()
    held = None
    try:
        with ending(is_over):
            if parts.train.record.by_setpoint and not from_pressure and not parts.early:
                held = positioner_or_packing(
                    parts, base, workers=threads, progress=lambda done: tell("positioner or packing", done)
                )
            first = {name: each for name, each in library.items() if each.after not in library}
            scores = preview(base.fit, search.problem, first, threads)
            if on_preview:
                on_preview(scores)
            steps = search.steps(base)
            best = model_after(steps[-1])
            landed = judged_landings(best.fit, parts)
            found = verdict(best, steps, parts.motion_std_m, parts.floor_m, landed, parts.early)
            doubted = with_doubts(replace(case, verdict=found, best=best, steps=steps))
            chosen = search.experiment(steps) if doubted.outcome == "one_of" else None
            case = doubted  # not before: broken off while it seeks an experiment, a diagnosis is unfinished
    except (BrokenOff, KeyboardInterrupt):
        steps = search.so_far(base)
        case = replace(case, best=model_after(steps[-1]), steps=steps)
    return Diagnosis(
        steps=case.steps,
        verdict=case.outcome,
        base=base,
        best=case.best,
        preview=scores,
        experiment=chosen,
        split=parts,
        given=case.given,
        sentence=verdict_sentence(case),
        unseen=unseen,
        positioner=held,
        doubts=case.doubts,
    )
