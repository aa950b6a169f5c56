"""A diagnosis of forces as JSON: what `positioner diagnose --json` writes where the position is imposed."""

from math import isfinite
from typing import Any

from workbench.forces.force_balance import ForceFit
from workbench.forces.force_diagnosis import ForceCandidate, ForceDiagnosis
from workbench.select.candidate_table import NEWTONS, candidate_json


def as_json(diagnosis: ForceDiagnosis) -> dict[str, Any]:
    """Return the diagnosis in plain types; SI units, in the names."""
    return {
        "verdict": diagnosis.verdict,
        "sentence": diagnosis.sentence,
        "missing": list(diagnosis.missing),
        "indistinguishable": [list(names) for names in diagnosis.indistinguishable],
        "base": _fit(diagnosis.base),
        "best": _fit(diagnosis.best),
        "floor_n": diagnosis.floor_n,
        "candidates": [_candidate(each) for each in diagnosis.candidates],
        "notes": list(diagnosis.rows.notes),
        "experiment": None,
    }


def _fit(fit: ForceFit) -> dict[str, Any]:
    parameters = {
        name: {"value": value, "std": fit.deviations.get(name)}
        for name, value in fit.parameters.items()
        if isfinite(value)
    }
    errors = {"train_rmse_n": fit.train_rms_n, "test_rmse_n": fit.test_rms_n}
    return {"effects": list(fit.effects), **errors, "parameters": parameters}


def _candidate(each: ForceCandidate) -> dict[str, Any]:
    return _fit(each.fit) | candidate_json(each.tried, NEWTONS) | {"physical": not each.fit.range_violation}
