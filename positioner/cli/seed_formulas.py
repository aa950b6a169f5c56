"""The seed's formulas evaluated on a course: as printed, and corrected. The printed ones live here and nowhere else.

    (13)        a, b, c from running integrals by the trapezoidal rule, as its section 5.1 has it
    (19), (21)  velocity and acceleration by FIR filters over the last window, as its section 5.2 has it
    (22)        friction k_e from these, instant by instant
    (1)-(3), (23), (24), 4.2, 5    a number each, where the printed form and the corrected one differ

What the daemon does instead is exact between the samples (`estimation.identifier`, `estimation.derivatives`).
"""

from dataclasses import dataclass
from math import exp
from typing import TYPE_CHECKING

import numpy as np

from config.errors import InputError
from config.loading import validated
from config.valve import ValveFile, ValveParameters
from positioner.cli.seed_scenario import LITERAL, S1_FROM_S, S2_FROM_S, Course, derivative_window_s
from positioner.control.law import balance_pa
from positioner.estimation import Ratios
from positioner.estimation.derivatives import weights
from positioner.estimation.identifier import Array
from sim.valve import Valve

if TYPE_CHECKING:
    from collections.abc import Mapping

GRAPHS_FROM_S = 0.4
"""The seed's graphs begin here: before, its (13) is not solved well."""
PRINTED_STATIC_N = 284.6862
PRESSURE_UNIT_PA = 1e5
QUANTITIES = ("a", "b", "c")


@dataclass(frozen=True, slots=True)
class Identity:
    """The two coefficients in which printed and corrected forms of (8) differ: 6 in (10), 3 in (11) and (12)."""

    of_10: float = 6.0
    of_11_12: float = 3.0


CORRECTED = Identity()
PRINTED_7 = Identity(of_11_12=1.0)
PRINTED_10 = Identity(of_10=-6.0)


def truth(valve: ValveParameters) -> dict[str, float]:
    """Return the true a, b, c, k, b/c and k/c, SI units."""
    m, A = valve.mass_kg, valve.diaphragm_area_m2
    return {
        "a": -valve.viscous_ns_per_m / m,
        "b": -valve.spring_n_per_m / m,
        "c": A / m,
        "k": -valve.coulomb_n / m,
        "b_over_c": -valve.spring_n_per_m / A,
        "k_over_c": -valve.coulomb_n / A,
    }


def solved(time_s: Array, position_m: Array, pressure_pa: Array, at: Array, identity: Identity = CORRECTED) -> Array:
    """Return a, b, c (3, len(at)) by (13) at some rows of evenly sampled motion from rest; SI units.

    Args:
        time_s, position_m, pressure_pa: the motion; time zero is its first row.
        at: row numbers.
        identity: with which coefficients.
    """
    t, x, u = time_s - time_s[0], position_m, pressure_pa / PRESSURE_UNIT_PA
    h = float(t[1])

    def P(f: Array, n: int) -> Array:  # noqa: N802 - n-fold integral, the field's letter
        for _ in range(n):
            f = np.concatenate(([0.0], np.cumsum((f[1:] + f[:-1]) * (h / 2))))
        return f

    q = P(-(t**3) * x, 1) + 9 * P(t**2 * x, 2) + 18 * P(-t * x, 3) + 6 * P(x, 4)
    p_a = P(-(t**3) * x, 2) + identity.of_10 * P(t**2 * x, 3) + 6 * P(-t * x, 4)
    p_b = P(-(t**3) * x, 3) + identity.of_11_12 * P(t**2 * x, 4)
    p_c = P(-(t**3) * u, 3) + identity.of_11_12 * P(t**2 * u, 4)
    q_rows, a_rows, b_rows, c_rows = ([P(column, n)[at] for n in range(3)] for column in (q, p_a, p_b, p_c))
    matrices = np.array([a_rows, b_rows, c_rows]).transpose(2, 1, 0)
    theta = np.linalg.solve(matrices, np.array(q_rows).T[:, :, None])[:, :, 0].T
    return np.asarray(theta / [[1.0], [1.0], [PRESSURE_UNIT_PA]])


def derivatives(course: Course) -> Array:
    """Return velocity and acceleration (2, rows) at the end of the window that ends at each row; NaN before."""
    filters = weights(course.time_s[: _window(course)])[:2]
    return _filtered(course.measured_m, filters)


