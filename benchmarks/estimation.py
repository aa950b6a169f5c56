"""Estimation: microseconds per sample and per reading, and how exact the estimates are; the figures of its document."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from time import perf_counter

import numpy as np
import numpy.typing as npt

from config.valve import load_valve, shipped_valve
from positioner.cli.seed import table
from positioner.estimation import Estimates, Identification, IdentificationSettings
from positioner.estimation.recorded import RecordSettings, identify
from sim.valve import Valve

SAMPLES = 800
REPEATS = 5
RUNS = 40
PASCAL_PER_PSI = 6894.757
PERIOD_S, FINE_S = 1e-3, 1e-5
NAMES = ("a", "b", "c", "b_over_c", "k_over_c")
NOISES_PU = (1e-6, 1e-5, 3e-5, 1e-4, 1e-3)
GAP_SAMPLES = 40
QUIET_M = 1e-9
SETTINGS = IdentificationSettings(stroke_m=0.1016, pressure_pa=1e5, noise_std_m=QUIET_M)
Array = npt.NDArray[np.float64]
Motion = tuple[Array, Array, Array]
"""Time, position, pressure."""


def _times_us(jitter_s: float) -> list[float]:
    """Time each update of one identification; the stem moves slowly upwards all the time."""
    rng = np.random.default_rng(0)
    t = 1e-3 * np.arange(SAMPLES) + rng.uniform(0, jitter_s, SAMPLES)
    x = 0.016 * t + 1e-3 * np.exp(-t / 9e-3) + rng.normal(0, 1e-5, SAMPLES)
    u = 4e4 + 1.3e4 * np.sin(t)
    identification = Identification(replace(SETTINGS, noise_std_m=1e-5))
    identification.restart()
    times = []
    for time_s, position_m, pressure_pa in zip(t.tolist(), x.tolist(), u.tolist(), strict=True):
        begin = perf_counter()
        identification.update(time_s, position_m, pressure_pa, parameters=True, friction=True)
        times.append(1e6 * (perf_counter() - begin))
    return times[100:]


def _cost() -> list[str]:
    """Return one line per kind of time stamp."""
    lines = []
    for name, jitter_s in (("even", 0.0), ("jittered", 2e-4)):
        runs = [_times_us(jitter_s) for _ in range(REPEATS)]
        typical = min(median(times) for times in runs)
        mean = min(sum(times) / len(times) for times in runs)
        reading = min(float(np.percentile(times, 99)) for times in runs)
        lines.append(
            f"estimation, {name} time stamps: {typical:.0f} us per sample, "
            f"{reading:.0f} us where (13) is solved (1 in 20), {mean:.0f} us in the mean"
        )
    return lines


def seed_motion(command_every_s: float) -> Motion:
    """Return the seed's excitation after 0.1 s at rest, sampled at 1 ms; held for 1 ms, or as good as continuous."""
    t = command_every_s * np.arange(round(1.1 / command_every_s)) - 0.1
    command_pa = np.where(t >= -command_every_s / 2, (6.4 + 1.92 * np.sin(t)) * PASCAL_PER_PSI, 0.0)
    response = Valve.from_file(load_valve(shipped_valve("seed"))).run(command_pa, command_every_s)
    sampled = slice(None, None, round(PERIOD_S / command_every_s))
    return response.time_s[sampled], response.position_m[sampled], response.pressure_pa[sampled]


def identified(motion: Motion, settings: IdentificationSettings) -> Identification:
    """Put a motion through an identification."""
    identification = Identification(settings)
    identification.restart()
    for sample in zip(*(column.tolist() for column in motion), strict=True):
        identification.update(*sample, parameters=True, friction=True)
    return identification


def relative_errors(estimates: Estimates) -> list[float]:
    """Return those of a, b, c, b/c, k/c."""
    valve = load_valve(shipped_valve("seed")).valve
    m, A = valve.mass_kg, valve.diaphragm_area_m2
    slope, friction = -valve.spring_n_per_m / A, -valve.coulomb_n / A
    true = (-valve.viscous_ns_per_m / m, -valve.spring_n_per_m / m, A / m, slope, friction)
    return [getattr(estimates, name).value / value - 1 for name, value in zip(NAMES, true, strict=True)]


