"""A valve file with other values: what a hand sets, by the parameter's name, SI units; effects may be left out.

A parameter is named as a fit names it: `coulomb_n` of the valve, `preload.force_n` of an effect.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from config.errors import InputError
from config.loading import validate
from config.valve_file import EffectTable, ValveFile, ValveParameters

FIXED = ("name", "kind", "actuator")


def changes_in_words(values: Mapping[str, float], without: Collection[str]) -> list[str]:
    """Return in words what was changed in a valve file."""
    return [f"{name} = {value:g}" for name, value in values.items()] + [f"without {each}" for each in without]


def change_valve(file: ValveFile, values: Mapping[str, float], without: Collection[str] = ()) -> ValveFile:
    """Return a valve file with these values, and without these effects.

    Raises:
        InputError: no parameter or effect of that name, or a value that no valve file may say.
    """
    base = file.valve.model_dump()
    tables = {_name(each): {"name": each.name, **each.parameters} for each in file.effect}
    for effect in without:
        if effect not in tables:
            raise InputError(effect, f"is no effect of the valve; allowed: {', '.join(tables) or 'none'}")
    names = [key for key in ValveParameters.model_fields if key not in FIXED]
    names += [f"{name}.{key}" for name, table in tables.items() for key in table if key != "name"]
    for name, value in values.items():
        if name not in names:
            raise InputError(name, f"is no parameter of the valve; allowed: {', '.join(names)}")
        effect, _, key = name.rpartition(".")
        (tables[effect] if effect else base)[key] = value
    kept: list[Any] = [table for name, table in tables.items() if name not in without]
    return validate(ValveFile, {"valve": base, "effect": kept}, "valve")


def _name(table: EffectTable) -> str:
    """Return what an effect is called; one of one's own by its file's name."""
    return Path(table.name).stem if table.name.endswith(".py") else table.name
