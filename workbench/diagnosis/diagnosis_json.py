"""A diagnosis as JSON: what `positioner diagnose --json` writes.

`test_typical_rmse_m` is the median of the held-out blocks' errors. `held_out_gain` is the rule's: no block counts for
more than a factor of 2 in it, so it never exceeds 0.5.
"""

from typing import Any

from workbench.diagnosis.diagnosis import Diagnosis
from workbench.diagnosis.doubts import CHECKS
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.candidate_table import candidate_json
from workbench.select.effect_candidates import EffectCandidate, model_json
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
        **{each.key: None for each in CHECKS},
        "moved": [],
        **{each.key: each.as_json() for each in diagnosis.doubts},
        "parameters_off": diagnosis.parameters_off,
        "given": {
            "train_rmse_m": diagnosis.given.errors.train_rmse_m,
            "test_rmse_m": diagnosis.given.errors.test_rmse_m,
        },
        "base": model_json(diagnosis.base),
        "best": model_json(diagnosis.best),
        "floor_m": diagnosis.split.floor_m,
        "preview": [{"name": each.name, "score": each.score} for each in diagnosis.preview],
        "untold": [
            {"name": each.name, "like": list(each.like), "most_m": each.most_m, "shown_by": each.shown_by}
            for each in undetectable(diagnosis.split, diagnosis.best.fit.valve)
        ],
        "candidates": [_candidate(each) for each in diagnosis.candidates],
    }


def _candidate(candidate: EffectCandidate) -> dict[str, Any]:
    """An effect that could not be fitted has neither errors nor parameters."""
    parameters = parameters_json(candidate.model.fit.parameters) if candidate.model else {}
    return candidate_json(candidate.tried) | {"parameters": parameters, "physical": candidate.physical}
