"""A discovery as JSON: what `positioner discover --json` writes."""

from typing import Any

from workbench.discover.discovery import Discovery
from workbench.discover.found_form import FoundForm
from workbench.fit.fitted_parameter import parameters_json


def as_json(found: Discovery) -> dict[str, Any]:
    """Return the discovery in plain types; SI units, in the names, but for a form's variable, whose unit is said."""
    return {
        "outcome": found.outcome,
        "sentence": found.sentence,
        "floor_m": found.split.floor_m,
        "base": {"train_rmse_m": found.base.errors.train_rmse_m, "test_rmse_m": found.base.errors.test_rmse_m},
        "forms": [_form(each) for each in found.found],
        "candidates": [
            {
                "name": each.name,
                "train_rmse_m": each.model and each.model.errors.train_rmse_m,
                "test_rmse_m": each.model and each.model.errors.test_rmse_m,
                "evidence": each.gain and each.gain.bic,
                "held_out_gain": each.gain and each.gain.held_out,
                "held_out_evidence": each.gain and each.gain.held_out_evidence,
                "explains": each.model is not None and each.model.explained,
                "accepted": each.accepted,
                "why_not": each.rejection_reason,
            }
            for each in found.candidates
        ],
        "not_fitted": list(found.untried),
        "landings": [
            {"position_m": each.position_m, "direction": each.direction, "missing_n": each.missing_n}
            for each in found.landings
        ],
    }


def _form(each: FoundForm) -> dict[str, Any]:
    errors = each.model.errors
    return {
        "name": each.form.name,
        "words": each.form.words,
        "equation": list(each.form.equations),
        "values": dict(each.values),
        "variable": each.form.variable.words,
        "unit": each.added.unit,
        "from": each.span[0],
        "to": each.span[1],
        "train_rmse_m": errors.train_rmse_m,
        "test_rmse_m": errors.test_rmse_m,
        "parameters": parameters_json(each.model.fit.parameters),
    }
