"""`positioner COMMAND ...`: finds the command, runs it, turns bad input into one line and an exit status.

Exit status: 0 done or yes, 1 no (each command says what), 2 bad input, or an output that cannot be written; 130 and
141, as shells have it, when broken off by Ctrl-C and when nobody reads what is printed any more (`| head`).
"""

import argparse
import errno
import gc
import io
import os
import re
import select
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from math import isfinite, nan
from typing import Any, NoReturn

NO_MORE_FILES = frozenset((errno.EMFILE, errno.ENFILE))


def main(words: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    from positioner.own_packages import in_the_way

    _open_what_is_closed()
    try:
        if said := in_the_way():
            print(f"positioner: {said}", file=sys.stderr)
            return 2
        return _run_command(words)
    except KeyboardInterrupt:
        gc.freeze()  # else the interpreter looks through all that is left before it ends: half a second
        return 130
    except OSError as error:
        if error.errno not in NO_MORE_FILES:
            raise
        sys.stderr.write("positioner: this process may not have so many open files: `ulimit -n` says how many\n")
        return 2


def _run_command(words: Sequence[str] | None) -> int:
    """Run one command, now that what it imports is known to be ours."""
    from config.errors import CommandFailed, InputError
    from config.extras import name_missing_extra
    from positioner.cli.parts.output_files import check_outputs

    _escape_what_cannot_be_shown()
    who = "positioner"
    try:
        arguments = _understood(words)
        who = f"positioner {arguments.command}"
        check_outputs(arguments)
        status = int(arguments.run(arguments))
        sys.stdout.flush()
        return status
    except InputError as error:
        print(f"{who}: {error}", file=sys.stderr)
        return 2
    except CommandFailed as error:
        print(f"{who}: {error}", file=sys.stderr)
        return 1
    except ModuleNotFoundError as error:
        if said := name_missing_extra(f"{who}:", error):
            print(said, file=sys.stderr)
            return 2
        raise
    except BrokenPipeError:
        if not _unread():
            raise
        _drop_output()
        return 141
    except OSError as error:
        if not _unprintable():
            raise
        _drop_output()
        print(f"{who}: standard output cannot be written: {error.strerror}", file=sys.stderr)
        return 2


def _open_what_is_closed() -> None:
    """Read nothing, and write to nobody, where who began this closed a standard stream (`>&-`, a service manager).

    Python has none in its place then; and the file that is opened next would be taken for it.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_RDWR), descriptor)
            os.set_inheritable(descriptor, True)  # which it is not yet where it was opened as this one
            setattr(sys, name, open(descriptor, "w" if descriptor else "r"))  # noqa: SIM115


def _escape_what_cannot_be_shown() -> None:
    """Have standard output write as \\xe9 what its encoding lacks, as standard error does: a name, a sign of ours."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def _unprintable() -> bool:
    """Return whether standard output takes no more, such as a file on a full disk: not even the end of a line."""
    try:
        print(flush=True)
    except OSError:
        return True
    return False


def _drop_output() -> None:
    """Drop what is left of standard output: the interpreter would try to write it as it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _unread() -> bool:
    """Return whether nobody reads standard output any more."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in poll.poll(0))


NEGATIVE_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$", re.IGNORECASE)


class WithDefaults(argparse.HelpFormatter):
    """Help that ends with the default in brackets, where an option has one."""

    def _get_help_string(self, action: argparse.Action) -> str:
        default, text = action.default, action.help or ""
        if default is None or default is False or default in ([], argparse.SUPPRESS):
            return text
        values = default if isinstance(default, tuple) else (default,)
        return f"{text} ({' '.join(f'{each:g}' if isinstance(each, float) else str(each) for each in values)})"


class Grouped(WithDefaults):
    """Help whose list of commands has a heading before each group."""

    def __init__(self, *what: Any, headings: Mapping[str, str], **named: Any) -> None:
        super().__init__(*what, **named)
        self._headings = headings

    def _format_action(self, action: argparse.Action) -> str:
        text = super()._format_action(action)
        heading = self._headings.get(action.dest)
        return text if heading is None else f"\n  {heading}:\n{text}"


class OneLine(argparse.ArgumentParser):
    """A parser that says what is wrong in one line, as every command does, without its usage before it.

    A number (`type=float`) is a finite one in every command: NaN passes comparisons that are to refuse it. A negative
    one with an exponent is a number, too; argparse takes it for an option (until Python 3.14).
    """

    def __init__(self, *what: Any, **named: Any) -> None:
        super().__init__(*what, **{"formatter_class": WithDefaults, **named})
        self.register("type", float, _finite)
        self._negative_number_matcher = NEGATIVE_NUMBER

    def error(self, message: str) -> NoReturn:
        """End with it, and with the status of bad input."""
        self.exit(2, f"{self.prog}: {message}; `{self.prog} --help` says more\n")


def _finite(text: str) -> float:
    """Return a number that a word is.

    Raises:
        ArgumentTypeError: it is none, or not finite.
    """
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"must be a finite number, got {text!r}")
    return value


def _understood(words: Sequence[str] | None) -> argparse.Namespace:
    """Return what the words say; of one too many its command tells, whose help lists what it takes."""
    given = list(sys.argv[1:] if words is None else words)
    arguments, unknown = command_parser(given).parse_known_args(given)
    if unknown:
        OneLine(prog=f"positioner {arguments.command}").error(f"unrecognized arguments: {' '.join(unknown)}")
    return arguments


def command_parser(words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Return the parser of the command that the words begin with, or of all: what is parsed is imported."""
    from importlib.metadata import version

    from positioner.cli.parts.command_finder import commands_for, headings

    found = commands_for(list(words))
    parser = OneLine(
        prog="positioner",
        description="Identifies and positions sticking pneumatic control valves over fieldbus.",
        epilog="Exit status: 0 done or yes, 1 no (each command says what), 2 bad input. "
        "In the help of a command, brackets after an option hold its default.",
        formatter_class=partial(Grouped, headings=headings([each.name for each in found])),
    )
    parser.add_argument("--version", action="version", version=f"positioner {version('positioner')}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for each in found:
        if len(found) > 1 and each.lacks:
            commands.add_parser(each.name, help=each.lacks)
            continue
        module = each.module
        command = commands.add_parser(
            each.name, help=module.HELP, description=module.HELP, epilog=f"example: {module.EXAMPLE}"
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser
