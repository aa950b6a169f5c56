"""Noise by sample time: the seed's identifier, ours and the Cramér-Rao bound, many seeds each.

    0.1 s at rest at x = 0, then 0.8 s of u = (6.4 + 1.92 sin t) psi, held from sample to sample; white noise on x

The bound is that of four unknowns a, b, c, k with the start known, J the derivatives of x(t_i) by them:

    cov θ >= σ^2 (J'J)^-1

Where the start is not known, x_0 and v_0 are columns of J besides, and the bound is the inverse's first four rows and
columns.

The seed's identifier is its (13), corrected, by the trapezoidal rule, at 0.8 s; ours is what `positioner estimate` and
the daemon's refinement do. The stem is the simulator's.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np

from benchmarks.paper.formulas import solved
from benchmarks.paper.scenario import ALPHA_PA, BETA_PA, OMEGA_RAD_PER_S
from config.valve_file import ValveFile
from positioner.estimation.array import Array
from positioner.estimation.batch import BatchSettings, identify
from positioner.estimation.stem_response import responses
from sim.valve import Valve

PERIODS_S = (1e-5, 1e-3, 5e-3)
NOISES_PU = (1e-4, 1e-3, 0.01 / sqrt(2))
REST_S, WINDOW_S = 0.1, 0.8
NAMES = ("a", "b", "c", "k", "b_over_c", "k_over_c")


@dataclass(frozen=True, slots=True)
class Cell:
    """One sample time and noise; shares of the true values, in the order of `NAMES`.

    Attributes:
        bound: Cramér-Rao, standard deviations.
        seed_std, seed_bias: of the seed's identifier, a, b, c, and b/c (nothing for k).
        std, bias: of ours, over the seeds.
        reported: standard deviation that ours reports, in the mean.
        covered: how often the truth lies within one reported standard deviation; 0.683 is honest.
        valid: how often the value is valid.
        seeds: runs.
    """

    period_s: float
    noise_pu: float
    bound: tuple[float, ...]
    seed_std: tuple[float | None, ...]
    seed_bias: tuple[float | None, ...]
    std: tuple[float, ...]
    bias: tuple[float, ...]
    reported: tuple[float, ...]
    covered: tuple[float, ...]
    valid: tuple[float, ...]
    seeds: int


@dataclass(frozen=True, slots=True)
class SampledMotion:
    """Time, true position and the pressure held up to each sample, (n,), SI units; `start` is the row of its beginning.

    `known` says what is known of that beginning: 2 where and how fast, 1 how fast, 0 nothing.
    """

    time_s: Array
    position_m: Array
    pressure_pa: Array
    start: int
    velocity_m_per_s: Array
    known: int = 2


def table(file: ValveFile, seeds: int) -> Iterator[Cell]:
    """Yield the cells."""
    for period_s in PERIODS_S:
        moved = motion(file, period_s)
        for noise_pu in NOISES_PU:
            yield cell(file, moved, period_s, noise_pu, seeds)


def motion(file: ValveFile, period_s: float) -> SampledMotion:
    """Return the motion without noise."""
    rest, rows = round(REST_S / period_s), round(WINDOW_S / period_s)
    return motion_at(file, period_s * np.arange(-rest, rows + 1, dtype=np.float64), rest)


def motion_at(file: ValveFile, time_s: Array, start: int) -> SampledMotion:
    """Return the motion sampled, and commanded, at instants, (n,), s; it begins at row `start`."""
    excitation = ALPHA_PA + BETA_PA * np.sin(OMEGA_RAD_PER_S * time_s[start:-1])
    held = np.concatenate((np.zeros(start), excitation))
    response = Valve.from_file(file).run(held, np.diff(time_s))
    return SampledMotion(time_s, response.position_m, np.append(0.0, held), start, response.velocity_m_per_s)


def true_values(file: ValveFile) -> Array:
    """Return a, b, c, k, b/c, k/c, (6,), SI units."""
    valve = file.valve
    m, A, k_s = valve.mass_kg, valve.diaphragm_area_m2, valve.spring_n_per_m
    return np.array(
        [-valve.viscous_ns_per_m / m, -k_s / m, A / m, -valve.coulomb_n / m, -k_s / A, -valve.coulomb_n / A]
    )


def bound(file: ValveFile, moved: SampledMotion, noise_m: float) -> Array:
    """Return the Cramér-Rao bounds, (6,), shares of the true values; `noise_m` is the noise of the position."""
    true = true_values(file)
    rows = slice(moved.start, None)
    t, u = moved.time_s[rows], moved.pressure_pa[rows]
    x_0, v_0 = moved.position_m[moved.start], moved.velocity_m_per_s[moved.start]

    def position_m(off: Array) -> Array:
        a, b, c, k = (true[:4] * np.exp(off[:4])).tolist()
        X_g, X_q, X_0, X_1 = responses(t, u, 1, a / b, -1 / b, held=True)
        return np.asarray(-c / b * X_g - k / b * X_q + (x_0 + off[4]) * X_0 + (v_0 + off[5]) * X_1)

    steps = 1e-5 * np.eye(6)[: 6 - moved.known]
    J = np.array([(position_m(each) - position_m(-each)) / 2e-5 for each in steps]).T
    covariance = noise_m**2 * np.linalg.inv(J.T @ J)[:4, :4]
    gradients = np.vstack((np.eye(4), [[0, 1, -1, 0], [0, 0, -1, 1]]))
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients)))


def cell(file: ValveFile, moved: SampledMotion, period_s: float, noise_pu: float, seeds: int) -> Cell:
    """Return what so many runs of one sample time and noise give."""
    noise_m, true = noise_pu * file.valve.stroke_m, true_values(file)
    ours, reported, valid, theirs = [], [], [], []
    for seed in range(seeds):
        rng = np.random.default_rng((seed, round(1e6 * period_s), round(1e6 * noise_pu)))
        measured = moved.position_m + rng.normal(0, noise_m, len(moved.position_m))
        found = identify(moved.time_s, measured, moved.pressure_pa, BatchSettings(pressure_held=True)).estimates
        each = [getattr(found, name) for name in NAMES]
        ours.append([one.value for one in each])
        reported.append([one.std for one in each])
        valid.append([one.valid for one in each])
        rows = slice(moved.start, None)
        last = np.array([len(moved.time_s) - moved.start - 1])
        theirs.append(solved(moved.time_s[rows], measured[rows], moved.pressure_pa[rows], last)[:, 0])
    errors = np.array(ours) / true - 1
    covered = np.abs(errors) < np.array(reported) / np.abs(true)
    a_b_c = np.array(theirs)
    seed_errors = np.column_stack((a_b_c, a_b_c[:, 1] / a_b_c[:, 2])) / true[[0, 1, 2, 4]] - 1
    return Cell(
        period_s=period_s,
        noise_pu=noise_pu,
        bound=_numbers(bound(file, moved, noise_m)),
        seed_std=_spread(seed_errors.std(axis=0)),
        seed_bias=_spread(seed_errors.mean(axis=0)),
        std=_numbers(errors.std(axis=0, ddof=1)),
        bias=_numbers(errors.mean(axis=0)),
        reported=_numbers((np.array(reported) / np.abs(true)).mean(axis=0)),
        covered=_numbers(covered.mean(axis=0)),
        valid=_numbers(np.array(valid).mean(axis=0)),
        seeds=seeds,
    )


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())


def _spread(values: Array) -> tuple[float | None, ...]:
    """Put the seed's a, b, c, b/c where they belong."""
    a, b, c, b_over_c = values.tolist()
    return a, b, c, None, b_over_c, None


