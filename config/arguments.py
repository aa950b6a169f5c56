"""What a function of the library is given: another kind of thing is refused at its door, in one line.

Without that it would be a missing attribute somewhere inside. Held is what the function's own annotations name, alone
or in a list; where one names more than kinds (arrays, functions, truth), it is the function that asks.
"""

import inspect
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ParamSpec, SupportsFloat, SupportsIndex, TypeVar, get_args, get_origin

from config.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

ACCEPTED: dict[type, type] = {int: SupportsIndex, float: SupportsFloat, Path: os.PathLike}
"""What does as well as one of these, numpy's numbers among them."""
SAID = {str: "text", Path: "path", int: "whole number", float: "number"}
READ_BY = {"Recording": " (Recording.read(file) reads one)", "ValveFile": " (valve(name) reads one)"}
"""How a person comes by one, by the kind's name."""


@dataclass(frozen=True)
class _Wanted:
    """One kind that an argument may be, or a list of such."""

    kind: type
    listed: bool

    def allows(self, given: object) -> bool:
        kind = ACCEPTED.get(self.kind, self.kind)
        if not self.listed:
            return isinstance(given, kind)
        if isinstance(given, str | bytes) or not isinstance(given, Collection):
            return isinstance(given, Iterator)
        return all(isinstance(each, kind) for each in given)

    def __str__(self) -> str:
        if self.kind is NoneType:
            return "None"
        name = SAID.get(self.kind, self.kind.__name__)
        return f"a list of {name}s" if self.listed else f"a {name}{READ_BY.get(name, '')}"


def kinds_held(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function be called only with the kinds of things that its annotations name.

    Raises:
        InputError: it is called with something else; says with which, for which argument, and what is allowed.
    """
    parameters = inspect.signature(function).parameters
    allowed = {name: _kinds_of(each.annotation) for name, each in parameters.items()}

    @wraps(function)
    def check_arguments(*args: P.args, **kwargs: P.kwargs) -> R:
        for name, given in {**dict(zip(parameters, args, strict=False)), **kwargs}.items():
            wanted = allowed.get(name)
            if wanted and not any(each.allows(given) for each in wanted):
                raise InputError(name, f"must be {' or '.join(map(str, wanted))}, got {_show_given(given, wanted)}")
        return function(*args, **kwargs)

    return check_arguments


def _kinds_of(annotation: Any) -> tuple[_Wanted, ...]:
    """Return the kinds that an annotation names; none where it names something else, too."""
    parts = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
    found = [(get_args(each)[0], True) if get_origin(each) is Sequence else (each, False) for each in parts]
    if not all(isinstance(kind, type) and kind not in (bool, inspect.Parameter.empty) for kind, _ in found):
        return ()
    return tuple(_Wanted(kind, listed) for kind, listed in found)


def _show_given(given: object, wanted: Sequence[_Wanted]) -> str:
    """Return what was given: itself where it is short, else its kind; of one where a list is wanted, that list."""
    if any(each.listed and isinstance(given, each.kind) for each in wanted) and isinstance(given, str):
        return f"{given!r}; one is [{given!r}]"
    if isinstance(given, str | bytes | int | float | os.PathLike | NoneType):
        return repr(given)
    if isinstance(given, list | tuple) and given:
        return f"a {type(given).__name__} of {' and '.join(sorted({type(each).__name__ for each in given}))}"
    return f"a {type(given).__name__}"
