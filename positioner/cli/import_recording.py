"""`positioner import`: another program's export, looked at, read, and written as a recording."""

import argparse
import shlex
from pathlib import Path

from config.errors import InputError
from positioner.cli.parts.breaking_off import tell_when_broken_off
from positioner.cli.parts.export_arguments import add_export_arguments, mapping_of
from positioner.cli.parts.output_files import recording_writable
from positioner.cli.parts.progress import Progress

HELP = "read a file of another program: list its columns and propose options; with -o write a recording"
EXAMPLE = (
    "positioner import trend.csv --column time_s=Time --column position_m=PV:mm --column command_pa=OUT:bar -o rec.csv"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    kinds = "CSV, .xlsx, .mat, HDF5, TDMS, MDF4, Parquet"
    parser.add_argument("file", type=Path, metavar="FILE", help=f"the file: {kinds}, or a recording")
    parser.add_argument("-o", "--out", type=Path, metavar="REC.csv", help="write the recording")
    parser.add_argument(
        "--inspect", action="store_true", help="ask what FILE leaves open, and write the mapping to FILE.mapping.toml"
    )
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what the file holds, or what is read of it; 0."""
    from config.recording_oddities import oddities
    from workbench.imports.column_mapping import read_status
    from workbench.imports.export_preview import preview
    from workbench.imports.own_format import own_recording

    mapping = mapping_of(arguments)
    if arguments.inspect:
        return _inspect(arguments)
    if arguments.out is not None:
        recording_writable(arguments.out, "-o")
    if mapping.column:
        progress = Progress()
        with tell_when_broken_off("import", lambda: progress.known):
            recording = mapping.read(arguments.file, progress=progress)
    else:
        own = own_recording(arguments.file)
        if own is None:
            if arguments.out is not None:
                raise InputError("-o", "needs to know the columns: --column; without -o this command proposes them")
            read_status(mapping.status)
            print(f"{arguments.file}: {preview(arguments.file, arguments.sheet).summary()}")
            return 0
        recording = own
    print(f"{arguments.file}: {recording.summary()}")
    for said in oddities(recording, mapping.stroke_m):
        print(f"look: {said}")
    if arguments.out is not None:
        recording.write(arguments.out)
        print(f"{arguments.out}: {len(recording)} rows; this file needs no --column")
    return 0


def _inspect(arguments: argparse.Namespace) -> int:
    """Show what the file holds, ask what it leaves open, write it down, and say what reads it."""

    from workbench.imports.export_mapping import write_mapping_file
    from workbench.imports.export_preview import preview
    from workbench.imports.import_questions import ask_for_mapping

    found = preview(arguments.file, arguments.sheet)
    print(f"{arguments.file}: {found.summary()}")
    mapping = arguments.file.with_name(f"{arguments.file.name}.mapping.toml")
    table = ask_for_mapping(found, _ask).model_copy(update={"sheet": arguments.sheet, "decimal": arguments.decimal})
    write_mapping_file(mapping, table)
    print(f"{mapping}: written; all exports like this one are read with it:")
    print(f"positioner import {shlex.quote(str(arguments.file))} --mapping {shlex.quote(str(mapping))} -o rec.csv")
    return 0


def _ask(question: str, otherwise: str) -> str:

    print(f"{question} {f'[{otherwise}] ' if otherwise else ''}", end="", flush=True)
    try:
        return input().strip() or otherwise
    except EOFError:
        print()
        raise InputError("--inspect", "the answers ended before the questions; nothing was written") from None
