"""`positioner alarms`: the alarms of a running valve; acknowledges and shelves them."""

import argparse
import json

from config.alarm_advice import ADVICE
from config.codes import Ne107Cause
from config.errors import InputError
from positioner.cli.parts.daemon_address import add_connection, connect_dcs

HELP = "list the alarms of a valve with cause and advice; acknowledge or shelve one"
EXAMPLE = "positioner alarms --acknowledge friction_high"

MINUTE_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--acknowledge", metavar="ALARM", help="acknowledge this alarm, or all")
    what.add_argument("--shelve", metavar="ALARM", help="shelve this alarm for --minutes")
    what.add_argument("--unshelve", metavar="ALARM", help="end its shelving")
    parser.add_argument("--minutes", type=float, default=60.0, metavar="N", help="time of shelving")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Do what is asked for, then print the alarms; exit status 1 while one is unacknowledged."""

    from northbound.observer.seen_alarms import ALARM_READS, alarms

    wanted = {name: _cause(getattr(arguments, name)) for name in ("shelve", "unshelve") if getattr(arguments, name)}
    if arguments.acknowledge not in (None, "all"):
        wanted["acknowledge"] = _cause(arguments.acknowledge)
    for_s = _seconds(arguments.minutes) if "shelve" in wanted else 0.0
    with connect_dcs(arguments) as dcs:
        for name, cause in wanted.items():
            written = {"alarm_acknowledge": cause} if name == "acknowledge" else {"alarm_shelve": cause}
            dcs.set_all({**written, **({} if name == "acknowledge" else {"alarm_shelve_time": for_s})})
        if arguments.acknowledge == "all":
            for each in alarms(dcs.get_all(*ALARM_READS)):
                if each.unseen:
                    dcs.set("alarm_acknowledge", each.cause)
        shown = list(alarms(dcs.get_all(*ALARM_READS)))
    if arguments.json:
        print(json.dumps({each.name: {"state": each.state.text, "cause": each.text} for each in shown}))
    else:
        for each in shown:
            print(f"{each.name:20} {each.state.text:36} {each.text}\n{'':20} {each.advice}")
        if not shown:
            print("no alarms")
    return 1 if any(each.unseen for each in shown) else 0


def _cause(name: str) -> Ne107Cause:
    """Return the cause of an alarm's name.

    Raises:
        InputError: there is none; names those there are.
    """

    for each in ADVICE:
        if each.name.lower() == name:
            return each
    raise InputError(name, f"no alarm of that name; allowed: {', '.join(each.name.lower() for each in ADVICE)}")


def _seconds(minutes: float) -> float:

    if not 0.0 < minutes < 1e5:
        raise InputError("--minutes", f"must be more than 0 and less than 100000, got {minutes:g}")
    return MINUTE_S * minutes
