"""A mapping written down: the words that read an export, as a file that every command takes.

[export]
column = ["time_s=Time", "position_m=PV:%", "command_pa=OUT:bar"]
stroke_m = 0.04
status = ["Quality=Good"]
"""

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
