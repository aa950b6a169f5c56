"""The seed's formulas evaluated on a run of its scenario: as printed (here and nowhere else), and corrected.

    (13)        a, b, c from running integrals by the trapezoidal rule, as its section 5.1 has it
    (19), (21)  velocity and acceleration by FIR filters over the last window, as its section 5.2 has it
    (22)        friction k_e from these, instant by instant
    (1)-(3), (23), (24), 4.2, 5    a number each, where the printed form and the corrected one differ

What the daemon does instead is exact on the samples (`estimation.algebraic`, `estimation.derivatives`).
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from benchmarks.paper.scenario import (
    AMPLITUDE_PU,
    HONEST_SINE,
    LITERAL,
    S1_FROM_S,
    S2_FROM_S,
    UNTIL_S,
    Noise,
    ScenarioRun,
    derivative_window_s,
)
from config.errors import InputError
from config.loading import validate
from config.valve_file import ValveFile, ValveParameters
from positioner.estimation import Ratios
from positioner.estimation.array import Array
from positioner.estimation.derivatives import weights
from positioner.virtual.true_parameters import truth
from sim.valve import Valve

GRAPHS_FROM_S = 0.4
"""The seed's graphs begin here: before, its (13) is not solved well."""
PRINTED_STATIC_N = 284.6862
PRESSURE_UNIT_PA = 1e5
QUANTITIES = ("a", "b", "c")


@dataclass(frozen=True, slots=True)
class AlgebraicIdentity:
    """The two coefficients in which printed and corrected forms of (8) differ: 6 in (10), 3 in (11) and (12)."""

    of_10: float = 6.0
    of_11_12: float = 3.0


CORRECTED = AlgebraicIdentity()
PRINTED_7 = AlgebraicIdentity(of_11_12=1.0)
PRINTED_10 = AlgebraicIdentity(of_10=-6.0)


def solved(
    time_s: Array, position_m: Array, pressure_pa: Array, at: Array, identity: AlgebraicIdentity = CORRECTED
) -> Array:
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
            steps = (f[1:] + f[:-1]) * (h / 2)
            f = np.append(0.0, np.cumsum(steps))
        return f

    q = P(-(t**3) * x, 1) + 9 * P(t**2 * x, 2) + 18 * P(-t * x, 3) + 6 * P(x, 4)
    p_a = P(-(t**3) * x, 2) + identity.of_10 * P(t**2 * x, 3) + 6 * P(-t * x, 4)
    p_b = P(-(t**3) * x, 3) + identity.of_11_12 * P(t**2 * x, 4)
    p_c = P(-(t**3) * u, 3) + identity.of_11_12 * P(t**2 * u, 4)
    q_rows, a_rows, b_rows, c_rows = ([P(column, n)[at] for n in range(3)] for column in (q, p_a, p_b, p_c))
    matrices = np.array([a_rows, b_rows, c_rows]).transpose(2, 1, 0)
    theta = np.linalg.solve(matrices, np.array(q_rows).T[:, :, None])[:, :, 0].T
    return np.asarray(theta / [[1.0], [1.0], [PRESSURE_UNIT_PA]])


def printed_filters(samples: int, period_s: float) -> Array:
    """Return (19) and (21) as printed, by the trapezoidal rule: weights (2, samples), oldest first."""
    T = (samples - 1) * period_s
    tau = np.linspace(0.0, T, samples)
    k_19 = -12 / T**4 * (3 * T**2 - 16 * T * tau + 15 * tau**2)
    k_21 = 120 / T**6 * (4 * T**3 - 45 * T**2 * tau + 108 * T * tau**2 - 70 * tau**3)
    trapezoids = np.full(samples, period_s)
    trapezoids[[0, -1]] /= 2
    return np.array([k_19 * trapezoids, k_21 * trapezoids])


def corrected_filters(samples: int, period_s: float) -> Array:
    """Return (19) and (21) on the window reversed in time, (2, samples): the odd derivative changes its sign."""
    k_19, k_21 = printed_filters(samples, period_s)[:, ::-1]
    return np.array([-k_19, k_21])


def exact_filters(samples: int, period_s: float) -> Array:
    """Return the daemon's, (2, samples): exact for polynomials on the samples, where the trapezoidal rule is not."""
    return weights(period_s * np.arange(samples, dtype=np.float64))[:2]


