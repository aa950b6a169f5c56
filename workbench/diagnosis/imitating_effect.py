"""Whether what was named only stands in for something: a form without a name does better, and acts elsewhere.

Of a library that lacks the effect something else comes near, often to the noise. The likeliest forms of the grammar
(`workbench.discover`) are therefore fitted to the valve without what was named. A form does better if it outdoes that
(`workbench.select.effect_candidates.outdoes`): by more than 10 of evidence, and by more than two standard errors of the
events' errors, fitted and held out.

A form acts elsewhere if that is at another place on the path pressure, force, friction, motion, sensor than the one
effect named, its rivals and what is the same by algebra. At the same place it is the same effect in another shape, and
is not sought: forms of its kind, which come near, too, would leave no room among the likeliest for what it stands in
for. One form that does better than several effects together makes stand-ins of them, wherever it acts.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from sim.effect import Effect
from workbench.diagnosis.doubt import Case, Doubt
from workbench.discover.form_search import FIRST_TURN_FORMS, search_forms
from workbench.select.effect_candidates import outdoes
from workbench.select.equivalence import algebraic_class
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True, repr=False)
class StandIn(Doubt):
    """What was named, and the form that does better."""

    key: ClassVar[str] = "stand_in"
    overturns: ClassVar[bool] = True

    named: tuple[str, ...]
    form: str
    words: str
    """What the form is."""
    named_rmse_m: float
    """Held out, with what was named."""
    form_rmse_m: float

    def sentence(self, kind: Kind) -> str:
        """Say so."""
        imitate = "imitates" if len(self.named) == 1 else "imitate"
        return (
            f"a form without a name does better: {self.words}, alone, leaves {kind.length.number(self.form_rmse_m)} "
            f"held out in place of {kind.length.said(self.named_rmse_m)}. So {' and '.join(self.named)} only {imitate} "
            "it; `positioner discover` writes it"
        )

    def as_json(self) -> dict[str, Any]:
        """Return it in plain types."""
        return {"form": self.form, "test_rmse_m": self.form_rmse_m}


def imitating_effect(case: Case) -> StandIn | None:
    """Return what does better than what was named; None where nothing does.

    It is not asked behind a positioner, or where samples lie farther apart than slides last.
    """
    best, parts, library = case.best, case.parts, case.library
    if case.doubts or not case.explained or best.fit.by.slow or parts.train.record.by_setpoint:
        return None
    added = [step for step in case.steps if step.added]
    if not added:
        return None
    named = tuple(step.added.name for step in added if step.added)
    rivals = [each.name for step in added for each in step.indistinguishable]
    places = {place for name in (*named, *rivals) for place in _places(name, library)} if len(named) == 1 else set()
    found = search_forms(
        parts,
        case.valve,
        case.steps[0].before,
        most=FIRST_TURN_FORMS,
        workers=case.workers,
        progress=case.progress,
        elsewhere_than=places,
        most_cost=SELECTION.going_on_cost * best.fit.cost,
    ).found
    better = [each for each in found if outdoes(each.model, best)]
    if not better:
        return None
    form, errors = better[0].form, better[0].model.errors
    return StandIn(named, form.name, form.words, best.errors.test_rmse_m, errors.test_rmse_m)


def _places(name: str, library: Mapping[str, Effect]) -> set[str]:
    """Return where an effect acts, or what is the same by algebra."""
    by_name = {each.name: each for each in library.values()}
    return {
        place for each in (name, *algebraic_class(name, library)) if each in by_name for place in by_name[each].places
    }
