"""What follows from models and steps made by hand: what is accepted, which are rivals, the verdict and its sentence."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from config.valve_file import EffectTable, ValveFile
from sim.effect import shipped_effect, shipped_effects
from tests.workbench.valves import SEED
from workbench.fit.fitting import Fit, Fitted
from workbench.select.block_errors import BlockErrors
from workbench.select.effect_candidates import EffectStep, EvaluatedModel, judged_step
from workbench.select.forward_selection import without_missing
from workbench.select.verdict import Verdict, verdict
from workbench.select.verdict_sentence import rivals_sentence

LIBRARY = {name: shipped_effect(name, "test") for name in shipped_effects()}
FLOOR_M = 5e-5
MOTION_STD_M = 2e-2


def model(
    *effects: str,
    rmse_m: float = 1e-3,
    cost: float = 1e5,
    structure: float = 0.5,
    trusted: bool = True,
    at_end: str = "",
) -> EvaluatedModel:
    """A fitted valve of 2000 samples, off by so much in each second give or take a twentieth."""
    keys = [f"{name}.{key}" for name in effects for key in LIBRARY[name].parameters]
    fitted = {key: Fitted(0.0, 1.0, -1.0, 1.0, key == at_end, key != at_end) for key in ("spring_n_per_m", *keys)}
    tables = tuple(EffectTable.model_validate({"name": each}) for each in effects)
    valve = ValveFile(valve=SEED.valve, effect=tables)
    fit = cast(Fit, SimpleNamespace(valve=valve, parameters=fitted, cost=cost, count=2000, trusted=trusted))
    logs = np.log(rmse_m) + 0.05 * np.random.default_rng(0).standard_normal(60)
    errors = BlockErrors(rmse_m, rmse_m, rmse_m, rmse_m, logs[:30], logs, structure, 1.0)
    return EvaluatedModel(fit, errors, errors.at_floor(FLOOR_M))


BARE = model()
"""Twenty floors off."""
EXPLAINED: dict[str, Any] = {"rmse_m": FLOOR_M, "cost": 1e3, "structure": 0.0}
BETTER: dict[str, Any] = {"rmse_m": 5e-4, "cost": 5e4}


def stepped(before: EvaluatedModel = BARE, **models: EvaluatedModel | str) -> EffectStep:
    return judged_step(before, models, 1, LIBRARY)


def reasons(step: EffectStep) -> dict[str, str]:
    return {each.name: each.rejection_reason for each in step.candidates}


def test_the_best_by_evidence_is_added_and_what_is_worse_is_no_rival() -> None:
    step = stepped(ip_lag=model("ip_lag", **BETTER), stribeck=model("stribeck", **EXPLAINED))
    assert step.added is not None
    assert step.added.name == "stribeck"
    assert [each.name for each in step.candidates] == ["stribeck", "ip_lag"]
    assert [each.name for each in step.indistinguishable] == ["stribeck"]
    assert reasons(step) == {"stribeck": "", "ip_lag": ""}


def test_what_could_not_be_fitted_stands_last_with_its_reason() -> None:
    step = stepped(ip_lag="no sample", stribeck=model("stribeck", **BETTER))
    assert [each.name for each in step.candidates] == ["stribeck", "ip_lag"]
    assert reasons(step)["ip_lag"] == "no sample"


def test_a_parameter_at_the_end_of_its_range_is_not_physical() -> None:
    drag = model("quadratic_drag", **EXPLAINED, at_end="quadratic_drag.drag_ns2_per_m2")
    step = stepped(quadratic_drag=drag)
    assert step.added is None
    assert reasons(step)["quadratic_drag"].startswith("not physical: the recording wants quadratic_drag.drag")


def test_one_class_goes_by_its_first_member_unless_its_search_failed() -> None:
    slightly = {**EXPLAINED, "cost": 1.005e3}
    step = stepped(sensor_offset=model("sensor_offset", **EXPLAINED), preload=model("preload", **slightly))
    assert step.added is not None
    assert step.added.name == "preload"
    assert [each.name for each in step.indistinguishable] == ["preload", "sensor_offset"]
    failed = stepped(sensor_offset=model("sensor_offset", **EXPLAINED), preload=model("preload", **BETTER))
    assert failed.added is not None
    assert failed.added.name == "sensor_offset"


def test_the_bare_valve_by_another_name_is_never_added_and_refuses_what_does_no_better() -> None:
    step = stepped(sensor_gain=model("sensor_gain", **EXPLAINED), sensor_lag=model("sensor_lag", **EXPLAINED))
    assert step.added is None
    assert step.bare_equivalent is not None
    assert step.bare_equivalent.name == "sensor_gain"
    assert reasons(step) == {
        "sensor_gain": "no record of pressure and position tells it from spring_n_per_m",
        "sensor_lag": "explains no better than sensor_gain, the bare valve with other parameters",
    }


def test_where_all_is_explained_the_rule_is_harder_and_what_it_rejects_is_suspected() -> None:
    before = model(rmse_m=FLOOR_M, cost=1000.0, structure=0.0)
    shifted = model("ip_lag", rmse_m=0.9 * FLOOR_M, cost=980.0, structure=0.0)
    logs = before.errors.logs - np.where(np.arange(30) % 5, 0.0, 0.45)  # 2.7 of its standard errors
    narrowly = replace(shifted, errors=replace(shifted.errors, logs=logs))
    step = stepped(before, ip_lag=narrowly)
    assert "standard errors, more than 3 needed" in reasons(step)["ip_lag"]
    assert [each.name for each in step.suspected] == ["ip_lag"]
    assert stepped(ip_lag=narrowly).added is not None, "the same beside a model that leaves something"


def test_a_rival_that_is_still_accepted_after_the_added_one_is_missing_too() -> None:
    step = stepped(ip_lag=model("ip_lag", **BETTER), dead_time=model("dead_time", **BETTER))
    assert {each.name for each in step.indistinguishable} == {"ip_lag", "dead_time"}
    following = stepped(model("ip_lag", **BETTER), dead_time=model("ip_lag", "dead_time", **EXPLAINED))
    assert step.added is not None
    assert [each.name for each in without_missing(step, following, LIBRARY).indistinguishable] == [step.added.name]


MISSING = stepped(stribeck=model("stribeck", **EXPLAINED), ip_lag=model("ip_lag", **BETTER))
ONE_OF = stepped(stribeck=model("stribeck", **EXPLAINED), ip_lag=model("ip_lag", **EXPLAINED))
NOTHING = stepped(ip_lag=model("ip_lag"))


@pytest.mark.parametrize(
    ("best", "step", "said"),
    [
        (model(**EXPLAINED), NOTHING, "adequate"),
        (model("stribeck", **EXPLAINED), MISSING, "missing"),
        (model("stribeck", **EXPLAINED), ONE_OF, "one_of"),
        (BARE, NOTHING, "unexplained"),
        (model(rmse_m=FLOOR_M, structure=0.5), NOTHING, "unexplained"),
        (model(trusted=False), NOTHING, "untrusted"),
        (model("stribeck", **EXPLAINED, trusted=False), MISSING, "missing"),
    ],
)
def test_the_verdict_follows_from_the_best_model_and_the_steps(
    best: EvaluatedModel, step: EffectStep, said: Verdict
) -> None:
    assert verdict(best, [step], MOTION_STD_M) == said


def test_a_model_that_leaves_a_tenth_of_the_motion_explains_nothing() -> None:
    best = model(**EXPLAINED)
    assert verdict(best, [NOTHING], 10.1 * FLOOR_M) == "adequate"
    assert verdict(best, [NOTHING], 9.9 * FLOOR_M) == "unexplained"


def test_rivals_are_told_with_what_would_tell_them_apart() -> None:
    assert rivals_sentence(["ip_lag"], LIBRARY) == ""
    assert "measured actuator pressure" in rivals_sentence(["ip_lag", "sensor_lag"], LIBRARY)
    assert "no record of pressure and position tells" in rivals_sentence(["preload", "sensor_offset"], LIBRARY)
    assert rivals_sentence(["stribeck", "area_variation"], LIBRARY) == " Equally good: stribeck, area_variation."
