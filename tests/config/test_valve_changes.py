"""A valve file with other values: named, checked, and nothing else changed."""

import pytest

from config.errors import InputError
from config.valve_changes import change_valve
from config.valve_file import EffectTable, load_valve, shipped_valve

SEED = load_valve(shipped_valve("seed"))
TWO = SEED.model_copy(
    update={
        "effect": (
            EffectTable.model_validate({"name": "preload", "force_n": 300.0}),
            EffectTable.model_validate({"name": "/somewhere/tight.py", "excess_n": 5.0}),
        )
    }
)


def test_what_is_named_has_the_new_value_and_nothing_else_has() -> None:
    found = change_valve(TWO, {"coulomb_n": 1300.25, "tight.excess_n": 7.0}, ["preload"])
    assert found.valve == SEED.valve.model_copy(update={"coulomb_n": 1300.25})
    assert [(each.name, each.parameters) for each in found.effect] == [("/somewhere/tight.py", {"excess_n": 7.0})]
    assert change_valve(TWO, {}) == TWO


@pytest.mark.parametrize(
    ("values", "without", "said"),
    [
        ({"coulomb": 1.0}, [], "coulomb: is no parameter of the valve; allowed: mass_kg"),
        ({"name": 1.0}, [], "name: is no parameter"),
        ({}, ["backlash"], "backlash: is no effect of the valve; allowed: preload, tight"),
        ({"coulomb_n": -1.0}, [], "coulomb_n"),
    ],
)
def test_what_is_not_there_is_said(values: dict[str, float], without: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        change_valve(TWO, values, without)
