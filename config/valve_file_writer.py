"""Writes a valve file, the inverse of `config.valve_file.load_valve`."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from config.arguments import kinds_held
from config.drive import VALVE
from config.errors import explain_failure
from config.valve_file import EffectTable, ValveFile
from config.whole_file import beside


@kinds_held
def write_valve(path: Path | str, file: ValveFile, remarks: Sequence[str] = ()) -> None:
    """Write a valve file, own effects named by their paths as seen from its folder; remarks become comments.

    Raises:
        InputError: it cannot be written.
    """
    path = Path(path)
    seen = file.model_copy(update={"effect": tuple(_relative_to(path.parent, each) for each in file.effect)})
    text = "".join(f"# {remark}\n" for remark in remarks) + valve_toml(seen)
    with explain_failure(path, "cannot be written"), beside(path) as new:
        new.write_text(text, encoding="utf-8")


def valve_toml(file: ValveFile) -> str:
    """Return the text of a valve file, or of a drive's; numbers keep every bit."""
    kind, parameters = file.valve.own, file.valve.model_dump(exclude={"kind"})
    if not kind.area:
        del parameters["diaphragm_area_m2"]
    tables = [("[valve]", parameters) if kind is VALVE else ("[drive]", {"kind": kind.name, **parameters})]
    tables += [("[[effect]]", {"name": each.name, **each.parameters}) for each in file.effect]
    tables = [(head, {kind.own(key): value for key, value in table.items()}) for head, table in tables]
    return "\n".join(f"{head}\n{_lines(table)}" for head, table in tables)


def _lines(table: Mapping[str, Any]) -> str:
    # A JSON string or number is a TOML one.
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())


def _relative_to(folder: Path, table: EffectTable) -> EffectTable:
    """Return the table with an own effect's path, as seen from here, as seen from a folder."""
    if not table.name.endswith(".py"):
        return table
    return table.model_copy(update={"name": Path(os.path.relpath(table.name, folder)).as_posix()})
