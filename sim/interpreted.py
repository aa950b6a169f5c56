"""The valve's laws with its effects in their places, as plain Python functions.

What `sim.kernel` compiles for whole runs, for those who ask a single place a few times: the forces where a stem rests.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from sim import karnopp
from sim.effect import Effect, execute
from sim.kernel_source import OWN, Filling, effect_source, fillings

BASE = Path(karnopp.__file__)


def interpreted(effects: Sequence[Effect]) -> Any:
    """Return a module like `sim.karnopp` whose empty places are filled with these effects.

    A place takes what the kernel's does: theta and the state as q and z.
    """
    module = ModuleType("interpreted_valve")
    exec(compile(BASE.read_text(encoding="utf-8"), str(BASE), "exec", dont_inherit=True), module.__dict__)
    parts = [_places(each) for each in effects]
    for place, filled in fillings(effects).items():
        if filled:
            module.__dict__[place] = _one_after_the_other([(parts[each.effect][place], each) for each in filled])
    return module


class Law(NamedTuple):
    """An effect's own function in a place, of the arguments that it names, the last its parameters'."""

    function: Callable[..., Any]
    parameters: Callable[..., Any]


def own_law(effect: Effect, place: str) -> Law:
    """Return the law by which an effect without a memory fills a place."""
    own: dict[str, Any] = {"__name__": effect.name}
    execute(effect.source, effect.path, own)
    return Law(own[place], own["Parameters"])


def _places(effect: Effect) -> dict[str, Any]:
    """Return the functions by which an effect fills its places."""
    own: dict[str, Any] = {"__name__": effect.name}
    execute(effect.source, effect.path, own)
    places: dict[str, Any] = {OWN.format(name): value for name, value in own.items()} | {"carray": _first}
    exec(compile("\n".join(effect_source(effect).values()), "places", "exec", dont_inherit=True), places)
    return places


def _first(memory: Any, count: int) -> Any:
    return memory[:count]


def _one_after_the_other(parts: Sequence[tuple[Callable[..., Any], Filling]]) -> Callable[..., Any]:
    def place(*given: Any) -> Any:
        *values, q, z = given
        left: Any = None
        for function, at in parts:
            left = function(*values, q[at.parameters :], z[at.memory :])
            handed_on = left if isinstance(left, tuple) else () if left is None else (left,)
            values[: len(handed_on)] = handed_on
        return left

    return place
