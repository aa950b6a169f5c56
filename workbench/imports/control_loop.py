"""Whether an export is a control loop's: output OP, process value PV, set point SP, and no stem beside them.

    SP ---(-)---> controller ---OP---> valve ---x---> process ---PV---+
           ^                                                          |
           +----------------------------------------------------------+

PV is a flow, a level, a pressure, a temperature, and tells the stem's position no more than the process does. It is
told from a stem by what is known of it:

    names     OP, PV and SP, by all the words for them, of one tag: FIC101.OP, FIC101.PV, FIC101.SP
    tags      a controller's (ISA-5.1: FIC101, TC-12); a valve's own tag (FV101) says the contrary
    units     m3/h, degC, pH and the like are a process's; a length is a stem's, and a pressure commands one
    ranges    an output is a share: -10 to 110 %, 0 to 1, or 0 to 24 mA
    values    a set point that differs from what is controlled: a stem's set point and output are one number
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from workbench.imports.cell_units import PROCESS_UNITS, SHARES, UNITS
from workbench.imports.column_names import COMMON, PROCESS_VALUE, SETPOINT, is_called, rank_by_name, split_words

Array = npt.NDArray[np.float64]
OUTPUT = COMMON["command_pa"][0]
CONTROL_VARIABLE = r"\bcv\b"
"""An output in Rockwell's and Ignition's words; DeltaV writes it behind every name, PV.CV, for the current value."""
CONTROLLER = re.compile(r"(?<![A-Z])[FLPTAQWDS][DFIQRY]*C[A-Z]*[ -]?\d", re.IGNORECASE)
"""Tags of controllers by ISA-5.1: measured quantity, functions, C."""
OF_VALVE = re.compile(r"(?<![A-Z])[FLPTHX]C?V[ -]?\d", re.IGNORECASE)
"""Tags of valves."""
LEAST_OUT, MOST_OUT = -10.0, 110.0
"""An output in %, and with it one in mA or of 1."""
OUTPUT_IS_SETPOINT = 1e-3
"""Of the set point's span: an output that never differs by more is the same signal."""


@dataclass(frozen=True, slots=True)
class LoopColumn:
    """A column of an export.

    Attributes:
        name: as the file has it.
        unit: as the file says it, whether it is one of ours or none ("bar", "m3/h"); "" where it says none.
        values: its numbers, NaN where there is none, (n,); the first some hundred do.
    """

    name: str
    unit: str
    values: Array


@dataclass(frozen=True, slots=True)
class LoopColumns:
    """Which columns of an export are a loop's, by their names in the file.

    Attributes:
        tag: what their names have in common; "" where there is no more than the signals' own names.
        output: OP, what the controller asks of the valve.
        process_value: PV, what the loop controls.
        setpoint: SP; None where the file has none.
        position: the stem's own, if it is measured: the only one of the file, or that of the loop's number.
        because: by what it was told, for people.
    """

    tag: str
    output: str
    process_value: str
    setpoint: str | None
    position: str | None
    because: str


def loops_of(columns: Sequence[LoopColumn]) -> list[LoopColumns]:
    """Return the loops of an export, in the order of its columns; none where it is a valve's.

    >>> five = np.array([54.0, 54.0, 61.0, 61.0, 61.0])
    >>> named = [LoopColumn(f"FIC7.{each}", "", five + i) for i, each in enumerate(("SP", "PV", "OP"))]
    >>> loops_of(named)[0].process_value, loops_of([LoopColumn("OP", "bar", five), LoopColumn("PV", "mm", five)])
    ('FIC7.PV', [])
    """
    stems = [each for each in columns if _is_stem(each)]
    rest = [each for each in columns if each not in stems]
    groups: dict[str, dict[str, LoopColumn]] = {}
    for each in rest:
        if role := _role(each):
            groups.setdefault(_tag(each.name, role), {}).setdefault(role, each)
    if not any({"output", "process_value"} <= set(group) for group in groups.values()):
        groups = _of_no_tag(groups)
    found = []
    for tag, group in groups.items():
        output, value, setpoint = (group.get(role) for role in ("output", "process_value", "setpoint"))
        if output and value and (because := _because(tag, output, value, setpoint)):
            position = _stem_of(tag, stems, alone=len(groups) == 1)
            found.append(
                LoopColumns(tag, output.name, value.name, setpoint.name if setpoint else None, position, because)
            )
    return found


