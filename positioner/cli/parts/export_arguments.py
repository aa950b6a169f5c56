"""The arguments with which a command takes a historian's exports in place of recordings."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.recording import Recording


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    export = parser.add_argument_group("historian's exports in place of recordings")
    export.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="OURS=THEIRS:UNIT",
        help="where a column comes from, once for each: time_s=Time position_m=PV:%% command_pa=OUT:bar",
    )
    export.add_argument("--stroke-m", type=float, metavar="M", help="100 %% of a position (the valve file's stroke)")
    export.add_argument(
        "--range-pa", type=float, nargs=2, metavar=("AT0", "AT100"), help="0 %% and 100 %% of a pressure (20e3 100e3)"
    )


def read_any(path: Path, arguments: argparse.Namespace, stroke_m: float) -> "Recording":
    """Read a recording, or an export if columns are mapped: all of a command's by the same mapping.

    Raises:
        InputError: as `Recording.read` and `read_export`; a range without columns to apply it to.
    """
    from config.errors import InputError
    from config.historian_export import RANGE_PA, read_export, read_mapping
    from config.recording import Recording

    if not arguments.column:
        for name in ("stroke_m", "range_pa"):
            if getattr(arguments, name) is not None:
                raise InputError(f"--{name.replace('_', '-')}", "goes with --column; a recording is in SI units")
        return Recording.read(path)
    sources = read_mapping(arguments.column)
    range_pa = RANGE_PA if arguments.range_pa is None else tuple(arguments.range_pa)
    return read_export(path, sources, arguments.stroke_m or stroke_m, range_pa)
