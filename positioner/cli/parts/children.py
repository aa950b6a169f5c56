"""Other positioner commands as processes of their own."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from config.errors import InputError
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
    try:
        child = ChildProcess("positioner.cli", *words, log=config.with_suffix(".log"))
    except NotStarted as error:
        raise InputError(str(config), f"`positioner {command}` did not start: {error}") from None
    try:
        yield child.ready
    finally:
        child.end()