def lines(cells: list[Cell]) -> list[str]:
    """Return the table for people."""
    said = [
        "",
        "white noise by sample time, shares of the true values: Cramér-Rao bound; ours as multiples of it: standard",
        "deviation, bias, the deviation it reports; how often the truth lies within that; the seed's: rms of its error",
        f"{'noise p.u.':11}{'sample':>8}{'seeds':>6}  {'':10}" + "".join(f"{name:>10}" for name in NAMES),
    ]
    for each in cells:
        period = f"{1e3 * each.period_s:g} ms" if each.period_s >= 1e-3 else f"{1e6 * each.period_s:g} us"
        head = f"{each.noise_pu:<11.2g}{period:>8}{each.seeds:>6}"
        size = [
            None if std is None or bias is None else sqrt(std * std + bias * bias)
            for std, bias in zip(each.seed_std, each.seed_bias, strict=True)
        ]
        rows = (
            ("bound", [f"{100 * value:.3f} %" for value in each.bound]),
            ("ours std", [f"{std / at:.2f}" for std, at in zip(each.std, each.bound, strict=True)]),
            ("ours bias", [f"{bias / at:+.2f}" for bias, at in zip(each.bias, each.bound, strict=True)]),
            ("reported", [f"{std / at:.2f}" for std, at in zip(each.reported, each.bound, strict=True)]),
            ("in 68 %", [f"{100 * share:.0f} %" for share in each.covered]),
            ("valid", [f"{100 * share:.0f} %" for share in each.valid]),
            ("the seed's", ["-" if one is None else f"{100 * one:.3g} %" if one < 1 else "lost" for one in size]),
        )
        for number, (title, row) in enumerate(rows):
            said.append(f"{head if number == 0 else '':25}  {title:10}" + "".join(f"{one:>10}" for one in row))
    return said
