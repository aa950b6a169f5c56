"""`positioner events`: what has happened, out of a daemon's history, also while it runs."""

import argparse
import json
import time
from collections.abc import Collection, Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.codes import Ne107Status
from config.errors import InputError
from positioner.cli.parts.config_argument import add_config, config_file

if TYPE_CHECKING:
    from positioner.history import HistoryReader

HELP = "print the history of a daemon: events, or writes with their sender and role"
EXAMPLE = "positioner events daemon.toml --since 2h --follow"

FOLLOW_EVERY_S = 0.5
TABLES = ("events", "writes", "identifications", "health", "configuration", "configuration_changes")
DURATIONS_S = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86_400.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser, metavar="CONFIG.toml|FILE", text="the daemon's file, or its history.sqlite or its folder")
    parser.add_argument("--valve", metavar="NAME", help="only of this valve")
    parser.add_argument(
        "--since", type=_since, metavar="TIME", help="begin there: 30m, 2h or 7d ago, or 2026-03-01T06:00 (UTC)"
    )
    parser.add_argument("--limit", type=_count, metavar="N", help="only the newest N")
    parser.add_argument("--table", choices=TABLES, default="events", help="what to print")
    parser.add_argument("--follow", action="store_true", help="print new entries until Ctrl-C")
    parser.add_argument("--json", action="store_true", help="print a JSON object a line")


def run(arguments: argparse.Namespace) -> int:
    """Print the entries, oldest first."""

    from positioner.history import HistoryReader

    show = _as_json if arguments.json else _in_words
    where, ours = _history_of(config_file(arguments))
    with HistoryReader(where) as history:
        _require_known(arguments.valve, {*ours, *history.valves()})
        row = 0
        while True:
            found = _found(history, arguments, row)
            for _, entry in found:
                print(show(entry))
            if not arguments.follow:
                return 0
            row = found[-1][0] if found else row
            print(end="", flush=True)
            time.sleep(FOLLOW_EVERY_S)


def _require_known(valve: str | None, known: Collection[str]) -> None:
    """Refuse a name that no valve has: nothing printed would read as: nothing has happened."""

    if valve is not None and valve not in known:
        there = ", ".join(sorted(known)) or "none"
        raise InputError("--valve", f"no valve of that name; there are: {there}, got {valve}")


def _history_of(source: Path) -> tuple[Path, list[str]]:
    """Return where the history is, and the valves of the daemon's file.

    Raises:
        InputError: the daemon's file is at fault, or keeps none.
    """
    from config.daemon_file import load_valves

    if source.suffix != ".toml":
        return source, []
    valves = load_valves(source)
    table = valves[0].history
    if table is None:
        raise InputError(str(source), "has no table [history], so nothing is kept")
    return source.parent / table.folder, [each.valve.name for each in valves]


def _found(history: "HistoryReader", arguments: argparse.Namespace, after_row: int) -> list[tuple[int, Any]]:
    from positioner.history import entries

    table = next(each for each in entries.TABLES if arguments.table == each.TABLE)
    limit = None if after_row else arguments.limit
    return history.rows(table, arguments.valve, arguments.since, after_row=after_row, limit=limit)


def _as_json(entry: Any) -> str:

    from config.json_value import json_value

    return json.dumps(json_value(entry))


def _in_words(entry: Any) -> str:
    from positioner.history.entries import Event, Write

    if isinstance(entry, Event):
        return _join_printable(
            f"{_clock(entry.time_s)}  {entry.number:6}  {entry.valve}",
            f"{Ne107Status(entry.ne107).text:15}",
            entry.words,
        )
    if isinstance(entry, Write):
        who = f"{entry.who} ({entry.role}) at {entry.peer}" if entry.who else entry.peer
        times = f" ({entry.times} times until {_clock(entry.end_s)})" if entry.times > 1 else ""
        return _join_printable(
            _clock(entry.begin_s), entry.valve or "-", who, f"{entry.what} {entry.text}".rstrip() + times
        )
    return _join_printable(*_plain(entry))


def _plain(entry: Any) -> Iterator[str]:

    for name, value in asdict(entry).items():
        if name in ("time_s", "hour_s"):
            yield _clock(value)
        else:
            yield f"{name} {value:.6g}" if isinstance(value, float) else f"{name} {value}"


def _join_printable(*parts: str) -> str:
    """Return one line of them, whatever a client has called itself: no control character leaves it."""
    line = "  ".join(parts)
    return "".join(each if each.isprintable() else "?" for each in line)


def _clock(time_s: float) -> str:

    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%dT%H:%M:%S}.{int(time_s % 1 * 1000):03}Z"


def _since(text: str) -> float:

    if text[-1:] in DURATIONS_S and text[:-1].replace(".", "", 1).isdecimal():
        return time.time() - float(text[:-1]) * DURATIONS_S[text[-1]]
    try:
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        raise argparse.ArgumentTypeError(f"allowed are 30m, 2h, 7d or 2026-03-01T06:00, got {text[:40]!r}") from None


def _count(text: str) -> int:
    if not (text.isdecimal() and 0 < len(text) < 10 and int(text) > 0):
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 up, got {text[:40]!r}")
    return int(text)
