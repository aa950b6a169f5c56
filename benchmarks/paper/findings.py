"""What a run of the seed's scenario shows of the seed's claims.

Two ways stand side by side: the seed's own (its solve and filters, corrected; k_e of the last instant kept), and the
daemon's (exact on the samples, friction from the means of the motion). The law is the same: it needs b/c and k/c.
A relative error e of k/c leaves the stem e F_c / k_s from the reference.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.paper.formulas import (
    QUANTITIES,
    ParameterTracks,
    corrected_filters,
    exact_filters,
    fir_length,
    friction,
    tracks,
)
from benchmarks.paper.scenario import DOWN_PU, S1_FROM_S, S2_FROM_S, UNTIL_S, UP_PU, ScenarioRun
from config.valve_file import ValveFile, ValveParameters
from positioner.estimation import Ratios
from positioner.estimation.array import Array
from positioner.virtual.true_parameters import truth
from sim.valve import Valve

SETTLED_S = 0.2
"""The steady state is the last part of a step."""
LARGEST_MISMATCH = 0.01
"""Share of a, b, c that would show in the seed's figures 3 to 5."""
LARGEST_ERROR_PU = 0.01
"""The seed's own figure."""
SEED_LAW_GRID_S = 1e-3
CLAIMS = {
    "a": "a_e, b_e, c_e meet a, b, c from 0.4 s on (figures 3 to 5): worst error, share",
    "b": "any k_e from 0.4 s on will do (figure 6): error it would leave, p.u.",
    "c": "steady-state error in S1, S2 (figure 7), last k_e kept: p.u.",
    "c daemon": "the same with the daemon's estimates: p.u.",
}


@dataclass(frozen=True, slots=True)
class SolvedParameter:
    """a, b or c by the seed's solve: at 0.8 s, and the worst relative error from 0.4 s on."""

    name: str
    value: float
    true: float
    worst_error: float

    @property
    def error(self) -> float:
        """Relative error at 0.8 s."""
        return self.value / self.true - 1


@dataclass(frozen=True, slots=True)
class Scatter:
    """Relative errors from 0.4 to 0.8 s: their mean and standard deviation, the last and the worst."""

    mean: float
    std: float
    last: float
    worst: float

    @classmethod
    def of(cls, values: Array, true: float) -> "Scatter":
        """Return the scatter of values, (n,), about the truth, in the same unit."""
        errors = values / true - 1
        return cls(float(errors.mean()), float(errors.std()), float(errors[-1]), float(np.abs(errors).max()))


@dataclass(frozen=True, slots=True)
class KeptFrictionError:
    """What keeping a single k_e would leave of error, p.u.: the last one, and the worst from 0.4 s on.

    The seed's text leaves open whether 500 samples are 500 periods, and what x_e is; `filters` are the trapezoidal
    rule's, as it says, or exact ones.
    """

    filters: str
    samples: int
    position: str
    last_error_pu: float
    worst_error_pu: float


@dataclass(frozen=True, slots=True)
class DaemonEstimate:
    """The daemon's estimate of one number against the truth, SI units; NaN when it gives none."""

    name: str
    value: float
    std: float
    true: float
    reason: str


@dataclass(frozen=True, slots=True)
class SteadyStateError:
    """The largest distance of the true stem from the reference in the steady state, p.u., by either way."""

    state: str
    reference_pu: float
    seed_error_pu: float
    daemon_error_pu: float


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the seed: the figure found, the largest one with which it holds."""

    claim: str
    figure: float
    limit: float

    @property
    def holds(self) -> bool:
        """Whether it is reproduced."""
        return self.figure < self.limit


@dataclass(frozen=True, slots=True)
class SeedFindings:
    """All findings of one run."""

    noise: str
    period_s: float
    solved: tuple[SolvedParameter, ...]
    k: Scatter
    k_over_c: Scatter
    kept: tuple[KeptFrictionError, ...]
    identified: tuple[DaemonEstimate, ...]
    steps: tuple[SteadyStateError, ...]
    claims: tuple[Claim, ...]


def findings(run: ScenarioRun, file: ValveFile) -> SeedFindings:
    """Return the findings of a run."""
    valve = file.valve
    true, seed_tracks = truth(valve), tracks(run)
    by_solve = tuple(
        SolvedParameter(name, float(row[-1]), true[name], float(np.abs(row / true[name] - 1).max()))
        for name, row in zip(QUANTITIES, seed_tracks.theta, strict=True)
    )
    k = seed_friction(run, seed_tracks)
    kept = _kept_friction_errors(run, seed_tracks, valve)
    steps = _steps(run, file, seed_ratios(run, seed_tracks))
    figures = {
        "a": max(each.worst_error for each in by_solve),
        "b": kept[0].worst_error_pu,
        "c": max(step.seed_error_pu for step in steps),
        "c daemon": max(step.daemon_error_pu for step in steps),
    }
    return SeedFindings(
        noise=run.noise.name,
        period_s=run.period_s,
        solved=by_solve,
        k=Scatter.of(k, true["k"]),
        k_over_c=Scatter.of(k / seed_tracks.theta[2], true["k_over_c"]),
        kept=kept,
        identified=_identified(run, true),
        steps=steps,
        claims=tuple(
            Claim(claim, figure, LARGEST_MISMATCH if claim == "a" else LARGEST_ERROR_PU)
            for claim, figure in figures.items()
        ),
    )


def seed_friction(run: ScenarioRun, seed_tracks: ParameterTracks) -> Array:
    """Return k_e, m/s^2, (samples,) of `tracks`, as the seed says: 500 samples, trapezoids, the measured position."""
    return friction(run, seed_tracks, corrected_filters(fir_length(run), run.period_s), run.measured_m)


def seed_ratios(run: ScenarioRun, seed_tracks: ParameterTracks) -> Ratios:
    """Return what the seed's law goes by: its solve and the friction of the last instant of S3."""
    _, b, c = seed_tracks.theta[:, -1].tolist()
    return Ratios(b / c, float(seed_friction(run, seed_tracks)[-1]) / c)