def _row(title: str, shares: Sequence[float]) -> str:
    return f"  {title:34}" + "".join(f"{100 * share:12.4f}" for share in shares)


def _pressure_between_samples() -> list[str]:
    """Return the errors when pressure is, and is taken as, held or linear."""
    lines = ["pressure between the samples, no noise: errors of a, b, c, b/c, k/c, %"]
    for truth, every_s in (("held", PERIOD_S), ("continuous", FINE_S)):
        for taken, held in (("held", True), ("linear", False)):
            found = identified(seed_motion(every_s), replace(SETTINGS, pressure_held=held)).estimates
            lines.append(_row(f"{truth}, taken as {taken}", relative_errors(found)))
    return lines


def _white_noise() -> list[str]:
    """Return scatter, found and reported, under white noise, and how far noise dominates."""
    rng = np.random.default_rng(0)
    t, x, u = seed_motion(PERIOD_S)
    lines = [f"white noise, 1 ms, {RUNS} runs: standard deviation of a, b, c, b/c, k/c, %, found and reported"]
    for noise_pu in NOISES_PU:
        noise_m = noise_pu * SETTINGS.stroke_m
        settings = replace(SETTINGS, noise_std_m=noise_m)
        runs = [identified((t, x + rng.normal(0, noise_m, len(t)), u), settings) for _ in range(RUNS)]
        errors = np.array([relative_errors(each.estimates) for each in runs])
        reported = [
            [getattr(each.estimates, name).std / abs(getattr(each.estimates, name).value) for name in NAMES]
            for each in runs
        ]
        refused = sum(not each.estimates.b.valid for each in runs)
        lines.append(_row(f"{noise_pu:g} p.u., b refused {refused}/{RUNS}", errors.std(axis=0).tolist()))
        lines.append(_row("  reported, median", np.median(reported, axis=0).tolist()))
    return lines


def _gap() -> list[str]:
    """Return what a gap anywhere in the window costs, without noise; one that hides the first jerk included."""
    t, x, u = seed_motion(PERIOD_S)
    worst = np.zeros(len(NAMES))
    for start in range(110, 850, 20):
        keep = np.ones(len(t), dtype=np.bool_)
        keep[start : start + GAP_SAMPLES] = False
        errors = relative_errors(identified((t[keep], x[keep], u[keep]), SETTINGS).estimates)
        worst = np.maximum(worst, np.abs(errors))
    return [_row(f"gap of {GAP_SAMPLES} ms, worst", worst.tolist())]


def _refinement() -> list[str]:
    """Return how long the maximum-likelihood fit takes, and where it stands beside the bound."""
    rng = np.random.default_rng(0)
    t, x, u = seed_motion(PERIOD_S)
    times_ms = []
    for _ in range(RUNS):
        measured = x + rng.normal(0, 1e-4 * SETTINGS.stroke_m, len(x))
        begin = perf_counter()
        identify(t, measured, u, RecordSettings(pressure_held=True))
        times_ms.append(1e3 * (perf_counter() - begin))
    file = load_valve(shipped_valve("seed"))
    cells = [
        table.cell(file, table.motion(file, period_s), period_s, noise_pu, RUNS)
        for period_s in (1e-3, 5e-3)
        for noise_pu in (1e-4, 1e-3)
    ]
    return [
        f"refinement of 0.9 s at 1 ms: {median(times_ms):.0f} ms, at most {max(times_ms):.0f} ms of {RUNS}",
        *table.lines(cells),
    ]


def report() -> list[str]:
    """Return the lines."""
    return [*_cost(), *_pressure_between_samples(), *_white_noise(), *_gap(), *_refinement()]


if __name__ == "__main__":
    print("\n".join(report()))
