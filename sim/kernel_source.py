"""Writes the functions that fill the empty places of `karnopp.py` with the effects of a valve file.

A place that none of them fills is not written: it stays as it stands there.
Effect i's functions stand in the kernel as `force_i`, `advance_i`, ...; q[i] is its parameters, z[i] its memory.
A signal that passes through an element is known at the start and at the end of a step: the element shows its output
for the old memory, carries its memory over the step, and shows its output for the new one.
"""

from collections.abc import Sequence
from itertools import accumulate

from sim import first_order_lag
from sim.effect import PLACES, Effect
from sim.karnopp import BASE_PARAMETERS, MEMORY

SHARED = (first_order_lag,)
"""Elements that effects may import; compiled with them."""
STEM = {name: f"stem.{name}" for name in ("t", "x", "v", "p")} | {"middle": "stem.t"}
LEVELS = {name: name for name in ("F_c", "F_s", "direction")}
MOVED = {name: name for name in ("F_e", "stiffness", "x", "v")}


def kernel_source(effects: Sequence[Effect]) -> str:
    """Return the text of the places that these effects fill, and of what reads their parameters and memories."""
    at = {place: [i for i, each in enumerate(effects) if place in each.functions] for place in PLACES}
    remembering = {i for i, each in enumerate(effects) if each.memory}
    at_stem = sorted({*at["force"], *at["friction"], *at["motion"]} & remembering)

    def call(function: str, i: int, **given: str) -> str:
        known = {**STEM, "q": f"q[{i}]", "z": f"z[{i}]", **given}
        return f"{function}_{i}({', '.join(known[name] for name in effects[i].functions[function])})"

    def started(place: str, signal: str) -> list[str]:
        lines = []
        for i in at[place]:
            lines += [call("start", i, signal=signal)] if i in remembering else []
            lines += [f"{signal} = {call(place, i, **{signal: signal})}"]
        return lines

    def until_bent() -> list[str]:
        cutting = [i for i in at["pressure"] if "straight" in effects[i].functions]
        lines = []
        for i in at["pressure"] if cutting else []:
            lines += [f"h = {call('straight', i, u='start', h='h')}"] if i in cutting else []
            lines += [f"start = {call('pressure', i, u='start', middle='stem.t + 0.5 * h')}"]
        return lines

    def passed(place: str, signal: str, begins: str, middle: str | None, ends: str) -> list[str]:
        lines = []
        for i in at[place]:
            lines += [f"shown = {call(place, i, **{signal: 'start', 't': begins, 'middle': middle or begins})}"]
            lines += [call("advance", i, before="start", after="end", h="h")] if i in remembering else []
            lines += [f"end = {call(place, i, **{signal: 'end', 't': ends, 'middle': middle or ends})}"]
            lines += ["start = shown"]
        return lines

    at_rest = [call("start", i, signal="y", F_e="F_e") for i in at_stem] + started("sensor", "y")
    through_pressure = passed("pressure", "u", "stem.t", "stem.t + 0.5 * h", "stem.t + h")
    ends_of_pressure = passed("pressure", "u", "stem.t", None, "stem.t + h")
    through_sensor = passed("sensor", "y", "stem.t - h", "stem.t - 0.5 * h", "stem.t")
    forces = [f"F += {call('force', i)}" for i in at["force"]]
    levels = [f"F_c, F_s = {call('friction', i, **LEVELS)}" for i in at["friction"]]
    motions = [f"x, v = {call('motion', i, **MOVED)}" for i in at["motion"]]
    carried = [call("advance", i, before="x0", after="stem.x", h="h") for i in at_stem]

    return "\n".join(
        [
            _function("parameters(theta)", [], f"({_parameters(effects)})"),
            _function("memories(state)", [], f"({_memories(effects)})"),
            _place("start_pressure(u, stem, q, z)", [], started("pressure", "u"), "u"),
            _place("start_stem(F_e, stem, q, z)", ["y = stem.x"], at_rest, "y"),
            _place("straight(u, h, stem, q, z)", ["start = u"], until_bent(), "h"),
            _place("pressure(u, h, stem, q, z)", ["start, end = u, u"], through_pressure, "start, end"),
            _place("pressure_ends(u, h, stem, q, z)", ["start, end = u, u"], ends_of_pressure, "start, end"),
            _place("force(stem, q, z)", ["F = 0.0"], forces, "F"),
            _place("friction(F_c, F_s, direction, stem, q, z)", [], levels, "F_c, F_s"),
            _place("motion(F_e, stiffness, stem, q, z)", ["x, v = stem.x, stem.v"], motions, "x, v"),
            _place("remember(x0, h, stem, q, z)", [], carried, "None"),
            _place("sensor(x0, h, stem, q, z)", ["start, end = x0, stem.x"], through_sensor, "end"),
        ]
    )


def _place(head: str, enters: Sequence[str], body: Sequence[str], leaves: str) -> str:
    return _function(head, [*enters, *body], leaves) if body else ""


def _function(head: str, body: Sequence[str], result: str) -> str:
    return "\n    ".join([f"\ndef {head}:", *body, f"return {result}"])


def _parameters(effects: Sequence[Effect]) -> str:
    """Return a tuple of each effect's parameters, read from the vector in turn."""
    ends = accumulate((len(each.parameters) for each in effects), initial=BASE_PARAMETERS)
    tuples = [
        f"Parameters_{i}({', '.join(f'theta[{k}]' for k in range(first, first + len(each.parameters)))})"
        if each.parameters
        else "()"
        for i, (each, first) in enumerate(zip(effects, ends, strict=False))
    ]
    return "".join(f"{each}, " for each in tuples)


def _memories(effects: Sequence[Effect]) -> str:
    """Return a tuple of each effect's memory, a view into the state vector."""
    ends = accumulate((each.memory for each in effects), initial=MEMORY)
    return "".join(f"state[{first}:{first + each.memory}], " for each, first in zip(effects, ends, strict=False))
