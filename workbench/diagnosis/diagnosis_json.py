"""A diagnosis as JSON: what `positioner diagnose --json` writes.

`test_typical_rmse_m` is the median of the held-out blocks' errors. `held_out_gain` is the rule's: no block counts for
more than a factor of 2 in it, so it never exceeds 0.5.
"""

from collections.abc import Mapping
from typing import Any

from workbench.diagnosis.command_or_pressure import ByCommand
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.diagnosis.doubt import Doubt
from workbench.diagnosis.imitating_effect import StandIn
from workbench.diagnosis.kept_mass import KeptMass
from workbench.diagnosis.measured_pressure import ByMeasuredPressure
from workbench.diagnosis.moved_parameters import MovedParameters
from workbench.diagnosis.pressure_scale import PressureScale
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.candidate_table import candidate_json
from workbench.select.effect_candidates import EffectCandidate, model_json
from workbench.select.equivalence import undetectable

KEYS: Mapping[type[Doubt], str] = {
    MovedParameters: "moved",
    KeptMass: "kept_mass",
    ByMeasuredPressure: "by_pressure",
    ByCommand: "by_command",
    PressureScale: "pressure_scale",
    StandIn: "stand_in",
}


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
        **_doubts(diagnosis),
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


def _doubts(diagnosis: Diagnosis) -> dict[str, Any]:
    found = {KEYS[type(each)]: each.as_json() for each in diagnosis.doubts}
    return {key: found.get(key) for key in KEYS.values()} | {"moved": found.get("moved", [])}


def _candidate(candidate: EffectCandidate) -> dict[str, Any]:
    """An effect that could not be fitted has neither errors nor parameters."""
    parameters = parameters_json(candidate.model.fit.parameters) if candidate.model else {}
    return candidate_json(candidate.tried) | {"parameters": parameters, "physical": candidate.physical}
