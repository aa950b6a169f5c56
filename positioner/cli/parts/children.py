"""Other positioner commands as processes of their own: they end with the command that started them, however it does."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NoReturn

from config.errors import InputError
from positioner.cli.parts.breaking_off import end_by
from positioner.testing.child_process import ChildProcess, NotStarted, port_in

__all__ = ["port_in", "running"]


@contextmanager
def running(command: str, config: Path, *options: str) -> Iterator[str]:
    """Run `positioner COMMAND CONFIG` as a process; give its first line, which says that it is ready; end it at last.

    Its log goes to a file beside the config.

    Raises:
        InputError: it ended instead of getting ready; says why.
    """
    words = (command, str(config), *options)
    with end_by(_end):
        try:
            child = ChildProcess("positioner.testing.tied", "positioner.cli", *words, log=config.with_suffix(".log"))
        except NotStarted as error:
            raise InputError(str(config), f"`positioner {command}` did not start: {error}") from None
        try:
            yield child.ready
        finally:
            child.end()


def _end(number: int, _: FrameType | None) -> NoReturn:
    """End the command's contexts first: a slave and a daemon left alone would run for ever."""
    raise SystemExit(128 + number)
