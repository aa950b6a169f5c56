"""`positioner import`: another program's export, looked at, read, and written as a recording."""

import argparse
from pathlib import Path

from positioner.cli.parts.export_arguments import add_export_arguments, export_options, read_mapped

HELP = "list what an export holds and the words that read it; with --column, say what is read, and write it with -o"
EXAMPLE = (
    "positioner import trend.csv --column time_s=Time --column position_m=PV:mm --column command_pa=OUT:bar -o rec.csv"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("file", type=Path, metavar="FILE", help="an export: CSV, .xlsx, .mat, Parquet; or a recording")
    parser.add_argument("-o", "--out", type=Path, metavar="REC.csv", help="write the recording; nothing else writes")
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what the file holds, or what is read of it; 0."""
    from config.errors import InputError
    from config.exports.own_format import own_recording
    from config.exports.plausibility import oddities
    from config.recording import Recording
    from positioner.cli.parts.breaking_off import told_when_broken_off
    from positioner.cli.parts.output_files import writable
    from positioner.cli.parts.progress import Progress

    if arguments.out is not None:
        writable(arguments.out, "-o")
    if arguments.column:
        progress = Progress()
        with told_when_broken_off("import", lambda: progress.known):
            recording = read_mapped(arguments.file, arguments, None, progress)
    else:
        recording = own_recording(arguments.file) or Recording({})
        if not recording.columns:
            if arguments.out is not None:
                raise InputError("-o", "needs to know the columns: --column; without -o this command proposes them")
            return _list(arguments)
    print(f"{arguments.file}: {recording.summary()}")
    for said in oddities(recording, arguments.stroke_m):
        print(f"look: {said}")
    if arguments.out is not None:
        recording.write(arguments.out)
        print(f"{arguments.out}: {len(recording)} rows, to be read without --column")
    return 0


def _list(arguments: argparse.Namespace) -> int:
    from config.exports.export_preview import preview

    export_options(arguments)
    print(f"{arguments.file}: {preview(arguments.file, arguments.sheet).summary()}")
    return 0
