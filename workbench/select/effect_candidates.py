"""One forward step judged: every refitted effect against the model before, by the rule and by its physical range.

Pure functions of fits and errors: nothing is simulated here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from config.results.result import Brief
from config.valve_file import ValveParameters
from sim.effect import Effect, Parameter
from workbench.fit.fit_result import Fit
from workbench.select.block_errors import (
    SAME_STANDARD_ERRORS,
    BlockErrors,
    indistinguishable,
    relative_error_reduction,
)
from workbench.select.candidate_table import Tried
from workbench.select.effect_acceptance import LEAST_BIC, LEAST_STANDARD_ERRORS, Gain, bic, gain, no_better
from workbench.select.equivalence import algebraic_class, bare_parameter, classes
from workbench.select.forward_selection import Candidate, ForwardStep
from workbench.select.pressure_errors import PressureErrors
from workbench.select.residual_structure import STRUCTURED

AT_END = 0.2
"""Of the weakest start: nearer to the end of its range a parameter is at it."""
NEARLY_AS_EVIDENT = 0.5
"""Of the added one's evidence: with less, an effect is not tried in its place where that leads nowhere."""
SAME_COST = 1.01
"""Factor on the cost within which two members of a class came out as the one they are."""


@dataclass(frozen=True, slots=True, repr=False)
class EvaluatedModel(Brief):
    """A fit and how it does on what was held out."""

    fit: Fit
    errors: BlockErrors
    floor_m: float | None
    """What no model explains, m; None if it is unknown."""
    pressure: PressureErrors | None = None
    """How far its pressure is off, where that was measured."""

    @property
    def at_floor(self) -> bool:
        """Whether no model could do better."""
        return self.errors.at_floor(self.floor_m)

    @property
    def structured(self) -> bool:
        """Whether the residual still hangs on the state, by more than it may of one that is as large as the floor."""
        of_floor = 1.0 if self.floor_m is None else min(1.0, self.errors.rms_floors(self.floor_m))
        return self.errors.structure * of_floor**2 > STRUCTURED

    @property
    def explained(self) -> bool:
        """Whether nothing is left in which an effect would be sought."""
        return self.at_floor and not self.structured

    @property
    def complete(self) -> bool:
        """Whether it explains all, and slides end where it says: else what explains it stands in for something.

        No effect is sought for that: of the library, what has more parameters would only stand in better.
        """
        return self.explained and not (self.errors.rests and self.errors.rests.elsewhere)

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects in it."""
        return tuple(each.name for each in self.fit.valve.effect)


@dataclass(frozen=True, slots=True, repr=False)
class EffectCandidate(Candidate):
    """An effect refitted beside the model before; without a model it could not be fitted."""

    model: EvaluatedModel | None
    gain: Gain | None
    physical: bool
    outdone: bool = False
    """It comes after another effect that explains as much."""

    @property
    def evidence(self) -> float:
        """BIC of the model before less that with the effect; minus infinity if it could not be fitted."""
        return self.gain.bic if self.gain else -float("inf")

    @property
    def tried(self) -> Tried:
        """Its row of the table; without errors where it could not be fitted."""
        if self.model is None:
            return Tried(self.step, self.name, None, None, None, self.gain, self.rejection_reason)
        errors = self.model.errors
        rms_m = (errors.train_rmse_m, errors.test_rmse_m, errors.test_block_m)
        return Tried(self.step, self.name, *rms_m, self.gain, self.rejection_reason)


EffectStep = ForwardStep[EvaluatedModel, EffectCandidate]


def judged_step(
    before: EvaluatedModel, models: Mapping[str, EvaluatedModel | str], number: int, library: Mapping[str, Effect]
) -> EffectStep:
    """Hold every candidate against the model before, and choose the one to be added.

    Args:
        before: the model without any of them.
        models: by the effect's name, its model, or why it could not be fitted.
        number: of the step, from 1.
        library: the effects by name.
    """
    tried = {name: _candidate(number, name, before, model, library) for name, model in models.items()}
    candidates = tuple(_after_first(each, tried.get(library[each.name].after)) for each in tried.values())
    equivalent = _bare_equivalent(candidates, before.at_floor, library)
    candidates, added = _best(_better_than(equivalent, candidates) if equivalent else candidates, library)
    added = added and _backed_by_pressure(added, candidates, library)
    suspect = None if added or equivalent else _suspect(candidates, library)
    rivals, contradicted = _rivals(candidates, added, library) if added else ((), ())
    suspected, _ = _rivals(candidates, suspect, library) if suspect else ((), ())
    return ForwardStep(before, candidates, added, rivals, equivalent, suspected, contradicted)


def runners_up(step: EffectStep, library: Mapping[str, Effect]) -> tuple[EffectCandidate, ...]:
    """Return the accepted effects that might have been added: by what was held out, and by what was fitted.

    The best of the held-out errors, if there it is no worse than the added one; then, in the first step, after which
    the most is still missing, the one with the most evidence, if that is `NEARLY_AS_EVIDENT`. One of the added one's
    class is none: no recording tells them apart; nor is one that a measured pressure speaks against.
    """
    added = step.added
    if added is None or added.model is None:
        return ()
    no_others = algebraic_class(added.name, library) | {each.name for each in step.contradicted}
    others = {
        each.name: each for each in step.candidates if each.accepted and each.model and each.name not in no_others
    }
    logs = {name: each.model.errors.logs for name, each in others.items() if each.model}
    held_out = min(logs, key=lambda name: float(logs[name].mean()), default=None)
    fitted = max(others, key=lambda name: others[name].evidence, default=None)
    found = []
    if held_out is not None and indistinguishable(added.model.errors.logs, logs[held_out]):
        found.append(held_out)
    near = added.step == 1 and fitted is not None and others[fitted].evidence > NEARLY_AS_EVIDENT * added.evidence
    if fitted is not None and near and not algebraic_class(fitted, library) & {*found}:
        found.append(fitted)
    return tuple(others[name] for name in found)


def with_added(step: EffectStep, candidate: EffectCandidate, library: Mapping[str, Effect]) -> EffectStep:
    """Return a step with another of its candidates added."""
    rivals, contradicted = _rivals(step.candidates, candidate, library)
    return replace(step, added=candidate, indistinguishable=rivals, contradicted=contradicted)


def leads_farther(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether one of two models is to be gone on from: it explains all, or does better on what was held out.

    Where that does not tell them apart the evidence on the fitted part does.
    """
    if one.explained != other.explained:
        return one.explained
    _, standard_errors = relative_error_reduction(other.errors.logs, one.errors.logs)
    if abs(standard_errors) > SAME_STANDARD_ERRORS:
        return standard_errors > 0.0
    return bic(other.fit) - bic(one.fit) > LEAST_BIC


