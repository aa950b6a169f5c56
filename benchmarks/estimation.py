"""Estimation: microseconds per sample and per reading, and how exact the estimates are; the figures of its document."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter, sleep

import numpy as np
import numpy.typing as npt

from benchmarks import hardships
from benchmarks.paper import noise_table
from config.valve_file import EffectTable, load_valve, shipped_valve
from positioner.daemon.refinement_process import RefinementProcess
from positioner.estimation import Estimates, Identification, IdentificationSettings
from positioner.estimation.algebraic import Identifier
from positioner.estimation.batch import BatchSettings, identify
from positioner.estimation.online import READINGS
from positioner.estimation.refiner import InProcessRefiner, Refinement, RefinementJob
from positioner.estimation.weighted_least_squares import CHAINS, ROWS, Feeds, kernel
from sim.valve import Valve

SAMPLES = 800
REPEATS = 5
RUNS = 40
PASCAL_PER_PSI = 6894.757
PERIOD_S, FINE_S = 1e-3, 1e-5
REST, WINDOW_S = 100, 0.8
"""Samples at rest before the motion, at 1 ms; and the window."""
SEEDS = 200
STARTED_S = 2.0
SOLVED = READINGS // 2
"""Readings in a window that solve (13): before half of it is there they do not."""
OCTAVES = tuple(2.0**-power for power in range(5, -1, -1))
FOUR: tuple[Feeds, ...] = (((2, 0), (-4, 1), (1, 2)), ((-2, 1), (1, 2)), ((1, 2),), ((1, 2),))
"""The columns' feeds when k is a fourth unknown: d^2/ds^2 of the transformed equation, over s^3."""
TRUE = noise_table.true_values(load_valve(shipped_valve("seed"))).tolist()
AREA = load_valve(shipped_valve("seed")).valve.diaphragm_area_m2
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
        reading = min(median(sorted(times)[-SOLVED:]) for times in runs)
        lines.append(
            f"estimation, {name} time stamps: {typical:.0f} us per sample, "
            f"{reading:.0f} us where (13) is solved ({SOLVED} a window), {mean:.0f} us in the mean"
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
    true = [TRUE[noise_table.NAMES.index(name)] for name in NAMES]
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


def _one_window_or_several() -> list[str]:
    """Return what several windows, and k as a fourth unknown, are worth: rms errors of a, b and b/c."""
    rng = np.random.default_rng(0)
    t, x, u = (column[REST:] for column in seed_motion(PERIOD_S))
    inside = t - t[0] <= WINDOW_S + 1e-6
    unit_s, span_pa = WINDOW_S, SETTINGS.pressure_pa
    t, x, u = (t[inside] - t[0]) / unit_s, x[inside] / SETTINGS.stroke_m, u[inside] / span_pa
    noisy = {noise: x + rng.normal(0, noise, (RUNS, len(x))) for noise in (1e-6, 1e-5, 1e-4, 1e-3)}
    lines = ["algebraic identifier, 1 ms: rms errors of a, b, b/c, %, by the number of windows and of unknowns"]
    for title, ends, unknowns in (
        ("one window, 3 unknowns: (13)", (1.0,), 3),
        ("one window, k a fourth", (1.0,), 4),
        ("windows doubling, 3 unknowns", OCTAVES, 3),
        ("windows doubling, k a fourth", OCTAVES, 4),
        ("twice as many, 3 unknowns", tuple(2.0 ** (-power / 2) for power in range(10, -1, -1)), 3),
    ):
        system = _System.of(t, u, ends, unknowns)
        for noise, runs in noisy.items():
            found = np.array([system.solved(each) for each in runs])
            a, b, c = (found * [1 / unit_s, 1 / unit_s**2, SETTINGS.stroke_m / (span_pa * unit_s**2)]).T
            errors = np.array([a / TRUE[0], b / TRUE[1], b / c / TRUE[4]]) - 1
            lines.append(_row(f"{title}, {noise:g}", np.sqrt((errors**2).mean(axis=1)).tolist()))
    file = load_valve(shipped_valve("seed"))
    moved = noise_table.motion(file, PERIOD_S)
    for title, known in (("start known", 2), ("x_0 free", 1), ("x_0, v_0 free", 0)):
        bounds = noise_table.bound(file, replace(moved, known=known), 1e-4 * SETTINGS.stroke_m)
        lines.append(_row(f"bound at 0.0001, {title}", bounds[[0, 1, 4]].tolist()))
    return lines


@dataclass(frozen=True)
class _System:
    """Rows of (8) as functionals of the positions: q = Q x, p_a = P_a x, p_b = P_b x; `known`: p_c and, if free, k's.

    With k a fourth unknown the equation of motion is differentiated twice only, which leaves 2 k / s^3 of the constant.
    """

    Q: Array
    P_a: Array
    P_b: Array
    known: Array

    @classmethod
    def of(cls, t: Array, u: Array, ends: Sequence[float], unknowns: int) -> "_System":
        chains = CHAINS if unknowns == 3 else FOUR
        levels = ROWS if unknowns == 3 else (3, *ROWS)
        Q, P_a, P_b, _ = (_functionals(feeds, levels, ends, t, held=False) for feeds in chains)
        held = _functionals(chains[3], levels, ends, t, held=True)
        known = [held @ u]
        if unknowns == 4:
            known.append(_functionals(chains[3], levels, ends, t, held=False) @ np.ones(len(t)))
        return cls(Q, P_a, P_b, np.array(known).T)

    def solved(self, x: Array) -> Array:
        """Return a, b, c by generalised least squares, the weights from the solution before."""
        P = np.column_stack((self.P_a @ x, self.P_b @ x, self.known))
        q = self.Q @ x
        root = np.diag(1 / np.sqrt((self.Q**2).sum(axis=1)))
        for _ in range(4):
            white = root @ P
            size = np.abs(white).max(axis=0)
            theta: Array = np.asarray(np.linalg.lstsq(white / size, root @ q, rcond=None)[0] / size)
            E = self.Q - theta[0] * self.P_a - theta[1] * self.P_b
            sizes = np.sqrt((E**2).sum(axis=1))
            alike = (E / sizes[:, None]) @ (E / sizes[:, None]).T + 1e-8 * np.eye(len(q))
            root = np.linalg.inv(np.linalg.cholesky(alike)) / sizes
        return np.asarray(theta[:3])


def _functionals(feeds: Feeds, levels: Sequence[int], ends: Sequence[float], t: Array, *, held: bool) -> Array:
    """Return the weights (rows, samples) of the samples in a column: by Gauss's rule between them."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    h = np.diff(t)[:, None]
    tau = t[:-1, None] + h * (nodes + 1) / 2
    rows = np.zeros((len(ends) * len(levels), len(t)))
    for number, end in enumerate(ends):
        inside = (tau < end) * h * weights / 2
        for level, n in enumerate(levels):
            of_node = np.where(tau < end, kernel(feeds, n, tau, end), 0.0) * inside
            later = of_node if held else of_node * (nodes + 1) / 2
            row = rows[number * len(levels) + level]
            row[1:] += later.sum(axis=1)
            row[:-1] += (of_node - later).sum(axis=1)
    return rows


def _restarts() -> list[str]:
    """Return what is known at the end of 0.8 s when time zero is put later than where the motion begins."""
    t, x, u = seed_motion(PERIOD_S)
    noise_m = 1e-4 * SETTINGS.stroke_m
    lines = ["restarted so long after the motion began, noise 1e-4 p.u.: reported deviation of a, b, c, b/c, %"]
    for late in (0, 2, 5, 10, 20, 50):
        identifier = Identifier(WINDOW_S, SETTINGS.stroke_m, SETTINGS.pressure_pa)
        rows = slice(REST + late, REST + 801)
        for time_s, position_m, pressure_pa in zip(t[rows].tolist(), x[rows].tolist(), u[rows].tolist(), strict=True):
            identifier.update(time_s, position_m, pressure_pa)
        solution = identifier.solve(noise_m)
        assert solution is not None
        _, b, c = solution.theta.tolist()
        of_ratio = np.array([0.0, 1 / c, -b / c**2])
        ratio = float(np.sqrt(of_ratio @ solution.covariance @ of_ratio)) / abs(b / c)
        std = (np.sqrt(np.diag(solution.covariance)) / np.abs(solution.theta)).tolist()
        lines.append(_row(f"{late} ms", [*std, ratio]))
    return lines


def _latency() -> list[str]:
    """Return how long after the window closes the refinement is back, through the process that does it."""
    rng = np.random.default_rng(0)
    t, x, u = seed_motion(PERIOD_S)
    process = RefinementProcess()
    refiner = process.refiner(blocking=True)
    sleep(STARTED_S)  # a daemon's process is there long before a window closes
    times_ms = []
    for _ in range(2 * RUNS):
        measured = x + rng.normal(0, 1e-4 * SETTINGS.stroke_m, len(x))
        job = RefinementJob(t, measured, u, BatchSettings(pressure_held=True))
        begin = perf_counter()
        refiner.submit(job)
        refiner.collect()
        times_ms.append(1e3 * (perf_counter() - begin))
    process.stop()
    return [
        f"refinement of 0.9 s at 1 ms, handed out and back: median {median(times_ms):.0f} ms, "
        f"90 % {float(np.percentile(times_ms, 90)):.0f} ms, first {times_ms[0]:.0f} ms, of {len(times_ms)}"
    ]


def _limits() -> list[str]:
    """Return what is refused where the mass cannot be known: at 20 ms, and behind a lag of 0.3 s."""
    rng = np.random.default_rng(0)
    file = load_valve(shipped_valve("seed"))
    coarse = noise_table.motion_at(file, 0.02 * np.arange(-20, 41, dtype=np.float64), 20)
    lagging = file.model_copy(
        update={"effect": (EffectTable.model_validate({"name": "ip_lag", "time_constant_s": 0.3}),)}
    )
    slow = Valve.from_file(lagging).run(np.where(np.arange(1100) < REST, 0.0, 6.4 * PASCAL_PER_PSI), PERIOD_S)
    lines = ["where the mass cannot be known, noise 1e-4 p.u."]
    for title, columns in (
        ("20 ms", (coarse.time_s, coarse.position_m, coarse.pressure_pa)),
        ("lag 0.3 s, pressure measured", (slow.time_s, slow.position_m, slow.pressure_pa)),
        ("lag 0.3 s, command taken for it", (slow.time_s, slow.position_m, np.append(0.0, slow.command_pa[1:]))),
    ):
        t, x, u = columns
        found = identify(t, x + rng.normal(0, 1e-4 * SETTINGS.stroke_m, len(x)), u, BatchSettings())
        said = ", ".join(
            f"{name} {getattr(found.estimates, name).reason.name}" for name in ("a", "b_over_c", "k_over_c")
        )
        leverage = found.fit.leverage if found.fit is not None else 0.0
        lines.append(f"  {title}: {said}; one sample carries {100 * leverage:.0f} % of what is known of the mass")
    return lines


def _ageing() -> list[str]:
    """Return how passive identification follows friction that grows by 30 % over 30 moves in 10 minutes."""
    valve = Valve.from_file(load_valve(shipped_valve("seed")))
    valve.rest_at(0.05)
    pressure_pa, rng = valve.pressure_pa, np.random.default_rng(0)
    identification = Identification(replace(SETTINGS, noise_std_m=None, pressure_pa=4e5))
    refiner = InProcessRefiner()
    identification.restart()
    coulomb_n, static_n, spring, area = (-TRUE[5] * AREA, 1708.09, -TRUE[4] * AREA, AREA)
    errors = []
    for move in range(30):
        grown = 1 + 0.3 * move / 29
        valve.change(coulomb_n=coulomb_n * grown, static_n=static_n * grown)
        known = identification.estimates
        friction_n = -known.k_over_c.value * area if known.law_ready else coulomb_n
        target_m = SETTINGS.stroke_m * float(rng.uniform(0.3, 0.8))
        direction = 1 if target_m > valve.position_m else -1
        for row in range(250):
            if row == REST:
                pressure_pa = (spring * target_m + direction * friction_n) / area
            valve.advance(pressure_pa, 2e-3)
            measured_m = valve.position_m + float(rng.normal(0, 1e-4 * SETTINGS.stroke_m))
            sample = (20.0 * move + 2e-3 * row, measured_m, valve.pressure_pa)
            stands = Refinement.of(refiner)
            identification.update(*sample, parameters=True, friction=True, passive=True, refinement=stands)
            if (job := identification.taken_job()) is not None:
                refiner.submit(job)
        errors.append(abs(identification.estimates.k_over_c.value / (-coulomb_n * grown / area) - 1))
    settled = [each for each in errors[3:] if each == each]  # noqa: PLR0124 - NaN is not itself
    return [
        f"passive, friction + 30 % in 10 minutes of 30 moves: k/c followed within {100 * max(settled):.1f} %, "
        f"{identification.moves} moves used"
    ]


def _bounds() -> list[str]:
    """Return the noise table, and the hardships: the seed's identifier, ours and the bound side by side."""
    file = load_valve(shipped_valve("seed"))
    rows = [row for noise_pu in (1e-4, 1e-3) for row in hardships.hardships(file, noise_pu, SEEDS // 2)]
    return [*noise_table.lines(list(noise_table.table(file, SEEDS))), *hardships.lines(rows)]


def report() -> list[str]:
    """Return what it costs; the rest takes minutes."""
    return [*_cost(), *_latency()]


EVERYTHING = (
    report,
    _pressure_between_samples,
    _white_noise,
    _one_window_or_several,
    _restarts,
    _gap,
    _limits,
    _ageing,
    _bounds,
)

if __name__ == "__main__":
    for part in EVERYTHING:
        print("\n".join(part()), flush=True)
