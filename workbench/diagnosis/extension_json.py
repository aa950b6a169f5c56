"""An extension as JSON: what `positioner extend --json` writes."""

from typing import Any

from workbench.diagnosis.extension import Extension
from workbench.fit.fitted_parameter import parameters_json
from workbench.select.block_errors import BlockErrors


def as_json(extension: Extension) -> dict[str, Any]:
    """Return the extension in plain types; SI units, in the names."""
    found = extension.gain
    return {
        "effects": list(extension.effects),
        "falls": extension.falls,
        "given": {
            "train_rmse_m": extension.given_train_rmse_m,
            "test_rmse_m": extension.given_test_rmse_m,
        },
        "refitted": _errors(extension.refitted_errors) | {"parameters": parameters_json(extension.refitted.parameters)},
        "extended": _errors(extension.extended_errors) | {"parameters": parameters_json(extension.extended.parameters)},
        "floor_m": extension.split.floor_m,
        "evidence": found.bic,
        "held_out_gain": found.held_out,
        "held_out_evidence": found.held_out_evidence,
    }


def _errors(errors: BlockErrors) -> dict[str, float]:
    return {
        "train_rmse_m": errors.train_rmse_m,
        "test_rmse_m": errors.test_rmse_m,
        "test_typical_rmse_m": errors.test_block_m,
    }
