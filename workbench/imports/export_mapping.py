"""How an export is read, one object: of a command line's options, of a page's fields, or of a file kept for next time.

[export]
column = ["time_s=Time", "position_m=PV:%", "command_pa=OUT:bar"]
stroke_m = 0.04
status = ["Quality=Good"]
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from config.errors import InputError
from config.loading import Many, Pair, Positive, Schema, load
from config.recording import Recording
from workbench.imports.column_mapping import ExportOptions, read_mapping, read_status
from workbench.imports.historian_export import read_export
from workbench.imports.sample_rows import Progress

REPEATED = ("column", "status")
"""Options that are given once for each of their values."""


class ExportMapping(Schema):
    """Table `[export]`: the options of a command line by their names. What is proposed may lack columns."""

    column: Many[str] = ()
    stroke_m: Positive | None = None
    range_pa: Pair[float] | None = None
    decimal: Literal[".", ","] | None = None
    time_format: str | None = None
    status: Many[str] = ()
    sheet: str | None = None
    period_s: Positive | None = None

    @property
    def theirs(self) -> dict[str, str]:
        """Theirs by ours, `NAME` or `NAME:UNIT`."""
        return {ours: theirs for ours, _, theirs in (each.partition("=") for each in self.column)}

    @property
    def words(self) -> tuple[str, ...]:
        """The same as words of a command line."""
        return option_words(self.model_dump())

    def read(self, path: Path, stroke_m: float | None = None, progress: Progress | None = None) -> Recording:
        """Read an export; `stroke_m` counts where the mapping says none.

        Raises:
            InputError, ModuleNotFoundError: as `read_mapping`, `read_status` and `read_export`.
        """
        options = ExportOptions(self.decimal, self.time_format, read_status(self.status), self.sheet, self.period_s)
        sources = read_mapping(self.column, self.period_s)
        return read_export(path, sources, self.stroke_m or stroke_m, self.range_pa, options, progress)


class MappingFile(Schema):
    """A whole file."""

    export: ExportMapping


def option_words(options: Mapping[str, Any]) -> tuple[str, ...]:
    """Return options, by their names in Python, as words of a command line; None, and none of several, is left out.

    >>> option_words({"column": ("time_s=t", "position_m=PV:%"), "range_pa": (2e4, 1e5), "sheet": None})
    ('--column', 'time_s=t', '--column', 'position_m=PV:%', '--range-pa', '20000', '100000')
    """
    words: list[str] = []
    for name, value in options.items():
        flag, values = f"--{name.replace('_', '-')}", value if isinstance(value, list | tuple) else [value]
        texts = [f"{each:.12g}" if isinstance(each, float) else str(each) for each in values]
        if name in REPEATED:
            words += [word for each in texts for word in (flag, each)]
        elif value is not None:
            words += [flag, *texts]
    return tuple(words)


def read_mapping_file(path: Path) -> ExportMapping:
    """Return the mapping that a file says.

    Raises:
        InputError: it cannot be read, or a key or a column in it is wrong.
    """
    mapping = load(MappingFile, path).export
    try:
        read_mapping(mapping.column, mapping.period_s)
        read_status(mapping.status)
    except InputError as error:
        raise InputError(str(path), f"export.{error.source.removeprefix('--')}: {error.problem}") from None
    return mapping


def write_mapping_file(path: Path, mapping: ExportMapping) -> None:
    """Write it.

    Raises:
        InputError: it is there already, or cannot be written.
    """
    said = mapping.model_dump(exclude_defaults=True)
    # A JSON string, number or list of them is a TOML one.
    text = "[export]\n" + "".join(f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in said.items())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(str(path), "is there already: delete it, or read with it (--mapping)") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from None
