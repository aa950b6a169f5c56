"""A discovery as JSON: what `positioner discover --json` writes."""

from typing import Any

from workbench.discover.discovery import Discovery
from workbench.discover.found_form import FoundForm
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.block_errors import errors_json
from workbench.select.candidate_table import candidate_json


def as_json(found: Discovery) -> dict[str, Any]:
    """Return the discovery in plain types; SI units, in the names, but for a form's variable, whose unit is said."""
    return {
        "outcome": found.outcome,
        "sentence": found.sentence,
        "floor_m": found.split.floor_m,
        "base": errors_json(found.base.errors),
        "forms": [_form(each) for each in found.found],
        "candidates": [
            candidate_json(each.tried) | {"explains": each.model is not None and each.model.explained}
            for each in found.candidates
        ],
        "not_fitted": list(found.untried),
        "landings": [
            {"position_m": each.position_m, "direction": each.direction, "missing_n": each.missing_n}
            for each in found.landings
        ],
    }


def _form(each: FoundForm) -> dict[str, Any]:
    return {
        "name": each.form.name,
        "words": each.form.words,
        "equation": list(each.form.equations),
        "values": dict(each.values),
        "variable": each.form.variable.words,
        "unit": each.added.unit,
        "from": each.span[0],
        "to": each.span[1],
        **errors_json(each.model.errors),
        "parameters": parameters_json(each.model.fit.parameters),
    }