def _kept_friction_errors(
    run: ScenarioRun, seed_tracks: ParameterTracks, valve: ValveParameters
) -> tuple[KeptFrictionError, ...]:
    """Return the errors by every reading of the seed's text, its plainest first."""
    friction_pu = valve.coulomb_n / (valve.spring_n_per_m * valve.stroke_m)
    true = truth(valve)["k_over_c"]
    kept = []
    for samples in (fir_length(run), fir_length(run) + 1):
        for name, filters in (("trapezoidal", corrected_filters), ("exact", exact_filters)):
            for position, position_m in (("measured", run.measured_m), ("true", run.true_m)):
                k = friction(run, seed_tracks, filters(samples, run.period_s), position_m)
                errors = Scatter.of(k / seed_tracks.theta[2], true)
                kept.append(
                    KeptFrictionError(
                        name, samples, position, abs(errors.last) * friction_pu, errors.worst * friction_pu
                    )
                )
    return tuple(kept)


def by_the_seeds_law(run: ScenarioRun, file: ValveFile, ratios: Ratios) -> tuple[Array, Array]:
    """Return time, s, and true position, m, (n,) each, after the same S3 under the law with other ratios."""
    stroke_m = file.valve.stroke_m
    excitation_pa = run.command_pa[run.identifying]
    steps = [(S2_FROM_S - S1_FROM_S, UP_PU, 1), (UNTIL_S - S2_FROM_S, DOWN_PU, -1)]
    commands, periods = [excitation_pa], [np.full(len(excitation_pa), run.period_s)]
    for duration_s, reference_pu, direction in steps:
        count = round(duration_s / SEED_LAW_GRID_S)
        commands.append(np.full(count, max(0.0, ratios.balance_pa(reference_pu * stroke_m, direction))))
        periods.append(np.full(count, SEED_LAW_GRID_S))
    response = Valve.from_file(file).run(np.concatenate(commands), np.concatenate(periods))
    return response.time_s, response.position_m


def _steps(run: ScenarioRun, file: ValveFile, ratios: Ratios) -> tuple[SteadyStateError, ...]:
    stroke_m = file.valve.stroke_m
    by_law = by_the_seeds_law(run, file, ratios)
    by_daemon = run.time_s, run.true_m
    return tuple(
        SteadyStateError(
            state,
            reference_pu,
            *(_largest_distance_m(*path, end_s, reference_pu * stroke_m) / stroke_m for path in (by_law, by_daemon)),
        )
        for state, reference_pu, end_s in (("S1", UP_PU, S2_FROM_S), ("S2", DOWN_PU, UNTIL_S))
    )


def _largest_distance_m(time_s: Array, position_m: Array, end_s: float, reference_m: float) -> float:
    """Return the largest distance from the reference over the steady state that ends at a time."""
    settled = (time_s > end_s - SETTLED_S) & (time_s < end_s)
    return float(np.abs(position_m[settled] - reference_m).max())


def _identified(run: ScenarioRun, true: dict[str, float]) -> tuple[DaemonEstimate, ...]:
    last = run.readings[-1]
    found = []
    for name, value in true.items():
        estimate = getattr(last, name)
        found.append(DaemonEstimate(name, estimate.value, estimate.std, value, estimate.reason.name))
    return tuple(found)
