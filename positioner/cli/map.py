"""`positioner map`: the supervisory register map."""

import argparse
import json
import sys
from pathlib import Path

from config.codes import Refusal
from config.errors import InputError
from config.registers import REGISTERS, Register

HELP = "print the map of the registers, or the configuration of a program that reads them"
EXAMPLE = "positioner map --format md"

FOR_OTHERS = ("telegraf", "modbus-exporter", "home-assistant", "node-red")
"""Programs that are configured to read it."""
COLUMNS = (
    *("name", "address", "address_from_1", "type", "word_order", "unit", "minimum", "maximum", "access"),
    *("writer", "text"),  # the role that may write it on a secured connection
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument(
        "--format",
        choices=("md", "csv", "json", *FOR_OTHERS, "eds"),
        default="md",
        help="md, csv, json: the map; eds: the simulated CANopen device; others: the configuration of that program",
    )
    parser.add_argument(
        "--config", type=Path, metavar="CONFIG.toml", help="the daemon's file, for the configuration of a program"
    )
    parser.add_argument("--reasons", action="store_true", help="print the meaning of the numbers in *_reason")


def run(arguments: argparse.Namespace) -> int:
    """Print the map, or the reasons.

    Raises:
        InputError: a configuration for another program, and no daemon's file to say where; or a fault in it; or such a
            file that nothing would be read of.
    """
    if arguments.format in FOR_OTHERS:
        _configuration(arguments.format, arguments.config)
        return 0
    if arguments.config is not None:
        from config.errors import InputError

        allowed = f"--format {', '.join(FOR_OTHERS)}"
        raise InputError("--config", f"goes with {allowed}: the map itself is the same for every daemon")
    if arguments.format == "eds":
        from fieldbus.canopen.eds import eds_text

        print(eds_text(), end="")
        return 0
    if arguments.reasons:
        rows = [{"number": int(each), "name": each.name.lower(), "text": each.text} for each in Refusal]
    else:
        rows = [_row(register) for register in sorted(REGISTERS, key=lambda register: register.address)]
    if arguments.format == "json":
        print(json.dumps(rows, indent=1))
    else:
        {"md": _markdown, "csv": _csv}[arguments.format](rows)
    return 0


def _configuration(reader: str, config: Path | None) -> None:
    from config.daemon_file import load_valves
    from northbound.client_configurations.register_readers import configuration

    if config is None:
        raise InputError(f"--format {reader}", "needs --config, the daemon's file that says where the registers are")
    print(configuration(reader, load_valves(config), str(config)), end="")


def _row(register: Register) -> dict[str, object]:
    order = "most significant word first" if register.format.words > 1 else ""
    values = (
        register.name,
        register.address,
        register.address + 1,
        register.type,
        order,
        register.unit,
        register.minimum,
        register.maximum,
        register.access,
        register.writer.name.lower() if register.access == "rw" else "",
        register.text,
    )
    return dict(zip(COLUMNS, values, strict=True))


def _markdown(rows: list[dict[str, object]]) -> None:
    print("| " + " | ".join(rows[0]) + " |")
    print("|" + "---|" * len(rows[0]))
    for row in rows:
        print("| " + " | ".join(_cell(value) for value in row.values()) + " |")


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _csv(rows: list[dict[str, object]]) -> None:
    import csv

    writer = csv.DictWriter(sys.stdout, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
