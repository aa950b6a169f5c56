"""One forward step judged: every refitted effect against the model before, by the rule and by its physical range.

Pure functions of fits and errors: nothing is simulated here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from config.results.result import Brief
from config.valve_file import ValveParameters
from sim.effect import Effect, Parameter
from workbench.fit.fit_result import Fit
from workbench.fit.fit_thresholds import FIT
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.block_errors import BlockErrors, errors_json
from workbench.select.candidate_table import Tried
from workbench.select.effect_acceptance import Gain, gain, no_better
from workbench.select.equivalence import algebraic_class, bare_parameter, classes
from workbench.select.forward_selection import Candidate, ForwardStep
from workbench.select.pressure_errors import PressureErrors
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True, repr=False)
class EvaluatedModel(Brief):
    """A fit and how it does on what was held out."""

    fit: Fit
    errors: BlockErrors
    floor_m: float | None
    """What no model explains, m; None if it is unknown."""
    pressure: PressureErrors | None = None
    """How far its pressure is off, where that was measured."""
    noise_m: float | None = None
    """Of the sensor, m; None: nothing but it scatters."""

    @property
    def at_floor(self) -> bool:
        """Whether no model could do better."""
        return self.errors.at_floor(self.floor_m)

    @property
    def scatters(self) -> bool:
        """Whether the valve repeats itself no better than this is off, and worse than the noise."""
        return self.noise_m is not None and self.at_floor and self.errors.rms_floors(self.noise_m) > SELECTION.at_floor

    @property
    def structured(self) -> bool:
        """Whether the residual still hangs on the state, by more than it may of one that is as large as the floor.

        Within what a valve scatters it may.
        """
        of_floor = 1.0 if self.floor_m is None else min(1.0, self.errors.rms_floors(self.floor_m))
        return not self.scatters and self.errors.structure * of_floor**2 > SELECTION.most_structure

    @property
    def breaks_elsewhere(self) -> bool:
        """Whether the stem breaks loose at other loads than the model has, though it lands where that lands.

        Within what a valve scatters it may.
        """
        return not self.scatters and self.fit.terms.break_aways.mean_square > SELECTION.most_break_away_squares

    @property
    def explained(self) -> bool:
        """Whether nothing is left in which an effect would be sought."""
        return self.at_floor and not self.structured and not self.breaks_elsewhere

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


def model_json(model: EvaluatedModel) -> dict[str, Any]:
    """Return a model in plain types; SI units, in the names."""
    return {
        "effects": list(model.effects),
        **errors_json(model.errors),
        "at_floor": model.at_floor,
        "structure_r2": model.errors.structure,
        "pressure_off_pa": model.pressure.rms_pa if model.pressure else None,
        "parameters": parameters_json(model.fit.parameters),
    }


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
    equivalent = _bare_equivalent(candidates, library)
    candidates, added = _best(_better_than(equivalent, candidates) if equivalent else candidates, library)
    added = added and _backed_by_pressure(added, candidates, library)
    suspect = None if added or equivalent else _suspect(candidates, library)
    rivals, contradicted = _rivals(candidates, added, library) if added else ((), ())
    suspected, _ = _rivals(candidates, suspect, library) if suspect else ((), ())
    return ForwardStep(before, candidates, added, rivals, equivalent, suspected, contradicted)


def with_added(step: EffectStep, candidate: EffectCandidate, library: Mapping[str, Effect]) -> EffectStep:
    """Return a step with another of its candidates added."""
    rivals, contradicted = _rivals(step.candidates, candidate, library)
    added = replace(candidate, rejection_reason="")  # accepted with what comes after it, if not by itself
    candidates = tuple(added if each is candidate else each for each in step.candidates)
    return replace(
        step,
        candidates=candidates,
        added=added,
        bare_equivalent=None,
        suspected=(),
        indistinguishable=rivals,
        contradicted=contradicted,
    )


def outdoes(one: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether a model does better than another, fitted and held out."""
    return not gain(other.fit, one.fit, other.errors, one.errors).rejection_reason


def score_above(one: EvaluatedModel, other: EvaluatedModel) -> float:
    """Return by how much a model is more likely than another: evidence of what was fitted and of what was held out."""
    found = gain(other.fit, one.fit, other.errors, one.errors)
    return found.bic + found.held_out_evidence


def indistinguishable(best: EvaluatedModel, other: EvaluatedModel) -> bool:
    """Whether two models are so nearly as likely that both may be what is missing."""
    return score_above(best, other) < SELECTION.least_evidence


