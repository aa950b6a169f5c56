"""`positioner report`: as found and as left, from the records of tests on a valve."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from config.errors import CommandFailed, InputError, explain_failure
from positioner.cli.parts.config_argument import add_config, config_file
from positioner.cli.parts.output_files import writable, write_text

HELP = "write the report of a valve as found and as left: one HTML or PDF file"
EXAMPLE = "positioner report site.toml -o FV-101.html --recommended seat_load_n=1200"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser)
    parser.add_argument("--valve", dest="name", metavar="NAME", help="the valve's name, where the file has several")
    parser.add_argument(
        "--recommended",
        nargs="+",
        default=[],
        metavar="FIGURE=VALUE",
        help="recommended figures, by name, in SI units",
    )
    parser.add_argument("-o", dest="out", type=Path, required=True, metavar="FILE", help="the report, .html or .pdf")


def run(arguments: argparse.Namespace) -> int:
    """Write the report; 1 if nothing is kept."""
    from config.daemon_file import load_daemon
    from positioner.history.kept_tests import records_folder
    from positioner.tests_on_the_valve.as_found_report import ValveReport, as_html, recommended_by, write_pdf
    from positioner.tests_on_the_valve.kept_records import records

    path = config_file(arguments)
    writable(arguments.out, "-o")
    if arguments.out.suffix.lower() not in (".html", ".pdf"):
        raise InputError(f"-o {arguments.out}", "allowed are .html and .pdf")
    file = load_daemon(path, arguments.name)
    folder = records_folder(file, path)
    kept = records(folder)
    if not any(each.kind for each in kept):
        raise CommandFailed(f"nothing is kept in {folder}: a test with --keep as_found or as_left keeps it")
    report = ValveReport(file.valve.name, kept, _read_recommended(arguments.recommended, kept), recommended_by(file))
    if arguments.out.suffix.lower() == ".pdf":
        with explain_failure(f"-o {arguments.out}", "cannot be written"):
            write_pdf(report, arguments.out)
    else:
        write_text(arguments.out, as_html(report), "-o")
    print(f"{arguments.out}: {', '.join(report.tests())} of {file.valve.name}")
    return 0


def _read_recommended(words: Sequence[str], kept: Sequence[object]) -> dict[str, float]:
    """Return figures by name.

    Raises:
        InputError: a word is no figure of a test, or no number.
    """
    from positioner.tests_on_the_valve.kept_records import Record

    quantities = [each for record in kept if isinstance(record, Record) for each in record.outcome.quantities]
    known, told = {each.own_name: each.name for each in quantities}, {}
    for word in words:
        name, _, value = word.partition("=")
        if name not in known:
            raise InputError(f"--recommended {word}", f"no figure of that name; there are: {', '.join(sorted(known))}")
        try:
            told[known[name]] = float(value)
        except ValueError:
            raise InputError(f"--recommended {word}", "allowed is FIGURE=NUMBER") from None
    return told
