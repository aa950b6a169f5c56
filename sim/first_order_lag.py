"""A first-order lag, exactly, over a step in which what enters goes straight from one value to another.

    T y' = u - y,    u from u_0 to u_1 over h, r = (u_1 - u_0) / h
    y_1 = u_1 - r T + (y_0 - u_0 + r T) exp(-h / T),    at T = 0: y_1 = u_1

T time constant, s; h step, s; u what enters, y what leaves, of one unit. Effects import `lagged`: the kernel
compiles it with them, and its digest holds this text.
"""

from math import exp


def lagged(y: float, before: float, after: float, h: float, T: float) -> float:
    """Return y_1 of y_0, u_0, u_1, h and T; T may be 0."""
    if T > 0.0:
        ramp = (after - before) / h * T
        return after - ramp + (y - before + ramp) * exp(-h / T)
    return after
