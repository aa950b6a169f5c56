"""A diagnosis as JSON: what `positioner diagnose --json` writes.

`test_typical_rmse_m` is the median of the held-out blocks' errors. `held_out_gain` is the rule's: no block counts for
more than a factor of 2 in it, so it never exceeds 0.5.
"""

from typing import Any

from workbench.diagnosis.diagnosis import Diagnosis
from workbench.fit.fitted_parameter import parameters_json
from workbench.select.block_errors import errors_json
from workbench.select.candidate_table import candidate_json
from workbench.select.effect_candidates import EffectCandidate, EvaluatedModel
from workbench.select.equivalence import undetectable


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis in plain types; SI units, in the names."""
    return {
        "verdict": diagnosis.verdict,
        "sentence": diagnosis.sentence,
        "held_by": diagnosis.positioner
        and {
            "cause": diagnosis.positioner.cause,
            "sentence": diagnosis.positioner.sentence,
        },
        "missing": list(diagnosis.missing),
        "indistinguishable": [list(names) for names in diagnosis.indistinguishable],
        "suspected": list(diagnosis.suspected),
        "contradicted": list(diagnosis.contradicted),
        "moved": [
            {
                "name": each.name,
                "before": each.before,
                "value": each.fitted.value,
                "lower": each.fitted.lower,
                "upper": each.fitted.upper,
                "like": list(each.like),
            }
            for each in diagnosis.moved
        ],
        "kept_mass": diagnosis.kept_mass
        and {
            "kept_kg": diagnosis.kept_mass.kept_kg,
            "fitted_kg": diagnosis.kept_mass.fitted_kg,
            "kept_test_rmse_m": diagnosis.kept_mass.kept_rmse_m,
            "fitted_test_rmse_m": diagnosis.kept_mass.fitted_rmse_m,
        },
        "by_pressure": diagnosis.by_pressure
        and {"off_pa": diagnosis.by_pressure.off_pa, **_model(diagnosis.by_pressure.model)},
        "by_command": diagnosis.by_command and _model(diagnosis.by_command.model),
        "pressure_scale": diagnosis.pressure_scale
        and {"span": diagnosis.pressure_scale.span, "above_pa": diagnosis.pressure_scale.above_pa},
        "stand_in": diagnosis.stand_in
        and {"form": diagnosis.stand_in.form, "test_rmse_m": diagnosis.stand_in.form_rmse_m},
        "parameters_off": diagnosis.parameters_off,
        "given": {
            "train_rmse_m": diagnosis.given.errors.train_rmse_m,
            "test_rmse_m": diagnosis.given.errors.test_rmse_m,
        },
        "base": _model(diagnosis.base),
        "best": _model(diagnosis.best),
        "floor_m": diagnosis.split.floor_m,
        "preview": [{"name": each.name, "score": each.score} for each in diagnosis.preview],
        "untold": [
            {"name": each.name, "like": list(each.like), "most_m": each.most_m, "shown_by": each.shown_by}
            for each in undetectable(diagnosis.split, diagnosis.best.fit.valve)
        ],
        "candidates": [_candidate(each) for each in diagnosis.candidates],
    }


def _model(model: EvaluatedModel) -> dict[str, Any]:
    return {
        "effects": list(model.effects),
        **errors_json(model.errors),
        "at_floor": model.at_floor,
        "structure_r2": model.errors.structure,
        "pressure_off_pa": model.pressure.rms_pa if model.pressure else None,
        "parameters": parameters_json(model.fit.parameters),
    }


def _candidate(candidate: EffectCandidate) -> dict[str, Any]:
    """An effect that could not be fitted has neither errors nor parameters."""
    parameters = parameters_json(candidate.model.fit.parameters) if candidate.model else {}
    return candidate_json(candidate.tried) | {"parameters": parameters, "physical": candidate.physical}
