"""Other positioner commands as processes of their own, which end with the command that started them."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

from config.errors import InputError
from positioner.testing.child_process import ChildProcess, NotStarted, port_in

__all__ = ["port_in", "running"]

ENDS = signal.SIGTERM, signal.SIGHUP
"""What ends a command at once: `kill`, a supervisor's time limit, a terminal that is closed."""


@contextmanager
def running(command: str, config: Path, *options: str) -> Iterator[str]:
    """Run `positioner COMMAND CONFIG` as a process; give its first line, which says that it is ready; end it at last.

    Its log goes to a file beside the config.

    Raises:
        InputError: it ended instead of getting ready; says why.
    """
    words = (command, str(config), *options)
    with _ended_in_order():
        try:
            child = ChildProcess("positioner.cli", *words, log=config.with_suffix(".log"))
        except NotStarted as error:
            raise InputError(str(config), f"`positioner {command}` did not start: {error}") from None
        try:
            yield child.ready
        finally:
            child.end()


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Have what ends a command end its contexts first: a slave and a daemon left alone would run for ever."""
    before = {each: handler for each in ENDS if (handler := signal.getsignal(each)) is not signal.SIG_IGN}
    for each in before:
        signal.signal(each, _end)
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _end(number: int, _: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)