def _candidate(
    number: int, name: str, before: EvaluatedModel, model: EvaluatedModel | str, library: Mapping[str, Effect]
) -> EffectCandidate:
    if isinstance(model, str):
        return EffectCandidate(number, name, model, None, None, False)
    least = SELECTION.overwhelming_evidence if before.scatters else SELECTION.least_evidence
    found = gain(before.fit, model.fit, before.errors, model.errors, least)
    beyond = _beyond(name, model.fit, library[name])
    same = bare_parameter(name, library)
    reason = beyond or found.rejection_reason
    if same and not reason:
        reason = f"no record of pressure and position tells it from {same}"
    return EffectCandidate(number, name, reason, model, found, not beyond)


def _after_first(candidate: EffectCandidate, first: EffectCandidate | None) -> EffectCandidate:
    """Reject what does no better than the effect that it comes after."""
    if first is None or candidate.evidence > first.evidence + SELECTION.least_evidence:
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
    least = best.evidence - SELECTION.least_evidence
    # What was fitted does not tell these; what was held out does, if one of them explains that.
    best = next(
        (each for each in accepted.values() if each.evidence > least and each.model and each.model.explained), best
    )
    first = accepted[min(algebraic_class(best.name, library) & accepted.keys())]
    assert best.model
    assert first.model
    # A class is not ranked inside, but a search that failed is no reason to go on from there.
    as_near = first.model.fit.cost < FIT.ends.same_cost * best.model.fit.cost
    return ordered, first if as_near and first.model.explained == best.model.explained else best


def _bare_equivalent(candidates: Sequence[EffectCandidate], library: Mapping[str, Effect]) -> EffectCandidate | None:
    """Return the best that would be accepted but that it is the bare valve by another name, if there is one."""
    passing = _passing(candidates)
    return max((each for each in passing if bare_parameter(each.name, library)), key=_evidence, default=None)


def _better_than(equivalent: EffectCandidate, candidates: Sequence[EffectCandidate]) -> tuple[EffectCandidate, ...]:
    """Reject what does no better than the bare valve by another name: no imitation of it is to be named."""
    least = equivalent.evidence + SELECTION.least_evidence
    reason = f"explains no better than {equivalent.name}, the bare valve with other parameters"
    return tuple(
        replace(each, rejection_reason=reason) if each.accepted and each.evidence <= least else each
        for each in candidates
    )


def _suspect(candidates: Sequence[EffectCandidate], library: Mapping[str, Effect]) -> EffectCandidate | None:
    """Return what has the most evidence: of all that would be accepted if more were left, or that have overwhelming."""
    overwhelming = [each for each in candidates if each.gain and each.gain.overwhelming]
    suspects = [*_passing(candidates), *overwhelming]
    return max((each for each in suspects if may_be_there(each, library)), key=_evidence, default=None)


def _rivals(
    candidates: Sequence[EffectCandidate], best: EffectCandidate, library: Mapping[str, Effect]
) -> tuple[tuple[EffectCandidate, ...], tuple[EffectCandidate, ...]]:
    """Return what is not told from the best, accepted or not, and what the measured pressure alone tells from it.

    What narrowly passes the rule proves no more than what narrowly does not.
    """
    assert best.model
    there = [each for each in candidates if each.model and may_be_there(each, library)]
    as_good = [each for each in there if each.model and indistinguishable(best.model, each.model)]
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


def may_be_there(candidate: EffectCandidate, library: Mapping[str, Effect]) -> bool:
    """Whether an effect is physical, has evidence, and is not the bare valve by another name."""
    evident = candidate.physical and not candidate.outdone and candidate.evidence > SELECTION.least_evidence
    return evident and bare_parameter(candidate.name, library) is None


def _passing(candidates: Sequence[EffectCandidate]) -> list[EffectCandidate]:
    """Return the physical ones that pass the rule."""
    return [
        each
        for each in candidates
        if each.physical and not each.outdone and each.gain and not each.gain.rejection_reason
    ]


def _evidence(candidate: EffectCandidate) -> float:
    return candidate.evidence


def _beyond(name: str, found: Fit, effect: Effect) -> str:
    """Say which parameter of an effect the recording wants beyond its physical range; empty if none."""
    for key, declared in effect.parameters.items():
        parameter = found.parameters.get(f"{effect.name}.{key}")
        if parameter and not parameter.physical and _at_end(parameter.value, declared, found.valve.valve):
            return (
                f"not physical: the fit takes {name}.{key} beyond {parameter.value:.4g}, "
                f"the end of its range from {declared.least:g} to {declared.most:g}"
            )
    return ""


def _at_end(value: float, declared: Parameter, valve: ValveParameters) -> bool:
    """Whether a value lies nearer to an end of the range than a fifth of any start that is not the end itself."""
    starts = declared.starts_for(valve)
    return any(
        abs(value - end) < SELECTION.at_end * min((abs(start - end) for start in starts if start != end), default=0.0)
        for end in (declared.least, declared.most)
    )
