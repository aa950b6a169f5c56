"""What a parser of bytes is: it ends in silence, or tells what is wrong with it.

A parser gives an answer, or one refusal of its own kind in one line. Anything else (a traceback, a second of work on a
few bytes, memory without bound) is a fault of ours. `benchmarks.fuzz` and `tests/fuzz/test_parsers.py` try them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

LONGEST_SENTENCE = 5000


@dataclass(frozen=True, slots=True)
class Parser:
    """A parser, inputs that it takes, and what share of the inputs of a long run is its."""

    parse: Callable[[bytes], None]
    good: Sequence[bytes]
    share: float
    text: bool = False


class Later(Sequence[bytes]):
    """An input that is made when it is first asked for: what makes it takes long to load."""

    def __init__(self, make: Callable[[], bytes]) -> None:
        self._make = cache(make)

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: Any) -> Any:
        return (self._make(),)[index]


class Broken(AssertionError):
    """A parser did neither answer nor refuse in one line."""


def refused_in_one_line(act: Callable[[], object], *kinds: type[Exception]) -> None:
    """Do something that may be refused."""
    try:
        act()
    except kinds as refusal:
        said = str(refusal)
        if not said or "\n" in said or "\r" in said or len(said) > LONGEST_SENTENCE:
            raise Broken(f"no sentence in one line: {said[:200]!r}") from refusal


def require_line(problem: str | None) -> None:
    """Require a sentence, where there is one, to be one line."""
    if problem is not None and ("\n" in problem or len(problem) > LONGEST_SENTENCE):
        raise Broken(f"no sentence in one line: {problem[:200]!r}")
