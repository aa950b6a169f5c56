"""`positioner certificates`: an authority and certificates to try Modbus/TCP Security with."""

import argparse
from pathlib import Path

from config.errors import InputError
from config.hosts import is_host
from config.roles import Role
from config.whole_file import filling

HELP = "make certificates for trials of Modbus/TCP Security: an authority, each end, each role"
EXAMPLE = "positioner certificates -o certificates --host gateway-7 --host 10.0.0.7"

HERE = ("localhost", "127.0.0.1")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="DIR", help="a new or empty folder")
    parser.add_argument(
        "--host",
        action="append",
        metavar="NAME",
        help=f"host name or address of device or daemon ({', '.join(HERE)})",
    )
    parser.add_argument("--days", type=_days, default=365, help="days of validity")


def run(arguments: argparse.Namespace) -> int:
    """Make them, and say what each is for.

    Raises:
        InputError: a host name that is none; a folder that is not empty, or cannot be written.
    """
    from positioner.cli.parts.trial_authority import Authority, Owner

    hosts = tuple(arguments.host or HERE)
    for host in hosts:
        if not is_host(host):
            raise InputError("--host", f"must be a host name or an IP address, got {host!r}")
    owners = {
        Owner("device", hosts): "the device: [bus.tls] of a simulated one",
        Owner("daemon", hosts, Role.OPERATOR): "the daemon: [supervisory.tls], and [device.tls] as an operator",
        Owner("observer", (), Role.OBSERVER): "a DCS that may read",
        Owner("operator", (), Role.OPERATOR): "a DCS that may write reference, acknowledge and heartbeat, too",
        Owner("engineer", (), Role.ENGINEER): "a DCS that may write everything",
    }
    folder: Path = arguments.out
    try:
        with filling(folder) as new:
            authority = Authority(new, arguments.days)
            for owner in owners:
                authority.sign(owner)
    except FileExistsError:
        raise InputError(f"-o {folder}", "must be a new or empty folder: keys are never written over") from None
    except OSError as error:
        raise InputError(f"-o {folder}", f"cannot be written: {error.strerror}") from None
    print(f"{folder / 'authority.pem'}  signs all of these for {arguments.days:g} days")
    for owner, purpose in owners.items():
        print(f"{folder / (owner.name + '.pem')}, .key  {purpose}")
    print("For trials only: the authority's key lies beside what it signs.")
    return 0


def _days(text: str) -> float:
    try:
        days = float(text)
    except ValueError:
        days = 0.0
    if not 0 < days <= 36500:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of days, above 0 to 36500")
    return days
