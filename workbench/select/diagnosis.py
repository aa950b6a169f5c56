"""Diagnose: which effect is missing. Every candidate is refitted in full; none is believed for a falling error alone.

A step fits the valve with each effect of the library added, all with the same effort, and accepts what passes the rule
of `evidence` inside its physical range. Before that, the valve without is fitted once more from the base parameters of
the best of those with: an optimiser's failure must not look like physics. The best by robust BIC on the fitted part is
added. Steps go on until the result is explained (it reaches the floor and leaves no structured residual), nothing more
is accepted, or three effects are added.

    adequate      nothing is missing: no effect is accepted, and the valve explains the record without
    missing       these effects, and with them all is explained
    one_of        as missing, but a set of effects does equally well: the experiment that tells them apart comes with it
    unexplained   something is missing that the library does not have; what lowered the error so far is still named.
                  Or the valve scatters so much that a tenth of the motion is left, which no model could explain
    untrusted     the searches disagree, and the best of them explains nothing
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from os import cpu_count
from typing import Literal

from config.errors import InputError
from config.recording import Recording
from config.valve_file import ValveFile, ValveParameters
from sim.composition import Composition
from sim.effect import Effect, Parameter, find_effect, shipped_effects
from workbench.data.held_out import Split, split
from workbench.fit.fitting import Fit, fit, profiled
from workbench.fit.objective import NARROW, SimulationError
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters
from workbench.select.equivalence import algebraic_class, bare_parameter, classes, imitation, told_apart
from workbench.select.evidence import LEAST_BIC, Errors, Gain, alike, bic, errors, fallen, gain, lead
from workbench.select.experiment import Experiment, experiment
from workbench.select.preview import Suspect, preview
from workbench.select.structure import STRUCTURED

MOST_ADDED, MOST_STEPS = 3, 5
"""Effects added at most, and steps made for it: a step that is judged anew is followed by others."""
AT_END = 0.2
"""Of the weakest start: nearer to the end of its range a parameter is at it."""
BETTER = 0.999
"""Factor on the cost at which a base fit counts as better than the one before."""

SCATTERS = 3.0
"""Times the noise: a valve that repeats itself no better scatters."""
REPEAT = " If the valve itself scatters so much, a repeated segment of the command shows it."
LEFT_BEHIND = 1.0
"""Of BIC: less is nothing."""
SAME = 1.01
"""Factor on the cost within which two members of a class came out as the one they are."""

Verdict = Literal["adequate", "missing", "one_of", "unexplained", "untrusted"]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Model:
    """A fit and how it does on what was held out."""

    fit: Fit
    errors: Errors
    at_floor: bool

    @property
    def structured(self) -> bool:
        """Whether the residual still hangs on the state."""
        return self.errors.structure > STRUCTURED

    @property
    def explained(self) -> bool:
        """Whether nothing is left but what no model explains."""
        return self.at_floor and not self.structured

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects in it."""
        return tuple(each.name for each in self.fit.valve.effect)


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect tried in one step. Without a model it could not be fitted; `why_not` says why it is not accepted."""

    step: int
    name: str
    model: Model | None
    gain: Gain | None
    physical: bool
    why_not: str

    @property
    def accepted(self) -> bool:
        """Whether it passes the rule; the best of the accepted is added."""
        return not self.why_not


@dataclass(frozen=True, slots=True)
class Step:
    """One forward step: the model before, all candidates, and the one added with those that do equally well."""

    before: Model
    candidates: tuple[Candidate, ...]
    added: Candidate | None
    renamed: Candidate | None
    """What would be accepted but that it is the bare valve by another name: a parameter that is kept is off."""
    alike: tuple[Candidate, ...]
    """The added one and all that the block errors do not tell from it, by evidence; classes stand together."""
    suspected: tuple[Candidate, ...]
    """Where nothing is added: what would be if more were left to explain, and all that is not told from it."""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """What is missing, and all that led to it."""

    verdict: Verdict
    base: Model
    best: Model
    preview: tuple[Suspect, ...]
    steps: tuple[Step, ...]
    experiment: Experiment | None
    split: Split
    sentence: str

    @property
    def missing(self) -> tuple[str, ...]:
        """The effects added, in order."""
        return tuple(step.added.name for step in self.steps if step.added)

    @property
    def indistinguishable(self) -> tuple[tuple[str, ...], ...]:
        """For each step with more than one equally good effect, their names."""
        return tuple(tuple(each.name for each in step.alike) for step in self.steps if len(step.alike) > 1)

    @property
    def suspected(self) -> tuple[str, ...]:
        """Effects that may be there, but that nothing proves: the valve without them is at the floor."""
        return tuple(each.name for each in self.steps[-1].suspected)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates of all steps."""
        return tuple(each for step in self.steps for each in step.candidates)


