"""The curve of a form whose shape does not suffice: the same place and variable, smooth through knots.

    g(s) = g_i + u (m_i + u (3 d_i - 2 m_i - m_i+1 + u (m_i + m_i+1 - 2 d_i)))     u = (s - s_i) / (s_i+1 - s_i),
                                                                               d_i = g_i+1 - g_i
    m_i = (g_i+1 - g_i-1) (s_i+1 - s_i) / (s_i+1 - s_i-1)                      Catmull and Rom's slopes, over the piece

between the first knot and the last; level beyond.

A form that was found by its shape is near the truth and may still miss it: a spot with other flanks, a step that is no
hyperbolic tangent. Its curve begins where the form ended, c g at every knot, and has the heights free. Knots are dense
where the shape changes, its place and width in the unit of the variable, else spread evenly over what the recordings
show.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from workbench.discover.grammar import Form, Quantity, Shape

CURVED = frozenset({"position", "position_and_pressure", "pressure", "speed"})
"""Variables over which a curve may go."""
LOCAL = frozenset({"bump", "step"})
"""Shapes that change at one place only."""
KNOT_WIDTHS = (-2.5, -1.9, -1.55, -1.3, -1.05, -0.8, -0.45, 0.0, 0.45, 0.8, 1.05, 1.3, 1.55, 1.9, 2.5)
"""Knots about such a place, in widths."""
EVENLY = 9  # knots over the span
NEARER = 0.02
"""Of the span: knots nearer to each other are one."""
HEIGHT = "height_"
HIGHEST = 20.0
FLAT = 0.01
"""A height below is written as none: the scale of its coordinate is that of its start."""


def has_curve(form: Form) -> bool:
    """Whether the form goes over a variable that a curve may go over, and is not a curve or many waves already."""
    return form.variable.name in CURVED and form.shape.name not in {"curve", "wave"}


def curve_of(form: Form, values: Mapping[str, float], span: tuple[float, float]) -> tuple[Form, tuple[float, ...]]:
    """Return the curve of a form, and its heights where the form ended.

    Args:
        form: the form, which `has_curve`.
        values: its parameters by their keys.
        span: from where to where the recordings go in the variable.
    """
    knots = _knots(form, values, span)
    q = SimpleNamespace(**values)
    functions = {name: getattr(math, name) for name in form.shape.imports} | {"min": min, "max": max, "abs": abs}
    g = [float(eval(form.shape.expression.format("s"), functions, {"s": s, "q": q})) for s in knots]
    unit = max(map(abs, g), default=1.0) or 1.0
    strength = form.place.strength
    scale = replace(
        strength, text=f"{strength.text}, of height 1", starts=(values[strength.key] * unit,), scale="", off=None,
        given=True,
    )  # fmt: skip
    least = 0.0 if "copysign" in form.place.imports else -HIGHEST
    heights = tuple(
        Quantity(
            f"{HEIGHT}{i}", f"g_{i}", f"height at {s:.4g}", least, HIGHEST, (-0.1, 0.1) if least else (0.1,), off=0.0
        )
        for i, s in enumerate(knots)
    )
    curve = Shape(
        "curve", "follows a curve over", f"g smooth through g_i at {{0}} = {_list(knots)}", "curve({0}, q)", heights,
        functions=_function(knots),
    )  # fmt: skip
    place = replace(form.place, strength=scale)
    return replace(form, place=place, shape=curve), tuple(each / unit for each in g)


def _knots(form: Form, values: Mapping[str, float], span: tuple[float, float]) -> list[float]:
    low, high = span
    evenly = np.linspace(low, high, EVENLY).tolist()
    if form.shape.name in LOCAL:
        about = [values["place"] + values["width"] * each for each in KNOT_WIDTHS]
        knots = [low, *(each for each in about if low < each < high), high]
    else:
        knots = sorted([*evenly, *([values["place"]] if low < values.get("place", low) < high else [])])
    apart = min(NEARER * (high - low), 0.2 * values.get("width", high - low))
    kept = knots[:1]
    for each in knots[1:]:
        if each - kept[-1] >= apart:
            kept.append(each)
    return [float(f"{each:.5g}") for each in kept]


def _list(knots: list[float]) -> str:
    return ", ".join(f"{each:.4g}" for each in knots)


def _function(knots: list[float]) -> str:
    last = len(knots) - 1
    lines = [
        "def piece(u: float, before: float, begin: float, end: float, after: float, m: float, n: float) -> float:",
        '    """Return the height u into a piece; m, n are its length over that of two pieces, before and after."""',
        "    rise, m, n = end - begin, m * (end - before), n * (after - begin)",
        "    return begin + u * (m + u * (3.0 * rise - 2.0 * m - n + u * (m + n - 2.0 * rise)))",
        "",
        "",
        "def curve(s: float, q: Parameters) -> float:",
        '    """Return the height, smooth through the knots."""',
        f"    if s < {knots[0]!r}:",
        "        return q.height_0",
    ]
    for i, (begin, end) in enumerate(pairwise(knots)):
        earlier, later = knots[max(i - 1, 0)], knots[min(i + 2, last)]
        heights = ", ".join(f"q.height_{k}" for k in (max(i - 1, 0), i, i + 1, min(i + 2, last)))
        about = f"{(end - begin) / (end - earlier):.6g}, {(end - begin) / (later - begin):.6g}"
        lines += [
            f"    if s < {end!r}:",
            f"        return piece((s - {begin!r}) / {end - begin:.6g}, {heights}, {about})",
        ]
    return "\n".join([*lines, f"    return q.height_{last}", ""])
