"""Errors for people: each is a single line, of bounded length, whatever it quotes of a file or a library."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

PROBLEM_CHARACTERS = 2000
"""Characters of a problem; what stands in its middle beyond that is left out."""


def one_line(text: str) -> str:
    """Return a text as one line: what would break it is a blank, what cannot be printed is escaped.

    >>> one_line("two\\nlines, a bell\\a and \\x1b")
    'two lines, a bell\\\\x07 and \\\\x1b'
    """
    if not text.isprintable():
        said = " ".join(text.splitlines())
        text = "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in said)
    return (
        text
        if len(text) <= PROBLEM_CHARACTERS
        else f"{text[: PROBLEM_CHARACTERS // 2]} .. {text[-PROBLEM_CHARACTERS // 2 :]}"
    )


class InputError(Exception):
    """Bad input from a person: names file, key, value and what is allowed.

    Commands print it as one line on standard error and exit with status 2.
    """

    def __init__(self, source: str, problem: str) -> None:
        self.source = one_line(source)
        self.problem = one_line(problem)
        super().__init__(f"{self.source}: {self.problem}")

    def named(self, names: Mapping[str, str]) -> "InputError":
        """Return the same of a source, or of a place in it, that a person knows by another name.

        >>> str(InputError("valve file: effect preload", "none").named({"valve file": "v.toml"}))
        'v.toml: effect preload: none'
        """
        kind, colon, place = self.source.partition(": ")
        return type(self)(f"{names.get(kind, kind)}{colon}{place}", self.problem)

    def __reduce__(self) -> tuple[type["InputError"], tuple[str, str]]:
        """Pass between processes, as what a worker could not do is told by another."""
        return type(self), (self.source, self.problem)


@contextmanager
def explain_failure(source: object, problem: str) -> Iterator[None]:
    """Name a file, a folder or an address when what is done with it fails, the problem, and the system's reason.

    >>> with explain_failure("site.toml", "cannot be read"):
    ...     open("no/such/file")
    Traceback (most recent call last):
    config.errors.InputError: site.toml: cannot be read: No such file or directory

    Raises:
        InputError: the system refused it (`OSError`).
    """
    try:
        yield
    except OSError as error:
        raise InputError(str(source), f"{problem}: {error.strerror or error}") from None


class CommandFailed(Exception):
    """What a command was asked does not hold, or could not be done: it prints the one line, exit status 1."""
