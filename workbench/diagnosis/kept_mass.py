"""The mass, which a fit keeps as the valve file says: what would be left of the error if it were fitted, too.

Plate, stem and plug seldom show: the damping holds them. Where they do, a mass that was assumed leaves an error that no
effect explains, or only the bare valve by another name. Asked where a diagnosis leaves something, be it no more than
noise may hide; what it finds is said, never used: a mass is weighed. And it is said only where most of what was left is
gone with it: of what the valve scatters a mass imitates some.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.diagnosis.doubt import Case, Doubt
from workbench.fit.fitting import base_fit, problem_of
from workbench.select.block_errors import BlockErrors
from workbench.select.effect_acceptance import gain
from workbench.select.effect_candidates import EvaluatedModel
from workbench.select.effect_search import evaluated
from workbench.select.selection_thresholds import SELECTION

MASS = "mass_kg"


@dataclass(frozen=True, slots=True, repr=False)
class KeptMass(Doubt):
    """A mass beside which the best model of a diagnosis leaves less."""

    key: ClassVar[str] = "kept_mass"

    kept_kg: float
    fitted_kg: float
    kept_rmse_m: float
    """Held out, with the mass as the valve file says."""
    fitted_rmse_m: float

    def sentence(self, kind: Kind) -> str:
        """Say so, and what to do."""
        return (
            f"the mass in the valve file, {self.kept_kg:.3g} kg, is not fitted; with {self.fitted_kg:.3g} kg the "
            f"held-out error would be {kind.length.number(self.fitted_rmse_m)} in place of "
            f"{kind.length.said(self.kept_rmse_m)}. Weigh plate, stem and plug, or put this mass_kg into the file, and "
            "diagnose again"
        )

    def as_json(self) -> dict[str, Any]:
        """Return it in plain types."""
        return {
            "kept_kg": self.kept_kg,
            "fitted_kg": self.fitted_kg,
            "kept_test_rmse_m": self.kept_rmse_m,
            "fitted_test_rmse_m": self.fitted_rmse_m,
        }


def kept_mass(case: Case) -> KeptMass | None:
    """Return which mass leaves less than the valve file's; None where none does, or nothing is left of the record.

    Nor is it asked where samples lie farther apart than slides last: there no mass shows.
    """
    best, parts = case.best, case.parts
    before = best.fit
    if case.doubts or not leaves_something(best) or before.by.slow or MASS in before.parameters:
        return None
    kept_kg = before.valve.valve.mass_kg
    free = [*before.parameters, MASS]
    models: list[EvaluatedModel] = []
    shares = (1.0, DIAGNOSIS.light_mass)
    for number, share in enumerate(shares):
        case.progress("fitting the mass, too", number / len(shares))
        valve = before.valve.valve.model_copy(update={MASS: share * kept_kg})
        begin = before.valve.model_copy(update={"valve": valve})
        found = base_fit(problem_of(before, parts.train.record), begin, free=free)
        models.append(evaluated(found, parts))
    model = min(models, key=lambda each: each.fit.cost)
    if gain(before, model.fit, best.errors, model.errors).rejection_reason:
        return None
    if not explains_most(best.errors, model.errors, best.floor_m):
        return None
    fitted_kg = model.fit.valve.valve.mass_kg
    return KeptMass(kept_kg, fitted_kg, best.errors.test_rmse_m, model.errors.test_rmse_m)


def explains_most(before: BlockErrors, after: BlockErrors, floor_m: float | None) -> bool:
    """Whether most of what was left beyond the floor, m, in squares, is gone, fitted and held out."""
    floor = (floor_m or 0.0) ** 2
    rmse_m = ((before.train_rmse_m, after.train_rmse_m), (before.test_rmse_m, after.test_rmse_m))
    return all(now_m**2 - floor <= DIAGNOSIS.most_left * max(then_m**2 - floor, 0.0) for then_m, now_m in rmse_m)


def leaves_something(best: EvaluatedModel) -> bool:
    """Whether a model leaves room for another to do better, be all explained or not.

    It must leave more than the floor of what was fitted, where evidence is counted: else what is left is a held-out
    slip; and where all is explained more than the noise may be off by.
    """
    if best.floor_m is None:
        return True
    nothing = best.explained and best.errors.floors_left(best.floor_m) <= SELECTION.noise_known_to
    return best.errors.train_rmse_m > best.floor_m and not nothing