def printed_derivatives(course: Course) -> Array:
    """Return the same by (19) and (21) as printed, by the trapezoidal rule over the window that ends at each row."""
    n = _window(course)
    T = (n - 1) * course.period_s
    tau = np.linspace(0.0, T, n)
    k_19 = -12 / T**4 * (3 * T**2 - 16 * T * tau + 15 * tau**2)
    k_21 = 120 / T**6 * (4 * T**3 - 45 * T**2 * tau + 108 * T * tau**2 - 70 * tau**3)
    trapezoids = np.full(n, course.period_s)
    trapezoids[[0, -1]] /= 2
    return _filtered(course.measured_m, np.array([k_19, k_21]) * trapezoids)


def _window(course: Course) -> int:
    return round(derivative_window_s(course.period_s) / course.period_s) + 1


def _filtered(position_m: Array, filters: Array) -> Array:
    empty = np.full(filters.shape[1] - 1, np.nan)
    return np.array([np.concatenate((empty, np.correlate(position_m, each, "valid"))) for each in filters])


@dataclass(frozen=True, slots=True)
class Tracks:
    """What the seed's figures 3 to 6 show, row by row of `time_s`, SI units; corrected forms.

    Attributes:
        time_s: times from 0.4 to 0.8 s.
        theta: a, b, c (3, rows) by (13).
        friction_m_per_s2: k_e by (22), with a, b, c of that time.
    """

    time_s: Array
    theta: Array
    friction_m_per_s2: Array


def tracks(course: Course, every_s: float = 2.5e-4) -> Tracks:
    """Return the seed's estimates over the stretch its graphs show."""
    seen = course.identifying
    stride = max(1, round(every_s / course.period_s))
    last = seen.stop - 1
    at = np.arange(last, int(np.searchsorted(course.time_s, GRAPHS_FROM_S)), -stride)[::-1]
    theta = solved(course.time_s[seen], course.measured_m[seen], course.pressure_pa[seen], at)
    velocity, acceleration = derivatives(course)[:, at]
    a, b, c = theta
    friction = acceleration - a * velocity - b * course.measured_m[at] - c * course.pressure_pa[at]
    return Tracks(course.time_s[at], theta, friction)


@dataclass(frozen=True, slots=True)
class Erratum:
    """One quantity by the printed form and by the corrected one, against what the simulated valve does."""

    where: str
    quantity: str
    unit: str
    printed: float
    corrected: float
    true: float

    @property
    def printed_fails(self) -> bool:
        """Whether the printed form is farther off than the corrected one, and by more than 10 % of the truth."""
        off = abs(self.printed - self.true)
        return off > abs(self.corrected - self.true) and off > 0.1 * abs(self.true)


def errata(course: Course, file: ValveFile) -> list[Erratum]:
    """Return where printed and corrected forms differ; the course is one without noise."""
    valve = file.valve
    return [
        *_model(course, file),
        *_identifier(course, valve),
        *_filters(course),
        *_control(course, valve),
        Erratum("5", "F_s", "N", PRINTED_STATIC_N, valve.static_n, valve.static_n),
        _sampled_sine(course),
    ]


def _model(course: Course, file: ValveFile) -> list[Erratum]:
    """(1), (2) at rest under the first pressure of S3, (3) in the middle of the graphs."""
    valve = file.valve
    m, static_n, coulomb_n = valve.mass_kg, valve.static_n, valve.coulomb_n
    start_pa = float(course.command_pa[0])
    force_n = valve.diaphragm_area_m2 * start_pa
    row = int(np.searchsorted(course.time_s, (GRAPHS_FROM_S + S1_FROM_S) / 2))
    x, v, u = (float(each[row]) for each in (course.true_m, course.true_m_per_s, course.pressure_pa))
    acceleration = float(np.gradient(course.true_m_per_s, course.time_s)[row])
    numbers = truth(valve)
    a, b, c, k = (numbers[name] for name in ("a", "b", "c", "k"))
    stribeck = -(static_n - coulomb_n) / m * exp(-((v / valve.stribeck_velocity_m_per_s) ** 2))
    return [
        Erratum("(1)", "friction when creeping", "N", coulomb_n - (static_n - coulomb_n), static_n, static_n),
        Erratum(
            "(2)",
            "x'' at breakaway",
            "m/s^2",
            (force_n + static_n) / m,
            (force_n - static_n) / m,
            _breakaway(file, start_pa),
        ),
        Erratum(
            "(3)",
            "x'' at 0.6 s",
            "m/s^2",
            -a * v - b * x + k - stribeck + c * u,
            a * v + b * x + k + stribeck + c * u,
            acceleration,
        ),
    ]


