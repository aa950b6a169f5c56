"""Fits and models made by hand: what a search might have come to, for all that follows from its numbers alone.

A model has one error throughout, so that two differ by what is written here and by nothing else: its cost says what it
leaves where it was fitted, its error what it leaves where it was not.
"""

from collections.abc import Mapping

import numpy as np

from config.valve_file import EffectTable, ValveFile
from sim.effect import shipped_effect, shipped_effects
from tests.workbench.valves import SEED
from workbench.fit.fit_result import NOTHING, Fit, Term, Terms
from workbench.fit.parameter_estimate import Fitted
from workbench.select.block_errors import BlockErrors
from workbench.select.effect_candidates import EvaluatedModel

LIBRARY = {name: shipped_effect(name, "test") for name in shipped_effects()}
FLOOR_M = 5e-5
RESIDUALS, FITTED_EVENTS, HELD_OUT_EVENTS = 2000, 20, 16
AT_FLOOR = 0.5 * RESIDUALS
"""The cost of white residuals."""


def valve_with(*effects: str) -> ValveFile:
    tables = [
        EffectTable.model_validate(
            {"name": name, **dict(zip(LIBRARY[name].parameters, LIBRARY[name].off(SEED.valve), strict=True))}
        )
        for name in effects
    ]
    return ValveFile(valve=SEED.valve, effect=tuple(tables))


def fitted(value: float, *, physical: bool = True) -> Fitted:
    return Fitted(value, 0.1, value - 0.2, value + 0.2, not physical, physical)


def terms_of(mean_square: float, events: int = FITTED_EVENTS) -> Terms:
    """Return a likelihood of so many landings, and as many break-aways; every kind leaves as much."""
    counts = (10.0 * events, events, 5.0 * events, events)
    return Terms(*(Term(each, mean_square) for each in counts))


def fit_of(
    *effects: str,
    cost: float = AT_FLOOR,
    rms_m: float = FLOOR_M,
    found: Mapping[str, Fitted] | None = None,
    **more: int,
) -> Fit:
    """Return a fit with four parameters of the valve, and one for each of the effects unless they are given."""
    parameters = {f"parameter_{i}": fitted(1.0) for i in range(4)}
    parameters |= {f"{name}.parameter": fitted(1.0) for name in effects} if found is None else found
    return Fit(
        valve=valve_with(*effects),
        parameters=parameters,
        rms_m=rms_m,
        floor_m=FLOOR_M,
        cost=cost,
        count=RESIDUALS,
        terms=terms_of(cost / AT_FLOOR),
        moves=FITTED_EVENTS,
        agreement=more.get("agreement", 3),
        condition=10.0,
        undetermined=(),
        notes=(),
        from_pressure=False,
        onsets_s=np.zeros(0),
        load_n=1.0,
        known=NOTHING,
    )


def errors_of(error_m: float = FLOOR_M, *, structure: float = 0.0) -> BlockErrors:
    logs = np.full(FITTED_EVENTS + HELD_OUT_EVENTS, 0.5 * np.log1p((error_m / FLOOR_M) ** 2))
    return BlockErrors(
        train_rmse_m=error_m,
        test_rmse_m=error_m,
        train_block_m=error_m,
        test_block_m=error_m,
        logs=logs[FITTED_EVENTS:],
        structure=structure,
        held_out=terms_of((error_m / FLOOR_M) ** 2, HELD_OUT_EVENTS),
    )


def error_with(evidence: float, error_m: float) -> float:
    """Return the error, m, of a model for which what was held out has this evidence over one with another error, m."""
    independent = sum(each.independent for each in errors_of().held_out.each)
    return error_m * float(np.exp(-0.5 * evidence / independent))


def model_of(
    *effects: str,
    cost: float = AT_FLOOR,
    error_m: float = FLOOR_M,
    structure: float = 0.0,
    agreement: int = 3,
    found: Mapping[str, Fitted] | None = None,
) -> EvaluatedModel:
    """Return a model that leaves this cost where it was fitted and this error where it was not."""
    errors = errors_of(error_m, structure=structure)
    fit = fit_of(*effects, cost=cost, rms_m=error_m, found=found, agreement=agreement)
    return EvaluatedModel(fit, errors, FLOOR_M)
