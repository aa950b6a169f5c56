"""An extension as JSON: what `positioner extend --json` writes."""

from typing import Any

from workbench.diagnosis.extension import Extension
from workbench.fit.fit_result import Fit
from workbench.fit.parameter_estimate import parameters_json
from workbench.select.block_errors import BlockErrors, errors_json
from workbench.select.candidate_table import gain_json


def as_json(extension: Extension) -> dict[str, Any]:
    """Return the extension in plain types; SI units, in the names."""
    return {
        "effects": list(extension.effects),
        "falls": extension.falls,
        "given": {
            "train_rmse_m": extension.given_train_rmse_m,
            "test_rmse_m": extension.given_test_rmse_m,
        },
        "refitted": _fit(extension.refitted_errors, extension.refitted),
        "extended": _fit(extension.extended_errors, extension.extended),
        "floor_m": extension.split.floor_m,
        **gain_json(extension.gain),
    }


def _fit(errors: BlockErrors, fit: Fit) -> dict[str, Any]:
    return errors_json(errors) | {"parameters": parameters_json(fit.parameters)}
