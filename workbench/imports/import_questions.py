"""What an export leaves open, asked one thing at a time: columns, units, the stroke, which rows are good."""

from collections.abc import Callable, Sequence
from math import isfinite, nan

from config.errors import InputError
from workbench.imports.cell_units import SHARES
from workbench.imports.column_mapping import RANGE_PA, Source, read_mapping
from workbench.imports.column_names import COMMON
from workbench.imports.column_preview import GOOD, ColumnPreview
from workbench.imports.export_mapping import ExportMapping
from workbench.imports.export_preview import ExportPreview

Ask = Callable[[str, str], str]
"""Given a question and what is taken where nothing is answered; returns the answer."""
NEEDED = ("position_m",)


def ask_for_mapping(found: ExportPreview, ask: Ask) -> ExportMapping:
    """Return the mapping that a file's proposal and a person's answers make.

    Raises:
        InputError: an answer that is none of those allowed; names the question.
    """
    words = found.proposal.mapping.theirs
    asked = [ours if ours != "command_pa" or "reference_m" not in words else "reference_m" for ours in COMMON]
    columns = [word for ours in asked if (word := _column(ours, words.get(ours), found, ask))]
    timed = any(each.startswith("time_s=") for each in columns)
    period_s = None if timed else _number("the time between two rows, in s?", "0.01", ask)
    sources = read_mapping(columns, period_s)
    status = [word for each in found.columns if (word := _status(each, ask))]
    (position,) = (each for each in sources if each.name == "position_m")
    return ExportMapping(
        column=tuple(columns),
        stroke_m=_stroke_m(position, ask),
        range_pa=_range_pa(sources, ask),
        time_format=found.proposal.mapping.time_format,
        status=tuple(status),
        period_s=period_s,
    )


def _column(ours: str, proposed: str | None, found: ExportPreview, ask: Ask) -> str:
    if proposed is None:
        names = ", ".join(each.name for each in found.columns)
        left_out = "" if ours in NEEDED else "; nothing if none"
        answer = ask(f"which column is {ours}, NAME or NAME:UNIT{left_out}? There are {names}", "")
        if not answer and ours in NEEDED:
            raise InputError(ours, "is needed: a recording has a position")
        return f"{ours}={answer}" if answer else ""
    if not any(
        proposed.rpartition(":")[0] in each and "is open" in each for each in found.proposal.open if "unit of" in each
    ):
        return f"{ours}={proposed}"
    name, _, unit = proposed.rpartition(":") if ":" in proposed else (proposed, "", "s")
    return f"{ours}={name}:{ask(f'the unit of {name!r}, for {ours}?', unit)}"


def _status(column: ColumnPreview, ask: Ask) -> str:
    if not (held := column.status_words or column.opc_qualities):
        return ""
    otherwise = GOOD if column.opc_qualities else ""
    good = ask(f"{column.name!r} holds {held}: which are good, by commas; nothing if it does not matter?", otherwise)
    return f"{column.name}={good}" if good else ""


def _stroke_m(position: Source, ask: Ask) -> float | None:
    unit = position.unit or ""
    if unit.removeprefix("-") not in SHARES and not unit.startswith("-"):
        return None
    return _number("the stroke, 100 % of the position, in m?", "0.04", ask)


def _range_pa(sources: Sequence[Source], ask: Ask) -> tuple[float, float] | None:
    """Return the pressures of 0 % and 100 % where a pressure is a share; the usual ones where nothing is answered."""
    shares = [each for each in sources if each.name.endswith("_pa") and (each.unit or "").removeprefix("-") in SHARES]
    if not shares:
        return None
    low, high = (
        _number(f"the pressure at {end} of {shares[0].name} ({shares[0].theirs}), in Pa?", "20e3", ask, f"{usual:g}")
        for end, usual in zip(("0 %", "100 %"), RANGE_PA, strict=True)
    )
    return low, high


def _number(question: str, such: str, ask: Ask, otherwise: str = "") -> float:
    """Return a positive number; zero is one where another is taken for an empty answer."""
    answer = ask(question, otherwise)
    try:
        value = float(answer)
    except ValueError:
        value = nan
    if not isfinite(value) or value < 0.0 or (value == 0.0 and not otherwise):
        raise InputError(question.partition(",")[0], f"must be a number, as {such}; got {answer[:40]!r}")
    return value
