"""The terms of the integral identity (8)-(12), in symbols."""

from functools import cache

import sympy as sp

t, a, b, c, k = sp.symbols("t a b c k")
COEFFICIENTS = sp.symbols("x0:6")
x = sum(coefficient * t**i for i, coefficient in enumerate(COEFFICIENTS))
u = sp.expand((sp.diff(x, t, 2) - a * sp.diff(x, t) - b * x - k) / c)


def P(f: sp.Expr, n: int) -> sp.Expr:  # noqa: N802 - the paper's name
    for _ in range(n):
        f = sp.integrate(sp.expand(f), (t, 0, t))
    return f


@cache
def terms() -> tuple[sp.Expr, sp.Expr, sp.Expr, sp.Expr]:
    """Q1, P11, P12, P13."""
    return (
        P(-(t**3) * x, 1) + 9 * P(t**2 * x, 2) + 18 * P(-t * x, 3) + 6 * P(x, 4),
        P(-(t**3) * x, 2) + 6 * P(t**2 * x, 3) + 6 * P(-t * x, 4),
        P(-(t**3) * x, 3) + 3 * P(t**2 * x, 4),
        P(-(t**3) * u, 3) + 3 * P(t**2 * u, 4),
    )