def _breakaway(file: ValveFile, pressure_pa: float, over_s: float = 1e-7) -> float:
    """Return the simulated acceleration over the first instant, in which the stem stays within Karnopp's band."""
    valve = Valve.from_file(file, step_s=over_s)
    valve.advance(pressure_pa, over_s)
    return valve.velocity_m_per_s / over_s


def _identifier(course: Course, valve: ValveParameters) -> list[Erratum]:
    """(7) and (10) by a, b, c at 0.8 s."""
    seen = course.identifying
    at = np.array([seen.stop - 1])
    rows = course.time_s[seen], course.measured_m[seen], course.pressure_pa[seen], at
    units = {"a": "1/s", "b": "1/s^2", "c": "m/(s^2 Pa)"}
    corrected, true = solved(*rows)[:, 0], truth(valve)
    return [
        Erratum(where, name, units[name], float(solved(*rows, identity)[i, 0]), float(corrected[i]), true[name])
        for where, identity in (("(7)", PRINTED_7), ("(10)", PRINTED_10))
        for i, name in enumerate(QUANTITIES)
    ]


def _filters(course: Course) -> list[Erratum]:
    """(19) and (21) by their delay: the one with which they fit the true motion of the first jerk best."""
    printed, corrected = printed_derivatives(course), derivatives(course)
    true = course.true_m_per_s, np.gradient(course.true_m_per_s, course.time_s)
    return [
        Erratum(
            where,
            f"delay of {name}",
            "ms",
            *(1e3 * _delay_s(course, each[i], true[i]) for each in (printed, corrected)),
            0.0,
        )
        for i, (where, name) in enumerate((("(19)", "x'"), ("(21)", "x''")))
    ]


def _delay_s(course: Course, estimate: Array, true: Array) -> float:
    n = _window(course)
    rows = slice(3 * n, 20 * n)
    lags = np.arange(2 * n)
    misfits = [float(np.mean((estimate[rows] - true[rows.start - lag : rows.stop - lag]) ** 2)) for lag in lags]
    return float(lags[int(np.argmin(misfits))]) * course.period_s


def _control(course: Course, valve: ValveParameters) -> list[Erratum]:
    """(22) at 0.8 s, (23), (24) and the coordinate of 4.2 at the ends of S1 and S2."""
    last = course.identifying.stop - 1
    numbers = truth(valve)
    a, b, c, k = (numbers[name] for name in ("a", "b", "c", "k"))
    velocity, acceleration = derivatives(course)[:, last].tolist()
    x, u = float(course.measured_m[last]), float(course.pressure_pa[last])
    up, down = (int(np.searchsorted(course.time_s, time_s - course.period_s / 2)) - 1 for time_s in (S2_FROM_S, 1e9))
    r_up, r_down = float(course.reference_m[up]), float(course.reference_m[down])
    ratios = Ratios(numbers["b_over_c"], numbers["k_over_c"])
    spring, area, coulomb = valve.spring_n_per_m, valve.diaphragm_area_m2, valve.coulomb_n
    return [
        Erratum(
            "(22)",
            "k_e at 0.8 s",
            "m/s^2",
            acceleration + a * velocity + b * x - c * u,
            acceleration - a * velocity - b * x - c * u,
            k,
        ),
        Erratum(
            "(23)", "u in S1", "Pa", (r_up - b * k) / c, balance_pa(r_up, 1, ratios), (spring * r_up + coulomb) / area
        ),
        Erratum(
            "(24)",
            "u in S2",
            "Pa",
            (r_down + b * k) / c,
            balance_pa(r_down, -1, ratios),
            (spring * r_down - coulomb) / area,
        ),
        Erratum("4.2", "y when x = r", "m", float(course.true_m[up]) + r_up, float(course.true_m[up]) - r_up, 0.0),
    ]


def _sampled_sine(course: Course) -> Erratum:
    """Return the largest sample of the literal sine: corrected is what sin(2 pi n) is, true its amplitude on paper."""
    raise NotImplementedError