def outdoes(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether a model does better than another: by evidence in independent samples, and fitted and held out."""
    _, standard_errors = relative_error_reduction(other.errors.all_logs, one.errors.all_logs)
    evidence = one.errors.independent_share * (bic(other.fit) - bic(one.fit))
    return evidence > LEAST_BIC and standard_errors > LEAST_STANDARD_ERRORS


def _candidate(
    number: int, name: str, before: EvaluatedModel, model: EvaluatedModel | str, library: Mapping[str, Effect]
) -> EffectCandidate:
    if isinstance(model, str):
        return EffectCandidate(number, name, model, None, None, False)
    found = gain(before.fit, model.fit, before.errors, model.errors, before.floor_m)
    beyond = _beyond(name, model.fit, library[name])
    same = bare_parameter(name, library)
    reason = beyond or found.rejection_reason(before.at_floor)
    if same and not reason:
        reason = f"no record of pressure and position tells it from {same}"
    return EffectCandidate(number, name, reason, model, found, not beyond)


def _after_first(candidate: EffectCandidate, first: EffectCandidate | None) -> EffectCandidate:
    """Reject what does no better than the effect that it comes after."""
    if first is None or candidate.evidence > first.evidence + LEAST_BIC:
        return candidate
    return replace(candidate, rejection_reason=candidate.rejection_reason or no_better(first.name), outdone=True)


def _best(
    candidates: Sequence[EffectCandidate], library: Mapping[str, Effect]
) -> tuple[tuple[EffectCandidate, ...], EffectCandidate | None]:
    """Return the candidates by evidence, and the best accepted one, or the first of its class."""
    ordered = tuple(sorted(candidates, key=_evidence, reverse=True))
    accepted = {each.name: each for each in ordered if each.accepted}
    if not accepted:
        return ordered, None
    best = next(iter(accepted.values()))
    assert best.model
    as_evident = [each for each in accepted.values() if each.model and each.evidence > best.evidence - LEAST_BIC]
    # What was fitted does not tell these; what was held out does, if one of them explains that.
    best = next((each for each in as_evident if each.model and each.model.explained), best)
    first = accepted[min(algebraic_class(best.name, library) & accepted.keys())]
    assert best.model
    assert first.model
    # A class is not ranked inside, but a search that failed is no reason to go on from there.
    as_good = first.model.fit.cost < SAME_COST * best.model.fit.cost and first.model.explained == best.model.explained
    return ordered, first if as_good else best


def _bare_equivalent(
    candidates: Sequence[EffectCandidate], at_floor: bool, library: Mapping[str, Effect]
) -> EffectCandidate | None:
    """Return the best that would be accepted but that it is the bare valve by another name, if there is one."""
    passing = _passing(candidates, at_floor)
    return max((each for each in passing if bare_parameter(each.name, library)), key=_evidence, default=None)


def _better_than(equivalent: EffectCandidate, candidates: Sequence[EffectCandidate]) -> tuple[EffectCandidate, ...]:
    """Reject what does no better than the bare valve by another name: no imitation of it is to be named."""
    least = equivalent.evidence + LEAST_BIC
    reason = f"explains no better than {equivalent.name}, the bare valve with other parameters"
    return tuple(
        replace(each, rejection_reason=reason) if each.accepted and each.evidence <= least else each
        for each in candidates
    )


def _suspect(candidates: Sequence[EffectCandidate], library: Mapping[str, Effect]) -> EffectCandidate | None:
    """Return what has the most evidence: of all that would be accepted if more were left, or that have overwhelming."""
    overwhelming = [each for each in candidates if each.gain and each.gain.overwhelming]
    suspects = [*_passing(candidates, at_floor=False), *overwhelming]
    return max((each for each in suspects if _may_be_there(each, library)), key=_evidence, default=None)


def _rivals(
    candidates: Sequence[EffectCandidate], best: EffectCandidate, library: Mapping[str, Effect]
) -> tuple[tuple[EffectCandidate, ...], tuple[EffectCandidate, ...]]:
    """Return what is not told from the best, accepted or not, and what the measured pressure alone tells from it.

    What narrowly passes the rule proves no more than what narrowly does not.
    """
    assert best.model
    logs = best.model.errors.all_logs
    may_be_there = [each for each in candidates if each.model and _may_be_there(each, library)]
    as_good = [each for each in may_be_there if each.model and indistinguishable(logs, each.model.errors.all_logs)]
    models = [each.model for each in as_good if each.model]
    contradicted = tuple(each for each in as_good if each.model and pressure_speaks_against(each.model, models))
    backed = [each.name for each in as_good if each not in contradicted]
    refitted = {each.name: each for each in candidates if each.model}
    # A class is one by algebra, whether or not the search for each of its members succeeded.
    rivals = tuple(
        refitted[name]
        for each in classes(backed, library)
        for name in sorted(algebraic_class(min(each), library))
        if name in refitted
    )
    return rivals, contradicted


def _backed_by_pressure(
    best: EffectCandidate, candidates: Sequence[EffectCandidate], library: Mapping[str, Effect]
) -> EffectCandidate:
    """Return the best, or what does as well on the position, if the measured pressure speaks for that one."""
    backed, _ = _rivals(candidates, best, library)
    return best if best.name in {each.name for each in backed} else max(backed, key=_evidence, default=best)


def pressure_speaks_against(model: EvaluatedModel, others: Sequence[EvaluatedModel]) -> bool:
    """Whether the pressure was measured, and one of the others has it so much better that it is no chance."""
    known = [each.pressure for each in others if each.pressure]
    return model.pressure is not None and any(each.speaks_against(model.pressure) for each in known)


def _may_be_there(candidate: EffectCandidate, library: Mapping[str, Effect]) -> bool:
    """Whether an effect is physical, has evidence, and is not the bare valve by another name."""
    evident = candidate.physical and not candidate.outdone and candidate.evidence > LEAST_BIC
    return evident and bare_parameter(candidate.name, library) is None


def _passing(candidates: Sequence[EffectCandidate], at_floor: bool) -> list[EffectCandidate]:
    """Return the physical ones that pass the rule, as it is where the error before is at the floor, or above."""
    return [
        each
        for each in candidates
        if each.physical and not each.outdone and each.gain and not each.gain.rejection_reason(at_floor)
    ]


def _evidence(candidate: EffectCandidate) -> float:
    return candidate.evidence


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
