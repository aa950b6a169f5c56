"""A verdict in a sentence: what is missing, by how much the error fell, and what would tell rivals apart."""

from collections.abc import Mapping, Sequence
from itertools import combinations

from config.drive import Kind, Scale
from sim.composition import BASE, COULOMB, STATIC
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.data.noise_floor import UNKNOWN
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.diagnosis.doubt import Case
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.judged_landings import unknown_between_samples
from workbench.diagnosis.verdict import Verdict, by_another_name
from workbench.fit.fit_result import Fit
from workbench.select.block_errors import BlockErrors
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel
from workbench.select.equivalence import classes, distinguishing_record
from workbench.select.selection_thresholds import SELECTION

OF_COMMAND = "the floor is the repeatability under the command; driven by the measured pressure, less may be left"
BREAKS_ELSEWHERE = " The stem breaks loose at other loads than this model has."
REPEAT = " To see whether the valve itself scatters so much, let the command repeat a stretch."


def verdict_line(verdict: Verdict, sentence: str) -> str:
    """Return a verdict and its sentence in one line; what both say is said once."""
    word = "one of several" if verdict == "one_of" else verdict
    return f"{word}: {sentence.removeprefix(f'{verdict.capitalize()}: ')}"


def verdict_sentence(case: Case) -> str:
    """Return the verdict and its doubts in a few sentences, in the names and units of what was diagnosed."""
    kind = case.best.fit.kind
    said = kind.text(_said(case) + (_no_break_away(case.best.fit) if case.explained else ""))
    return said + "".join(f" But {each.sentence(kind)}." for each in case.doubts)


def _said(case: Case) -> str:
    verdict, best, steps, library, parts = case.outcome, case.best, case.steps, case.library, case.parts
    length = best.fit.kind.length
    names = " and ".join(step.added.name for step in steps if step.added)
    fell = reduction_sentence(steps[0].before.errors, best.errors, length)
    repeat = "" if parts.repeats else REPEAT
    or_another = ", or another that does as well" if verdict == "one_of" else ""
    apart = "".join(rivals_sentence([each.name for each in step.indistinguishable], library) for step in steps)
    by_pressure = "".join(_by_pressure(step, best.fit.kind) for step in steps)
    off = _kept_off(by_another_name(steps), best)
    if off and case.explained:
        begun = f"Missing: {names}{or_another}; {fell}. But" if names else "No effect is missing, but"
        return f"{begun} {off}{apart}"
    suspicion = _suspicion(steps[-1].suspected)
    if verdict == "adequate":
        said = _adequate(best.errors, parts, length, case.given)
        return said + suspicion + _scatter(parts, length)
    if verdict in ("missing", "one_of"):
        all_known = verdict == "one_of" and _floors_left(best.errors, parts) <= SELECTION.noise_known_to
        left = "" if all_known else f", and {_left(best.errors, parts, steps[-1].suspected)}"
        rivals = apart if verdict == "one_of" else ""
        return f"Missing: {names}{or_another}; {fell}{left}.{rivals}{by_pressure}{suspicion}"
    several = sum(step.added is not None for step in steps) > 1
    lowers, explains = ("lower", "explain") if several else ("lowers", "explains")
    part = f"{lowers} it" if verdict in ("unjudged", "unfinished") else f"{explains} a part"
    begun = f" {names} {part}: {fell}." if names else f" The held-out error is {length.said(best.errors.test_rmse_m)}."
    if verdict == "unexplained":
        told = suspicion or any(each.physical and _tells(each) for each in steps[-1].candidates)
        lacked = "no effect here is proved to explain" if told else "the library does not have"
        said = f"Something is missing that {lacked}.{begun}"
        loose = BREAKS_ELSEWHERE if best.breaks_elsewhere else ""
        return f"{said}{loose}{suspicion}{repeat}{_scatter(parts, length)}"
    return _unproved(case) + begun + (suspicion if verdict == "untrusted" else "")


def _tells(candidate: EffectCandidate) -> bool:
    """Whether the fitted part has evidence for a candidate, in independent samples: it may be what is missing."""
    return candidate.gain is not None and candidate.gain.bic > SELECTION.least_evidence


def floor_by_pressure(parts: Split, kind: Kind) -> list[str]:
    """Say, of a stem that is driven by its measured pressure, what the floor has of that."""
    scatter, about = parts.by_pressure, f"the noise of the measured {kind.command.word}"
    if scatter is None:
        about += " does not show at rest, and is not part of the floor"
    else:
        noise, moved = kind.command.read.said(scatter.noise_pa, ".2g"), kind.length.said(scatter.typical_m, ".2g")
        about += f", {noise}, moves the stem by {moved} in a typical second; this is part of the floor"
    return [kind.text(each) for each in ((OF_COMMAND, about) if parts.repeats else (about,))]


def _no_break_away(found: Fit) -> str:
    """Say that static friction came out at its least, with a leading space; empty where it did not, or that shows.

    Where samples are far apart a break-away falls between two of them, and an interval tells only of what is seen.
    """
    static, coulomb_n = found.parameters.get(BASE[STATIC]), found.valve.valve.coulomb_n
    most_n = DIAGNOSIS.static_at_least * coulomb_n
    if not found.by.slow or static is None or not static.at_bound or static.value > most_n:
        return ""
    return (
        f" The samples are too far apart to show a break-away: {BASE[STATIC]} came out at {BASE[COULOMB]}, the least "
        "it can be, and may be more."
    )


