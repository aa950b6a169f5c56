"""What no record of pressure and position tells apart: classes that follow from the equations, never ranked inside.

    A p = k_s x + F_0 + ...,  y = x + b         F_0 = -k_s b: preload and sensor offset are one
    A p = k_s x + ...,        y = g x           k_s / g, F_v / g, m / g: a gain of the sensor is another spring
    y within b of x                             between reversals b is F_c + k_s b / 2, F_s - k_s b / 2

The first two stand in the effects' files, as a confounding with an empty text. The third holds only where each motion
ends in a reversal and jumps exceed b: there the refitted bare valve reaches the same error, so nothing is accepted.
"""

from collections.abc import Iterable, Mapping

from sim.composition import BASE
from sim.effect import Effect


def algebraic_class(name: str, library: Mapping[str, Effect]) -> frozenset[str]:
    """Return the effects and parameters of the bare valve that a record cannot tell from an effect; itself included."""
    members, grown = frozenset[str](), frozenset({name})
    while grown != members:
        members = grown
        grown = members.union(*(_same(each, library) for each in members))
    return members


def bare_parameter(name: str, library: Mapping[str, Effect]) -> str | None:
    """Return the parameter of the bare valve that already does what an effect does, None if there is none."""
    return next((each for each in sorted(algebraic_class(name, library)) if each in BASE), None)


def classes(names: Iterable[str], library: Mapping[str, Effect]) -> list[frozenset[str]]:
    """Return the names gathered into their algebraic classes, in the order of first mention."""
    names = list(names)
    gathered: list[frozenset[str]] = []
    for name in names:
        if not any(name in each for each in gathered):
            gathered.append(algebraic_class(name, library) & frozenset(names))
    return gathered


def told_apart(name: str, other: str, library: Mapping[str, Effect]) -> str:
    """Return what record tells two effects apart, as their files say it; empty if they do not."""
    return library[name].confounded.get(other, "") or library[other].confounded.get(name, "")


def _same(name: str, library: Mapping[str, Effect]) -> frozenset[str]:
    if name not in library:
        return frozenset(each for each, effect in library.items() if effect.confounded.get(name) == "")
    return frozenset(other for other, text in library[name].confounded.items() if not text) | frozenset(
        each for each, effect in library.items() if effect.confounded.get(name) == ""
    )
