"""The verdict of a diagnosis: what follows from the best model and the steps to it. Nothing is simulated here.

adequate      nothing is missing: no effect is accepted, and the valve explains the record without
missing       these effects, and with them all is explained
              Of both, where only the bare valve by another name explains the rest: a parameter that was kept is off
one_of        as missing, but a set of effects does equally well: the experiment that tells them apart comes with it
unexplained   something is missing that the library does not have, or of which what it has is only suspected; what
              lowered the error so far is still named.
              Or slides end elsewhere, so that what explains the rest stands in for it; or the valve scatters so much
              that a tenth of the motion is left, which no model could explain
unjudged      the floor is unknown, so that nobody can say whether anything is left; what lowered the error is named.
              Or the stem moves before its command, so that no model of it can hold (`workbench.data.clock_difference`).
              Or landings alone are judged, and they are too few, or do not lie where any model has them: what the
              pressure did between samples is not known (`judged_landings`). Or that the command was held there is not
unfinished    broken off before the search was through; what was known by then is named
untrusted     the searches disagree, and the best of them explains nothing
"""

from collections.abc import Sequence
from typing import Literal

from workbench.data.clock_difference import Doubt
from workbench.diagnosis.judged_landings import JudgedLandings
from workbench.select.effect_candidates import EffectCandidate, EffectStep, EvaluatedModel

Verdict = Literal["adequate", "missing", "one_of", "unexplained", "unjudged", "unfinished", "untrusted"]
EXPLAINED: tuple[Verdict, ...] = ("adequate", "missing", "one_of")


def verdict(
    best: EvaluatedModel,
    steps: Sequence[EffectStep],
    motion_std_m: float,
    floor_m: float | None,
    landed: JudgedLandings | None = None,
    early: Doubt | None = None,
) -> Verdict:
    """Return the verdict of a search that is through.

    Args:
        best: the last model accepted, or the valve as it is.
        steps: the forward steps made.
        motion_std_m: standard deviation of the position that was fitted, m.
        floor_m: what no model undercuts; None: unknown.
        landed: the landings of the best model, where they alone are judged.
        early: how much the stem moves before its command, if it does.
    """
    if early or floor_m is None or (landed and not landed.enough):
        return "unjudged"
    found = _verdict_of_all(best, steps, motion_std_m)
    known_between = landed is None and best.fit.by.sure
    return "unjudged" if found == "unexplained" and not known_between else found


def _verdict_of_all(best: EvaluatedModel, steps: Sequence[EffectStep], motion_std_m: float) -> Verdict:
    equivalent = by_another_name(steps)
    best = equivalent.model if equivalent and equivalent.model and equivalent.model.explained else best
    if not best.explained:
        return "unexplained" if best.fit.trusted else "untrusted"
    if not best.errors.follows(motion_std_m):
        return "unexplained"
    added = [step for step in steps if step.added]
    if not added:
        return "adequate"
    return "one_of" if any(len(step.indistinguishable) > 1 for step in added) else "missing"


def by_another_name(steps: Sequence[EffectStep]) -> EffectCandidate | None:
    """Return what does better than all that was found, but that it is the bare valve by another name; None if nothing.

    A parameter that was kept is off then, not an effect missing.
    """
    return None if steps[-1].added else steps[-1].bare_equivalent