def _kept_off(equivalent: EffectCandidate | None, best: EvaluatedModel) -> str:
    """Say that a parameter is off which no fit has moved; empty where nothing does better by another name."""
    if equivalent is None or equivalent.model is None:
        return ""
    fell = reduction_sentence(best.errors, equivalent.model.errors, best.fit.kind.length)
    return (
        f"a parameter that is not fitted is wrong: with {equivalent.name}, which acts like another mass, {fell}. "
        "Put the mass_kg that plate, stem and plug weigh into the valve file, and diagnose again."
    )


def _adequate(errors: BlockErrors, parts: Split, length: Scale, given: AsGiven) -> str:
    """Say that the valve explains the record, whether it had to be refitted for that, and what it leaves of it."""
    after, floors = length.said(errors.test_rmse_m), _floors_left(errors, parts)
    much = floors > SELECTION.noise_known_to
    left = f" {floors:.2g} times the floor is left, which no effect here explains." if much else ""
    if given.is_off(errors):
        fell = f"from {length.number(given.errors.test_rmse_m)} to {after}"
        return f"No effect is missing: the parameters were wrong. Refitted, the held-out error falls {fell}.{left}"
    return f"Nothing is missing: no effect lowers the held-out error, {after}, by more than chance.{left}"


def _floors_left(errors: BlockErrors, parts: Split) -> float:
    return errors.floors_left(parts.floor_m) if parts.floor_m else 1.0


def _left(errors: BlockErrors, parts: Split, suspected: Sequence[EffectCandidate]) -> str:
    """Say what an explained record leaves."""
    floors = _floors_left(errors, parts)
    if floors <= SELECTION.noise_known_to:
        return "nothing is left to explain"
    explains = "is proved to explain" if suspected else "here explains"
    return f"{floors:.2g} times the floor is left, which no other effect {explains}"


def _unproved(case: Case) -> str:
    """Say why nothing is judged."""
    if case.outcome == "unjudged":
        return f"Not judged: {_not_known(case.best, case.parts)}"
    if case.outcome == "untrusted":
        return "Not to be trusted: searches from independent starts end at different parameters."
    last = case.steps[-1]
    tried = sum(each.model is not None for each in last.candidates)
    missing = sum(name not in last.before.effects for name in case.library)
    return f"Broken off in step {len(case.steps)}, with {tried} of {missing} effects refitted; nothing is judged."


def _not_known(best: EvaluatedModel, parts: Split) -> str:
    if parts.early:
        return f"{parts.early.sentence}. {parts.early.advice}."
    return f"{UNKNOWN}." if parts.floor_m is None else unknown_between_samples(best.fit, parts)


def reduction_sentence(before: BlockErrors, after: BlockErrors, length: Scale) -> str:
    """Say how the held-out error falls; where one that went wrong outweighs all others, in a typical move."""
    whole = f"from {length.number(before.test_rmse_m)} to {length.said(after.test_rmse_m)}"
    if after.test_rmse_m < before.test_rmse_m:
        return f"the held-out error falls {whole}"
    typical = f"from {length.number(before.test_block_m)} to {length.said(after.test_block_m)}"
    return f"the held-out error of a typical move falls {typical}, though the rms rises {whole}"


def rivals_sentence(names: Sequence[str], library: Mapping[str, Effect]) -> str:
    """Say what would tell equally good effects apart, with a leading space; empty for fewer than two."""
    if len(names) < 2:
        return ""
    texts = []
    for name, other in combinations(names, 2):
        if record := distinguishing_record(name, other, library):
            texts.append(f" To tell {name} from {other}, look at {record}.")
        elif len(classes((name, other), library)) == 1:
            texts.append(f" No record of pressure and position tells {name} from {other}.")
    return "".join(texts) or f" Equally good: {', '.join(names)}."


def _by_pressure(step: EffectStep, kind: Kind) -> str:
    """Say what the measured pressure speaks against, with a leading space; empty where it need not be asked."""
    added = step.added and step.added.model and step.added.model.pressure
    off = [
        f"{each.name}'s by {kind.command.read.said(of.rms_pa)}"
        for each in step.contradicted
        if each.model and (of := each.model.pressure)
    ]
    if not added or not step.added or not off:
        return ""
    return (
        f" The measured {kind.command.word} tells them apart: {step.added.name}'s is off by "
        f"{kind.command.read.said(added.rms_pa)} rms, {', '.join(off)}."
    )


def _suspicion(suspected: Sequence[EffectCandidate]) -> str:
    if not suspected:
        return ""
    best = max(suspected, key=lambda each: each.evidence)
    return (
        f" Suspected, not proved: {' or '.join(each.name for each in suspected)}; of {best.name}, "
        f"{best.rejection_reason}. A longer recording would show it."
    )


def _scatter(parts: Split, length: Scale) -> str:
    """Say that the valve scatters, where it does not repeat itself to within what its sensor would let it.

    Of a floor that has the noise of a measured pressure that is not known.
    """
    known = [each.record.noise_m for each in (parts.train, parts.test) if each.record.noise_m is not None]
    noise_m = max(known, default=None)
    if noise_m is None or parts.floor_m is None or parts.by_pressure:
        return ""
    if parts.floor_m < DIAGNOSIS.scatter_of_noise * noise_m:
        return ""
    return (
        f" The valve itself scatters: under a repeated command its position differs by {length.said(parts.floor_m)}, "
        f"and the sensor's noise is {length.said(noise_m, '.2g')} only."
    )
