"""The arguments with which a command names the columns of a control loop."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.errors import InputError

if TYPE_CHECKING:
    from workbench.loops.loop_record import LoopRecord


def add_loop_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    columns = parser.add_argument_group("columns", "needed only if the names in the file do not show them")
    for role, what in (
        ("time", "the time"),
        ("op", "the controller's output OP"),
        ("pv", "the process value PV"),
        ("sp", "the set point SP"),
        ("mode", "the controller's mode"),
    ):
        columns.add_argument(f"--{role}", metavar="NAME", help=f"the column of {what}")
    add_notation_arguments(columns)


def add_notation_arguments(parser: argparse._ActionsContainer) -> None:
    """Declare how numbers and dates of a file are written."""
    parser.add_argument(
        "--op-range",
        type=float,
        nargs=2,
        metavar=("AT0", "AT100"),
        help="numbers of the file for 0 %% and 100 %% of OP (0 100)",
    )
    parser.add_argument(
        "--decimal", choices=(".", ","), metavar="SIGN", help="decimal sign, . or , (the file's, where it is clear)"
    )
    parser.add_argument("--time-format", metavar="FORMAT", help='format of the dates, as "%%d.%%m.%%Y %%H:%%M:%%S"')


def notation(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return how numbers and dates are written, as `read_loop` takes it.

    Raises:
        InputError: a range without width.
    """
    op_range = None if arguments.op_range is None else tuple(arguments.op_range)
    if op_range and op_range[0] == op_range[1]:
        raise InputError("--op-range", f"must have a width, got {op_range[0]:g} twice")
    return {"op_range": op_range, "time_format": arguments.time_format, "decimal": arguments.decimal}


def read_record(path: Path, arguments: argparse.Namespace) -> "LoopRecord":
    """Read a loop's record as these arguments say.

    Raises:
        InputError: as `read_loop`; a range without width.
    """
    from workbench.imports.loop_reader import ROLES, read_loop

    named = {role: given for role in ROLES if (given := getattr(arguments, role))}
    read = read_loop(path, named, **notation(arguments))
    from workbench.loops.loop_record import LoopRecord  # after what may be refused: it loads all that diagnoses

    return LoopRecord.of_export(read)
