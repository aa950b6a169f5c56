"""Makers of the core's records: a field is given by its name alone, so that no two can be swapped unseen.

    make = by_name(Record);  make(a=1.0, b=2.0)

A tuple with names is made anew in each step, several of them. Its class takes keywords as a dictionary, at three times
the cost of a function that has them as its own arguments.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

Fields = ParamSpec("Fields")
Record = TypeVar("Record", bound=tuple[object, ...])


def by_name(record: Callable[Fields, Record]) -> Callable[Fields, Record]:
    """Return a function that makes a record, the class of a `NamedTuple`; it takes its fields by name alone.

    >>> from typing import NamedTuple
    >>> class Pair(NamedTuple):
    ...     first: float
    ...     second: float = 0.0
    >>> by_name(Pair)(first=1.0)
    Pair(first=1.0, second=0.0)
    """
    names = ", ".join(getattr(record, "_fields"))  # noqa: B009 - every tuple with names has them
    made: dict[str, Callable[Fields, Record]] = {}
    exec(f"def make(*, {names}): return new(record, ({names},))", {"new": tuple.__new__, "record": record}, made)
    made["make"].__kwdefaults__ = dict(getattr(record, "_field_defaults"))  # noqa: B009
    return made["make"]