def stem_by_name(names: Iterable[str]) -> str | None:
    """Return which column is called as a stem's position is; None: none."""
    return next((each for each in names if rank_by_name("position_m", each) in (0, 1)), None)


def loop_by_names(names: Sequence[str]) -> tuple[str, str] | None:
    """Return output and process value as they are called, whatever their numbers; None where one of them is not there.

    >>> loop_by_names(["Time", "FIC7.SP", "FIC7.PV", "FIC7.OP"])
    ('FIC7.OP', 'FIC7.PV')
    """
    found = [next((each for each in names if is_called(words, each)), None) for words in (OUTPUT, PROCESS_VALUE)]
    return (found[0], found[1]) if found[0] and found[1] else None


def _is_stem(column: LoopColumn) -> bool:
    return rank_by_name("position_m", column.name) in (0, 1) or column.unit in UNITS["_m"]


def _role(column: LoopColumn) -> str | None:
    """Return what a column is of a loop by its name."""
    return next((role for role, words in WORDS if is_called(words, column.name)), None)


WORDS = (
    ("setpoint", SETPOINT),
    ("output", OUTPUT),
    ("process_value", PROCESS_VALUE),
    ("output", CONTROL_VARIABLE),
)
"""By role, from the surest on."""


def _tag(name: str, role: str) -> str:
    """Return what is left of a name without the words for what it is."""
    words = next(words for each, words in WORDS if each == role)
    left = re.sub(rf"(?:{words})\w*|\b(?:value|CV)\b|[\[(<].*$", " ", split_words(name), flags=re.IGNORECASE)
    return " ".join(re.sub(rf"%|/|{PROCESS_UNITS.pattern}", " ", left, flags=re.IGNORECASE).split())


def _of_no_tag(groups: Mapping[str, Mapping[str, LoopColumn]]) -> dict[str, dict[str, LoopColumn]]:
    """Return one loop of all columns, where no two of a role are there: names may differ in more than the role."""
    roles = [role for group in groups.values() for role in group]
    if len(set(roles)) < len(roles):
        return {}
    joined = {role: each for group in groups.values() for role, each in group.items()}
    return {next((tag for tag in groups if CONTROLLER.search(tag)), ""): joined}


def _because(tag: str, output: LoopColumn, value: LoopColumn, setpoint: LoopColumn | None) -> str:
    """Return why output and process value are a loop's; "" where they may be a valve's command and stem."""
    if output.unit in UNITS["_pa"] or not _is_share(output):
        return ""
    if PROCESS_UNITS.search(value.unit) or PROCESS_UNITS.search(value.name):
        return f"{value.name!r} is in a process's unit"
    if CONTROLLER.search(tag):
        return f"{tag} is a controller's tag"
    if OF_VALVE.search(tag) or setpoint is None or _is_one_signal(setpoint.values, output.values):
        return ""
    return "set point, process value and output stand side by side"


def _is_share(output: LoopColumn) -> bool:
    known = output.values[np.isfinite(output.values)]
    if not known.size:
        return False
    return output.unit in ("", *SHARES) and bool(((known >= LEAST_OUT) & (known <= MOST_OUT)).all())


def _is_one_signal(setpoint: Array, output: Array) -> bool:
    """Return whether a set point is the output itself, as of a valve whose positioner is told what the loop asks."""
    if setpoint.size != output.size:
        return False
    apart = np.abs(setpoint - output)
    known = np.isfinite(apart)
    return bool(known.any()) and float(apart[known].max()) <= OUTPUT_IS_SETPOINT * float(np.ptp(output[known]))


def _stem_of(tag: str, stems: Sequence[LoopColumn], *, alone: bool) -> str | None:
    numbers = set(re.findall(r"\d+", tag))
    of_number = [each for each in stems if numbers & set(re.findall(r"\d+", each.name))]
    if len(of_number) == 1:
        return of_number[0].name
    return stems[0].name if alone and len(stems) == 1 else None
