"""The arguments with which a command names the columns of a control loop."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

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
    columns.add_argument(
        "--op-range",
        type=float,
        nargs=2,
        default=(0.0, 100.0),
        metavar=("AT0", "AT100"),
        help="numbers of the file for 0 %% and 100 %% of OP",
    )
    columns.add_argument(
        "--decimal", choices=(".", ","), metavar="SIGN", help="decimal sign, . or , (the file's, where it is clear)"
    )
    columns.add_argument("--time-format", metavar="FORMAT", help='format of the dates, as "%%d.%%m.%%Y %%H:%%M:%%S"')


def read_record(path: Path, arguments: argparse.Namespace) -> "LoopRecord":
    """Read a loop's record as these arguments say.

    Raises:
        InputError: as `read_loop`; a range without width.
    """
    from workbench.imports.loop_reader import ROLES, read_loop
    from workbench.loops.loop_record import LoopRecord

    low, high = arguments.op_range
    if low == high:
        raise InputError("--op-range", f"must have a width, got {low:g} twice")
    named = {role: given for role in ROLES if (given := getattr(arguments, role))}
    read = read_loop(path, named, (low, high), arguments.time_format, arguments.decimal)
    return LoopRecord.of_samples(read.name, read.time_s, read.op_pct, read.pv, read.sp, read.automatic)
