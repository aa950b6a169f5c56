"""Writes the functions by which an effect fills its places of `karnopp.py`.

Several effects fill a place one after the other: what leaves one enters the next, and what is empty hands it on.
The effect's own functions stand beside them as `own_force`, `own_advance`, ...; q begins with its parameters, z with
its memory.
A signal that passes through an element is known at the start and at the end of a step: the element shows its output
for the old memory, carries its memory over the step, and shows its output for the new one.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from sim import first_order_lag, karnopp, quasi_static
from sim.effect import AT_STEM, Effect
from sim.karnopp import BASE_PARAMETERS, MEMORY

SHARED = (first_order_lag,)
"""Elements that effects may import; compiled with them."""
PLACES: Mapping[str, Callable[..., Any]] = {
    "start_pressure": karnopp.start_pressure,
    "start_stem": karnopp.start_stem,
    "straight": karnopp.straight,
    "pressure": karnopp.pressure,
    "pressure_ends": quasi_static.pressure_ends,
    "force": karnopp.force,
    "friction": karnopp.friction,
    "motion": karnopp.motion,
    "remember": karnopp.remember,
    "sensor": karnopp.sensor,
}
"""Empty, as the laws' texts have them."""
OWN = "own_{}"
STEM = {name: f"stem.{name}" for name in ("t", "x", "v", "p")} | {"middle": "stem.t"}
SAME = {name: name for name in ("u", "h", "F_c", "F_s", "direction", "F_e", "stiffness")}


class Filling(NamedTuple):
    """An effect in a place, and where its parameters and its memory begin in theta and state."""

    effect: int
    parameters: int
    memory: int


def fillings(effects: Sequence[Effect]) -> dict[str, list[Filling]]:
    """Return what fills each of the places, in the order of the effects."""
    parameters = accumulate((len(each.parameters) for each in effects), initial=BASE_PARAMETERS)
    memories = accumulate((each.memory for each in effects), initial=MEMORY)
    all_of_them = [Filling(*each) for each in zip(range(len(effects)), parameters, memories, strict=False)]
    texts = [effect_source(each) for each in effects]
    filled = {place: [each for each in all_of_them if place in texts[each.effect]] for place in PLACES}
    if not any("straight" in each.functions for each in effects):
        filled["straight"] = []  # nothing cuts a step
    return filled


def effect_source(effect: Effect) -> dict[str, str]:
    """Return the texts of the places that an effect fills."""
    places: list[str] = []
    if "pressure" in effect.functions:
        places += _pressure_path(effect)
    if "sensor" in effect.functions:
        places += _sensor(effect)
    if "force" in effect.functions:
        places += [_place(effect, "force(F, stem, q, z)", [f"F += {_call(effect, 'force')}"], "F")]
    if "friction" in effect.functions:
        levels = [f"F_c, F_s = {_call(effect, 'friction')}"]
        places += [_place(effect, "friction(F_c, F_s, direction, stem, q, z)", levels, "F_c, F_s")]
    if "motion" in effect.functions:
        moved = [f"x, v = {_call(effect, 'motion', x='x', v='v')}"]
        places += [_place(effect, "motion(x, v, F_e, stiffness, stem, q, z)", moved, "x, v")]
    if effect.memory and any(place in effect.functions for place in AT_STEM):
        started = _upkeep(effect, "start", signal="stem.x")
        carried = _upkeep(effect, "advance", before="x0", after="stem.x")
        places += [_place(effect, "start_stem(y, F_e, stem, q, z)", started, "y")]
        places += [_place(effect, "remember(x0, h, stem, q, z)", carried, "None")]
    return {each.removeprefix("def ").partition("(")[0]: each for each in places}


def _pressure_path(effect: Effect) -> list[str]:
    enters, amid = {"u": "start"}, {"middle": "stem.t + 0.5 * h"}
    leaves = {"u": "end", "t": "stem.t + h"}
    started = [*_upkeep(effect, "start", signal="u"), f"u = {_call(effect, 'pressure')}"]
    cut = [f"h = {_call(effect, 'straight')}"] if "straight" in effect.functions else []
    through = _passed(effect, "pressure", enters | amid, leaves | amid)
    ends = _passed(effect, "pressure", enters, leaves | {"middle": "stem.t + h"})
    return [
        _place(effect, "start_pressure(u, stem, q, z)", started, "u"),
        _place(effect, "straight(u, h, stem, q, z)", [*cut, f"u = {_call(effect, 'pressure', **amid)}"], "u, h"),
        _place(effect, "pressure(start, end, h, stem, q, z)", through, "shown, end"),
        _place(effect, "pressure_ends(start, end, h, stem, q, z)", ends, "shown, end"),
    ]


def _sensor(effect: Effect) -> list[str]:
    started = [*_upkeep(effect, "start", signal="y"), f"y = {_call(effect, 'sensor', y='y')}"]
    through = _passed(effect, "sensor", {"y": "start", "t": "stem.t - h"}, {"y": "end"})
    return [
        _place(effect, "start_stem(y, F_e, stem, q, z)", started, "y"),
        _place(effect, "sensor(start, end, h, stem, q, z)", through, "shown, end"),
    ]


def _passed(effect: Effect, place: str, begins: Mapping[str, str], ends: Mapping[str, str]) -> list[str]:
    return [
        f"shown = {_call(effect, place, **begins)}",
        *_upkeep(effect, "advance", before="start", after="end"),
        f"end = {_call(effect, place, **ends)}",
    ]


def _upkeep(effect: Effect, function: str, **given: str) -> list[str]:
    return [_call(effect, function, **given)] if effect.memory else []


def _call(effect: Effect, function: str, **given: str) -> str:
    parameters = ", ".join(f"q[{k}]" for k in range(len(effect.parameters)))
    q = f"{OWN.format('Parameters')}({parameters})" if parameters else "()"
    known = {**STEM, **SAME, "q": q, "z": "z", **given}
    return f"{OWN.format(function)}({', '.join(known[name] for name in effect.functions[function])})"


def _place(effect: Effect, head: str, body: Sequence[str], leaves: str) -> str:
    memory = [f"z = carray(z, {effect.memory})"] if effect.memory else []
    return "\n    ".join([f"def {head}:", *memory, *body, f"return {leaves}\n"])
