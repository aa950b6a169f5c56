"""The algebraic identifier: a, b, c of the moving stem from running integrals, (8)-(16), (29)-(33) of the seed.

    x'' = a x' + b x + c u + k        while the stem moves one way; k carries the sign of the motion

Multiplied by s and differentiated three times with respect to s, this loses k and the initial conditions; divided
by s^4 it loses the derivatives. With P(f, n) the n-fold integral of f from 0 to t, and T = t at read-out:

    q_1  = P(-t^3 x, 1) + 9 P(t^2 x, 2) + 18 P(-t x, 3) + 6 P(x, 4)               (9)
    p_11 = P(-t^3 x, 2) + 6 P(t^2 x, 3) + 6 P(-t x, 4)                            (10), its sign corrected
    p_12 = P(-t^3 x, 3) + 3 P(t^2 x, 4)                                           (11)
    p_13 = P(-t^3 u, 3) + 3 P(t^2 u, 4)                                           (12)
    q_i  = a p_i1 + b p_i2 + c p_i3,   row i + 1 the integral of row i            (8), (13)-(16)

Each of the four columns is a chain of six integrators, (29)-(33), fed at level l with g_l t^(e_l) times its signal:

    π_1' = g_1 t^(e_1) x,    π_n' = g_n t^(e_n) x + π_(n-1),    rows 1, 2, 3 = π_4, π_5, π_6

A step of the chain is exact for x linear between the samples, and for u held or linear (see `Identifier`). In units
of the step itself it is the same matrix for every step; π_n carries the weight h^(n + e_1).

The columns are kept whenever the time since zero has doubled, from a 32nd of the window on. The windows that end
there, and the one that ends now, are solved together, by the weight that noise leaves each: see `solution`.

Inside, time counts in windows, x in strokes, u in units of a pressure; time zero is the restart.
"""

from dataclasses import replace
from math import comb, factorial

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.weighted_least_squares import CHAINS, LEVELS, ROWS, Solution, Window, solve

STATES = LEVELS * len(CHAINS)
FEEDS = 8
"""Numbers by which a signal enters a step: its value and its increment, times the powers 0 to 3 of time."""


def _monomial(i: int, m: int) -> float:
    """∫_0^1 s^i (1 - s)^m / m! ds."""
    return factorial(i) / factorial(m + i + 1)