def derivatives(run: ScenarioRun, filters: Array) -> Array:
    """Return velocity and acceleration (2, rows) from the window that ends at each row; NaN before the first."""
    empty = np.full(filters.shape[1] - 1, np.nan)
    return np.array([np.concatenate((empty, np.correlate(run.measured_m, each, "valid"))) for each in filters])


def fir_length(run: ScenarioRun) -> int:
    """Return the number of samples in the derivative filters, the seed's 500 at its period."""
    return round(derivative_window_s(run.period_s) / run.period_s)


@dataclass(frozen=True, slots=True)
class ParameterTracks:
    """What the seed's figures 3 to 5 show, sample by sample from 0.4 to 0.8 s: a, b, c by (13), SI units.

    Attributes:
        rows: of the run.
        theta: a, b, c (3, samples).
    """

    rows: Array
    theta: Array


def tracks(run: ScenarioRun) -> ParameterTracks:
    """Return the seed's a, b, c over the span its graphs show."""
    excited = run.identifying
    rows = np.arange(run.row_at(GRAPHS_FROM_S), excited.stop)
    theta = solved(run.time_s[excited], run.measured_m[excited], run.pressure_pa[excited], rows)
    return ParameterTracks(rows, theta)


def friction(run: ScenarioRun, seed_tracks: ParameterTracks, filters: Array, position_m: Array) -> Array:
    """Return k_e, (samples,), m/s^2, by (22), corrected, over that span, with a, b, c of the same time; figure 6.

    Args:
        run: of the scenario.
        seed_tracks: its a, b, c.
        filters: of the derivatives.
        position_m: taken for x_e, for which the seed gives no estimator; a row per sample of the run.
    """
    a, b, c = seed_tracks.theta
    velocity, acceleration = derivatives(run, filters)[:, seed_tracks.rows]
    return np.asarray(
        acceleration - a * velocity - b * position_m[seed_tracks.rows] - c * run.pressure_pa[seed_tracks.rows],
        dtype=np.float64,
    )


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


def errata(run: ScenarioRun, file: ValveFile) -> list[Erratum]:
    """Return where printed and corrected forms differ; the run is one without noise."""
    valve = file.valve
    breakaway_n = _breakaway_force_n(file)
    return [
        *_model(run, file, breakaway_n),
        *_identifier(run, valve),
        *_filters(run),
        *_control(run, valve),
        Erratum("5", "F_s", "N", PRINTED_STATIC_N, valve.static_n, breakaway_n),
        _sampled_sine(run),
    ]


