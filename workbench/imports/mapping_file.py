"""A mapping written down for next time: the words that read an export, as a file that every command takes.

[export]
column = ["time_s=Time", "position_m=PV:%", "command_pa=OUT:bar"]
stroke_m = 0.04
status = ["Quality=Good"]
"""

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from config.errors import InputError
from config.loading import Many, Pair, Positive, Schema, load
from workbench.imports.column_mapping import read_mapping, read_status


class MappingTable(Schema):
    """Table `[export]`: the options of a command line by their names."""

    column: Annotated[Many[str], Field(min_length=1)]
    stroke_m: Positive | None = None
    range_pa: Pair[float] | None = None
    decimal: Literal[".", ","] | None = None
    time_format: str | None = None
    status: Many[str] = ()
    sheet: str | None = None
    period_s: Positive | None = None


class MappingFile(Schema):
    """A whole file."""

    export: MappingTable


def read_mapping_file(path: Path) -> MappingTable:
    """Return the mapping that a file says.

    Raises:
        InputError: it cannot be read, or a key or a column in it is wrong.
    """
    table = load(MappingFile, path).export
    try:
        read_mapping(table.column, table.period_s)
        read_status(table.status)
    except InputError as error:
        raise InputError(str(path), f"export.{error.source.removeprefix('--')}: {error.problem}") from None
    return table


def write_mapping_file(path: Path, table: MappingTable) -> None:
    """Write it.

    Raises:
        InputError: it is there already, or cannot be written.
    """
    said = table.model_dump(exclude_defaults=True)
    # A JSON string, number or list of them is a TOML one.
    text = "[export]\n" + "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in said.items())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(str(path), "is there already: delete it, or read with it (--mapping)") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from None