def _step_matrix() -> Array:
    """Return the exact step of all chains in units of the step: (states, x feeds, u feeds) -> states."""
    step = np.zeros((STATES, STATES + 2 * FEEDS))
    for chain, feeds in enumerate(CHAINS):
        signal = STATES + FEEDS * (chain == len(CHAINS) - 1)
        for n in range(1, LEVELS + 1):
            row = step[LEVELS * chain + n - 1]
            for m in range(n):
                row[LEVELS * chain + n - 1 - m] = 1 / factorial(m)
            for level, (gain, power) in enumerate(feeds[:n], start=1):
                for p in range(power + 1):
                    weight = gain * comb(power, p)
                    row[signal + p] += weight * _monomial(power - p, n - level)
                    row[signal + FEEDS // 2 + p] += weight * _monomial(power - p + 1, n - level)
    return step


_STEP = _step_matrix()
_WEIGHTS = np.array([n + feeds[0][1] for feeds in CHAINS for n in range(1, LEVELS + 1)], dtype=float)
_READ = np.array([[LEVELS * chain + n - 1 for n in ROWS] for chain in range(len(CHAINS))])

GAP_MEAN_STEPS = 4.0
"""A step longer than this many mean steps has missed commands."""
FIRST, AGAIN = 1 / 32, 2.0
"""The columns are kept at this share of the window, and whenever time has grown by this factor since."""
FEWEST_SAMPLES = 6
"""Samples before which no columns are kept."""


class Identifier:
    """Running realisation of the identifier: O(1) per sample, restartable at any instant.

    Args:
        window_s: unit of time, the length of window it is meant for.
        stroke_m: unit of position.
        pressure_pa: unit of pressure.
        pressure_held: True when the pressure of a sample has held since the one before (command held over the
            period, no I/P lag); False when it is continuous, and taken as linear between the samples.
    """

    def __init__(self, window_s: float, stroke_m: float, pressure_pa: float, *, pressure_held: bool = True) -> None:
        self._window_s, self._stroke_m, self._pressure_pa = window_s, stroke_m, pressure_pa
        self._pressure_held = pressure_held
        self._unit = np.array([1 / window_s, 1 / window_s**2, stroke_m / (pressure_pa * window_s**2)])
        self._z = np.zeros(STATES + 2 * FEEDS)
        self.restart()

    def restart(self) -> None:
        """Forget everything; the next sample is time zero."""
        self._z[:] = 0
        self._started = False
        self._t = self._h = self._squared_steps = self._bends = 0.0
        self._slope: float | None = None
        self._h_before = 0.0
        self._gaps = self._count = 0
        self._kept: list[Window] = []
        self._theta: Array | None = None

    @property
    def elapsed_s(self) -> float:
        """Time from the first to the last sample."""
        return self._t * self._window_s

    def update(self, time_s: float, position_m: float, pressure_pa: float) -> None:
        """Take a sample.

        Raises:
            ValueError: the time stamp is not after the last one.
        """
        x, u = position_m / self._stroke_m, pressure_pa / self._pressure_pa
        if not self._started:
            self._zero_s, self._x, self._u, self._started = time_s, x, u, True
            return
        t = (time_s - self._zero_s) / self._window_s
        h = t - self._t
        if h <= 0:
            raise ValueError(f"time_s: {time_s!r} is not after the last sample")
        z = self._z
        if h != self._h:
            if self._h:
                z[:STATES] *= (self._h / h) ** _WEIGHTS
            self._h = h
        k = self._t / h
        k2, k3 = k * k, k * k * k
        x0, dx = self._x, x - self._x
        # Over a gap the commands in between are not known: a line through them is nearer than the last of them.
        gap = h * self._t > GAP_MEAN_STEPS * self._squared_steps > 0
        self._gaps += gap
        u0, du = (u, 0.0) if self._pressure_held and not gap else (self._u, u - self._u)
        z[STATES:] = (
            x0, k * x0, k2 * x0, k3 * x0, dx, k * dx, k2 * dx, k3 * dx,
            u0, k * u0, k2 * u0, k3 * u0, du, k * du, k2 * du, k3 * du,
        )  # fmt: skip
        z[:STATES] = _STEP.dot(z)
        self._bend(dx / h, h)
        self._t, self._x, self._u = t, x, u
        self._squared_steps += h * h
        self._count += 1
        if self._count >= FEWEST_SAMPLES and t >= (AGAIN * self._kept[-1].end if self._kept else FIRST):
            self._kept.append(self._window())

    def _bend(self, slope: float, h: float) -> None:
        """Count what a straight line leaves out over this step; over the first it is as over the second."""
        if self._slope is not None:
            before = self._h_before
            # A short step before gives noise, not slope: what follows it counts for less.
            left_out = h * h * min(h, before) / 6 * (slope - self._slope) / (h + before)
            self._bends += left_out * left_out * (2 if self._count == 1 else 1)
        self._slope, self._h_before = slope, h

    def windows(self) -> list[Window]:
        """Return the windows that are solved together, the longest last; in windows, strokes and units of pressure."""
        return [each for each in self._kept if AGAIN**0.5 * each.end <= self._t] + [self._window()]

    def _window(self) -> Window:
        columns = (self._z[:STATES] * self._h**_WEIGHTS)[_READ]
        return Window(self._t, columns, self._squared_steps, self._bends)

    def solve(self, position_noise_m: float, pressure_noise_pa: float = 0.0) -> Solution | None:
        """Solve (13) for a, b, c.

        Args:
            position_noise_m: standard deviation of the white noise of the position.
            pressure_noise_pa: the same of the pressure.

        Returns:
            The solution; None when (13) is singular, as under a constant pressure.
        """
        noise = position_noise_m / self._stroke_m, pressure_noise_pa / self._pressure_pa
        found = solve(self.windows(), *noise, guess=self._theta, gaps=self._gaps)
        if found is None:
            return None
        self._theta = found.theta
        unit = self._unit
        return replace(
            found,
            theta=found.theta * unit,
            covariance=found.covariance * np.outer(unit, unit),
            bias=found.bias * unit,
        )