def diagnose(
    recording: Recording | Sequence[Recording],
    valve: ValveFile,
    *,
    test: Recording | None = None,
    effects: Sequence[str] | None = None,
    seed: int = 0,
    workers: int | None = None,
    told: Callable[[tuple[Suspect, ...]], None] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the effects that a valve file lacks to explain a recording.

    Args:
        recording: one or several.
        valve: where the fit begins; its own effects stay.
        test: held out; by default the last third of the recording.
        effects: names, or paths of own effects' files, to be tried; by default all that come with the package.
        seed: of the searches.
        workers: threads, by default one a core; the result does not depend on it.
        told: given the tangent preview as soon as it is there.
        progress: told what is being done, and the fraction of it done.

    Raises:
        InputError: the recording holds too little or other units than SI, an unknown effect.
    """
    return _Search(recording, valve, test, effects, seed, workers, progress).diagnosis(told)


class _Search:
    """The forward search, and what it holds on to."""

    def __init__(
        self,
        recording: Recording | Sequence[Recording],
        valve: ValveFile,
        test: Recording | None,
        effects: Sequence[str] | None,
        seed: int,
        workers: int | None,
        progress: Progress | None,
    ) -> None:
        self._split = split([recording] if isinstance(recording, Recording) else recording, test)
        self._valve = valve
        there = {each.name for each in valve.effect}
        named = [find_effect(name, "effects") for name in (shipped_effects() if effects is None else effects)]
        self._library = {each.written: each for each in named if each.written not in there}
        self._seed = seed
        self._workers = workers or cpu_count() or 1
        self._progress = progress or (lambda _what, _done: None)

    def diagnosis(self, told: Callable[[tuple[Suspect, ...]], None] | None) -> Diagnosis:
        base = self._model(self._base(self._valve))
        suspects = preview(base.fit, self._split, self._library)
        if told:
            told(suspects)
        steps = self._steps(base)
        # A base fitted again, and better, takes the place of the first.
        base, last = steps[0].before, steps[-1]
        best = last.added.model if last.added and last.added.model else last.before
        base, best = self._profiled(base), self._profiled(best)
        verdict = _verdict(best, steps, self._split)
        chosen = self._experiment(steps) if verdict == "one_of" else None
        sentence = _sentence(verdict, best, steps, self._library, self._split)
        return Diagnosis(verdict, base, best, suspects, steps, chosen, self._split, sentence)

    def _steps(self, base: Model) -> tuple[Step, ...]:
        steps: list[Step] = []
        here = base
        for _ in range(MOST_STEPS):
            following = self._step(len(steps) + 1, here)
            if steps:
                steps[-1] = self._without_missing(steps[-1], following)
            steps = self._judged_anew([*steps, following])
            added = steps[-1].added
            if added is None or added.model is None or added.model.explained or len(steps) == MOST_ADDED:
                break
            here = added.model
        return tuple(steps)

    def _judged_anew(self, steps: list[Step]) -> list[Step]:
        """Judge an earlier step anew if what was added last does better in it than its own search had found.

        A search that failed there is no reason to keep what was added in its place; all later steps are dropped then.
        """
        last = steps[-1].added
        if last is None or last.model is None:
            return steps
        valve = last.model.fit.valve
        for i, step in enumerate(steps[:-1]):
            effects = (*step.before.fit.valve.effect, *(each for each in valve.effect if each.name == last.name))
            alone = self._model(self._base(ValveFile(valve=valve.valve, effect=effects)))
            models = {each.name: each.model or each.why_not for each in step.candidates}
            tried = models[last.name]
            if not isinstance(tried, Model) or lead(alone.fit, tried.fit) > LEAST_BIC:
                return [*steps[:i], self._judged(step.before, models | {last.name: alone}, i + 1)]
        return steps

    def _without_missing(self, step: Step, following: Step) -> Step:
        """Drop from the equally good what is accepted after the added one too: it is missing as well, not a rival."""
        assert step.added
        still = {each.name for each in following.candidates if each.accepted}
        own = algebraic_class(step.added.name, self._library)
        left = tuple(each for each in step.alike if each.name in own or each.name not in still)
        return replace(step, alike=left)

    def _step(self, number: int, before: Model) -> Step:
        names = [name for name in self._library if name not in before.effects]
        models = self._refitted(number, before, names)
        before = self._seeded_by(before, [each for each in models.values() if isinstance(each, Model)])
        # No effect makes a valve worse: what the base has left behind is refitted from it.
        fitted = {name: each.fit for name, each in models.items() if isinstance(each, Model)}
        behind = [name for name, each in fitted.items() if lead(before.fit, each) > LEFT_BEHIND]
        models |= self._refitted(number, before, behind)
        return self._judged(before, models, number)

    def _judged(self, before: Model, models: Mapping[str, Model | str], number: int) -> Step:
        """Hold every candidate against the model before."""
        candidates = tuple(self._candidate(number, name, before, model) for name, model in models.items())
        renamed = self._renamed(candidates, before.explained)
        candidates, added = self._best(_better_than(renamed, candidates) if renamed else candidates)
        suspect = None if added or renamed else self._suspect(candidates)
        alike, suspected = (self._alike(candidates, each) if each else () for each in (added, suspect))
        return Step(before, candidates, added, renamed, alike, suspected)

    def _seeded_by(self, before: Model, models: Sequence[Model]) -> Model:
        """Return the model before, fitted again where a search from a better one's parameters ends below it."""
        better = [each.fit.valve for each in models if bic(before.fit) - bic(each.fit) > LEAST_BIC]
        imitations = [each for each in map(imitation, better) if each]
        valves = [*(each.valve for each in better), *imitations]
        bare = [ValveFile(valve=valve, effect=before.fit.valve.effect) for valve in valves]
        with ThreadPoolExecutor(self._workers) as pool:
            costs = list(pool.map(partial(self._descended, before.fit), bare))
        if not costs or min(costs) > BETTER * before.fit.cost:
            return before
        return self._model(self._base(bare[costs.index(min(costs))]))

    def _descended(self, base: Fit, valve: ValveFile) -> float:
        """Return the cost at which a search from this valve's parameters ends."""
        composition = Composition.from_file(valve)
        run = FreeRun(composition, self._split.train.record, from_pressure=base.from_pressure)
        parameters = free_parameters(composition, tuple(base.parameters))
        error = SimulationError(run, composition, parameters, composition.theta)
        return error.cost(error.descended_at(NARROW, error.coordinates(composition.theta)))

    def _base(self, valve: ValveFile) -> Fit:
        return fit(
            self._split.train.recording,
            valve,
            seed=self._seed,
            workers=self._workers,
            profile=False,
            progress=lambda done: self._progress("fitting the valve as it is", done),
        )

    def _refitted(self, number: int, before: Model, names: Sequence[str]) -> dict[str, Model | str]:
        """Refit the named effects, each on one thread; where that is not possible, say why."""
        train, here = self._split.train.recording, before.fit

        def refitted(name: str) -> Model | str:
            try:
                found = fit(train, here.valve, effects=(name,), base=here, seed=self._seed, workers=1, profile=False)
            except InputError as error:
                return error.problem
            return self._model(found)

        # The dearest, which have the most parameters, first: begun last, they would keep one thread alone at work.
        dearest_first = sorted(names, key=lambda name: -len(self._library[name].parameters))
        models: dict[str, Model | str] = {}
        with ThreadPoolExecutor(self._workers) as pool:
            for name, model in zip(dearest_first, pool.map(refitted, dearest_first), strict=True):
                models[name] = model
                self._progress(f"step {number}: refitting {len(names)} effects", len(models) / len(names))
        return {name: models[name] for name in names}

    def _profiled(self, model: Model) -> Model:
        return replace(model, fit=profiled(model.fit, self._split.train.recording))

    def _model(self, found: Fit) -> Model:
        judged = errors(found, self._split)
        return Model(found, judged, judged.at_floor(self._split.floor_m))

    def _best(self, candidates: Sequence[Candidate]) -> tuple[tuple[Candidate, ...], Candidate | None]:
        """Return the candidates by evidence, and the best accepted one, or the first of its class."""
        ordered = tuple(sorted(candidates, key=_evidence, reverse=True))
        accepted = {each.name: each for each in ordered if each.accepted}
        if not accepted:
            return ordered, None
        best, first = next(iter(accepted.values())), accepted[min(classes(accepted, self._library)[0])]
        assert best.model
        assert first.model
        # A class is not ranked inside, but a search that failed is no reason to go on from there.
        return ordered, first if first.model.fit.cost < SAME * best.model.fit.cost else best

    def _candidate(self, number: int, name: str, before: Model, model: Model | str) -> Candidate:
        if isinstance(model, str):
            return Candidate(number, name, None, None, False, model)
        found = gain(before.fit, model.fit, before.errors, model.errors)
        beyond = _beyond(name, model.fit, self._library[name])
        same = bare_parameter(name, self._library)
        why_not = beyond or found.short(before.explained)
        if same and not why_not:
            why_not = f"no record of pressure and position tells it from {same}"
        return Candidate(number, name, model, found, not beyond, why_not)

    def _renamed(self, candidates: Sequence[Candidate], explained: bool) -> Candidate | None:
        """Return the best that would be accepted but that it is the bare valve by another name, if there is one."""
        passing = _passing(candidates, explained)
        return max((each for each in passing if bare_parameter(each.name, self._library)), key=_evidence, default=None)

    def _suspect(self, candidates: Sequence[Candidate]) -> Candidate | None:
        """Return what has the most evidence of all that would be accepted if more were left to explain."""
        passing = _passing(candidates, explained=False)
        return max((each for each in passing if self._may_be_there(each)), key=_evidence, default=None)

    def _may_be_there(self, candidate: Candidate) -> bool:
        """Whether an effect is physical, has evidence, and is not the bare valve by another name."""
        evident = candidate.physical and _evidence(candidate) > LEAST_BIC
        return evident and bare_parameter(candidate.name, self._library) is None

    def _alike(self, candidates: Sequence[Candidate], best: Candidate) -> tuple[Candidate, ...]:
        """Return what is not told from the best: itself accepted or not, for what passes by a hair proves no more."""
        assert best.model
        refitted = {each.name: each for each in candidates if each.model}
        as_good = [
            each.name
            for each in refitted.values()
            if self._may_be_there(each) and each.model and alike(best.model.errors.all_logs, each.model.errors.all_logs)
        ]
        # A class is one by algebra, whether or not the search for each of its members succeeded.
        return tuple(
            refitted[name]
            for each in classes(as_good, self._library)
            for name in sorted(algebraic_class(min(each), self._library))
            if name in refitted
        )

    def _experiment(self, steps: Sequence[Step]) -> Experiment | None:
        """Choose the input for the first set with more than one class: one valve of each class."""
        for step in steps:
            fits = {each.name: each.model.fit for each in step.alike if each.model}
            apart = [fits[min(each)] for each in classes(fits, self._library)]
            if len(apart) > 1:
                self._progress("choosing the experiment", 0.0)
                record = self._split.judged.record
                return experiment(apart, record, seed=self._seed, workers=self._workers)
        return None


def _better_than(renamed: Candidate, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Refuse what does no better than the bare valve by another name: no imitation of it is to be named."""
    least = _evidence(renamed) + LEAST_BIC
    why_not = f"explains no better than {renamed.name}, the bare valve with other parameters"
    return tuple(
        replace(each, why_not=why_not) if each.accepted and _evidence(each) <= least else each for each in candidates
    )


def _passing(candidates: Sequence[Candidate], explained: bool) -> list[Candidate]:
    """Return the physical ones that pass the rule, as it is where something is left to explain, or nothing."""
    return [each for each in candidates if each.physical and each.gain and not each.gain.short(explained)]


def _evidence(candidate: Candidate) -> float:
    return candidate.gain.bic if candidate.gain else -float("inf")


def _beyond(name: str, found: Fit, effect: Effect) -> str:
    """Say which parameter of an effect the recording wants beyond its physical range; empty if none."""
    for key, declared in effect.parameters.items():
        parameter = found.parameters.get(f"{effect.name}.{key}")
        if parameter and not parameter.physical and _at_end(parameter.value, declared, found.valve.valve):
            return (
                f"not physical: the recording wants {name}.{key} beyond {parameter.value:.4g}, "
                f"the end of its range from {declared.least:g} to {declared.most:g}"
            )
    return ""


def _at_end(value: float, declared: Parameter, valve: ValveParameters) -> bool:
    """Whether a value lies nearer to an end of the range than a fifth of any start that is not the end itself."""
    starts = declared.starts_for(valve)
    return any(
        abs(value - end) < AT_END * min((abs(start - end) for start in starts if start != end), default=0.0)
        for end in (declared.least, declared.most)
    )


def _verdict(best: Model, steps: Sequence[Step], parts: Split) -> Verdict:
    if best.explained and not best.errors.follows(parts.moved_m):
        return "unexplained"
    added = [step for step in steps if step.added]
    if best.explained and not added:
        return "adequate"
    if best.explained:
        return "one_of" if any(len(step.alike) > 1 for step in added) else "missing"
    return "unexplained" if best.fit.trusted else "untrusted"


def _sentence(verdict: Verdict, best: Model, steps: Sequence[Step], library: Mapping[str, Effect], parts: Split) -> str:
    names = " and ".join(step.added.name for step in steps if step.added)
    before, after = 1e3 * steps[0].before.errors.test_rmse_m, 1e3 * best.errors.test_rmse_m
    fell = fallen(steps[0].before.errors, best.errors)
    repeat = "" if parts.repeats else REPEAT
    renamed = steps[0].renamed
    if verdict == "adequate" and renamed and renamed.model:
        after = 1e3 * renamed.model.errors.test_rmse_m
        return (
            f"No effect is missing, but a parameter that was kept is off: with {renamed.name}, the bare valve by "
            f"another name, the held-out error falls from {before:.3g} to {after:.3g} mm. Fit again with the mass free."
        )
    if verdict == "adequate":
        said = f"Nothing is missing: no effect lowers the held-out error of {after:.3g} mm as it must."
        return said + _suspicion(steps[0].suspected) + _scatter(parts)
    if verdict == "missing":
        return f"Missing: {names}; {fell}, and nothing is left to explain."
    if verdict == "one_of":
        return f"Missing: {names}, or another that does as well; {fell}." + "".join(
            _apart(each, library) for each in steps
        )
    begun = f" {names} explains a part: {fell}." if names else f" The held-out error is {after:.3g} mm."
    if verdict == "unexplained":
        return f"Something is missing that the library does not have.{begun}{repeat}{_scatter(parts)}"
    return f"Not to be trusted: the searches end at different errors.{begun}"


def _suspicion(suspected: Sequence[Candidate]) -> str:
    if not suspected:
        return ""
    best = max(suspected, key=_evidence)
    return (
        f" Suspected, not proved: {' or '.join(each.name for each in suspected)}; of {best.name}, {best.why_not}. "
        "A longer recording would tell."
    )


def _scatter(parts: Split) -> str:
    """Say that the valve scatters, where it does not repeat itself to within what its sensor would let it."""
    noise_m = max(each.record.noise_m for each in (parts.train, parts.judged))
    if parts.floor_m < SCATTERS * noise_m:
        return ""
    return (
        f" The valve itself scatters: a repeated command repeats the position to {1e3 * parts.floor_m:.3g} mm, where "
        f"the sensor's noise is {1e3 * noise_m:.2g} mm. What makes the difference follows neither command nor position."
    )


def _apart(step: Step, library: Mapping[str, Effect]) -> str:
    """Say for a set what would tell its members apart."""
    names = [each.name for each in step.alike]
    if len(names) < 2:
        return ""
    texts = [
        f" {name} or {other}: {told_apart(name, other, library) or 'no record of pressure and position tells'}."
        for i, name in enumerate(names)
        for other in names[i + 1 :]
        if told_apart(name, other, library) or len(classes((name, other), library)) == 1
    ]
    return "".join(texts) or f" Equally good: {', '.join(names)}."