def _model(run: ScenarioRun, file: ValveFile, breakaway_n: float) -> list[Erratum]:
    """(1), (2) at rest under the first pressure of S3, (3) in the middle of the graphs."""
    valve = file.valve
    m, static_n, coulomb_n = valve.mass_kg, valve.static_n, valve.coulomb_n
    start_pa = float(run.command_pa[0])
    force_n = valve.diaphragm_area_m2 * start_pa
    row = run.row_at((GRAPHS_FROM_S + S1_FROM_S) / 2)
    x, v, u = (float(each[row]) for each in (run.true_m, run.true_m_per_s, run.pressure_pa))
    acceleration = float(np.gradient(run.true_m_per_s, run.time_s)[row])
    numbers = truth(valve)
    a, b, c, k = (numbers[name] for name in ("a", "b", "c", "k"))
    stribeck = -(static_n - coulomb_n) / m * exp(-((v / valve.stribeck_velocity_m_per_s) ** 2))
    return [
        Erratum("(1)", "friction as v -> 0", "N", coulomb_n - (static_n - coulomb_n), static_n, breakaway_n),
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


def _breakaway_force_n(file: ValveFile) -> float:
    """Return the force at which the simulated stem moves when the pressure rises slowly, 1 Pa each 10 us."""
    valve = Valve.from_file(file)
    ramp = valve.run(np.arange(0.0, 2 * file.valve.static_n / file.valve.diaphragm_area_m2), 1e-5)
    moved = int(np.flatnonzero(ramp.velocity_m_per_s)[0])
    return file.valve.diaphragm_area_m2 * float(ramp.pressure_pa[moved])


def _identifier(run: ScenarioRun, valve: ValveParameters) -> list[Erratum]:
    """(7) and (10) by a, b, c at 0.8 s."""
    excited = run.identifying
    at = np.array([excited.stop - 1])
    rows = run.time_s[excited], run.measured_m[excited], run.pressure_pa[excited], at
    units = {"a": "1/s", "b": "1/s^2", "c": "m/(s^2 Pa)"}
    corrected, true = solved(*rows)[:, 0], truth(valve)
    return [
        Erratum(where, name, units[name], float(solved(*rows, identity)[i, 0]), float(corrected[i]), true[name])
        for where, identity in (("(7)", PRINTED_7), ("(10)", PRINTED_10))
        for i, name in enumerate(QUANTITIES)
    ]


def _filters(run: ScenarioRun) -> list[Erratum]:
    """(19) and (21) by their delay: the one with which they fit the true motion of the first jerk best."""
    n, h = fir_length(run), run.period_s
    printed, corrected = (derivatives(run, filters(n, h)) for filters in (printed_filters, corrected_filters))
    true = run.true_m_per_s, np.gradient(run.true_m_per_s, run.time_s)
    return [
        Erratum(
            where,
            f"delay of {name}",
            "ms",
            1e3 * _delay_s(run, printed[i], true[i]),
            1e3 * _delay_s(run, corrected[i], true[i]),
            0.0,
        )
        for i, (where, name) in enumerate((("(19)", "x'"), ("(21)", "x''")))
    ]


def _delay_s(run: ScenarioRun, estimate: Array, true: Array) -> float:
    n = fir_length(run)
    rows = slice(3 * n, 20 * n)
    lags = np.arange(2 * n)
    misfits = [float(np.mean((estimate[rows] - true[rows.start - lag : rows.stop - lag]) ** 2)) for lag in lags]
    return float(lags[int(np.argmin(misfits))]) * run.period_s


def _control(run: ScenarioRun, valve: ValveParameters) -> list[Erratum]:
    """(22) at 0.8 s; (23), (24) and the coordinate of 4.2 at the ends of S1 and S2, where the stem stands at r."""
    last = run.identifying.stop - 1
    numbers = truth(valve)
    a, b, c, k = (numbers[name] for name in ("a", "b", "c", "k"))
    filters = corrected_filters(fir_length(run), run.period_s)
    velocity, acceleration = derivatives(run, filters)[:, last].tolist()
    x, u = float(run.measured_m[last]), float(run.pressure_pa[last])
    up, down = run.row_at(S2_FROM_S), run.row_at(UNTIL_S)
    r_up, r_down = float(run.reference_m[up]), float(run.reference_m[down])
    ratios = Ratios(numbers["b_over_c"], numbers["k_over_c"])
    return [
        Erratum(
            "(22)",
            "k_e at 0.8 s",
            "m/s^2",
            acceleration + a * velocity + b * x - c * u,
            acceleration - a * velocity - b * x - c * u,
            k,
        ),
        Erratum("(23)", "u in S1", "Pa", (r_up - b * k) / c, ratios.balance_pa(r_up, 1), float(run.pressure_pa[up])),
        Erratum(
            "(24)",
            "u in S2",
            "Pa",
            (r_down + b * k) / c,
            ratios.balance_pa(r_down, -1),
            float(run.pressure_pa[down]),
        ),
        Erratum("4.2", "y when x = r", "m", float(run.true_m[up]) + r_up, float(run.true_m[up]) - r_up, 0.0),
    ]


def _sampled_sine(run: ScenarioRun) -> Erratum:
    """The largest sample of the seed's noise: as printed, in rad/s, and what its amplitude says."""
    return Erratum(
        "5",
        "largest noise sample",
        "p.u.",
        largest_sample_pu(LITERAL, run),
        largest_sample_pu(HONEST_SINE, run),
        AMPLITUDE_PU,
    )


def largest_sample_pu(noise: Noise, run: ScenarioRun) -> float:
    """Return the largest absolute sample of a sine on the grid of a run."""
    return max(abs(noise.sine_pu(time_s)) for time_s in run.time_s.tolist())


def refusal_of_printed_static_friction(valve: ValveParameters) -> str:
    """Return the error of a valve file with F_s as printed; empty if it is accepted."""
    try:
        validate(ValveParameters, valve.model_dump() | {"static_n": PRINTED_STATIC_N}, "F_s as printed")
    except InputError as error:
        return str(error)
    return ""
