"""What a course of the seed's scenario says about the seed's claims.

Two ways stand side by side: the seed's own (its solve, corrected; k_e of the last instant kept) and the daemon's
(exact between the samples, friction from the means of the motion). The law is the same; it needs b/c and k/c alone.
An error of k/c is one of the stem's rest: delta x = (F_c / k_s) (delta k / k) in share of k/c.
"""

from dataclasses import dataclass

import numpy as np

from config.valve import ValveFile
from positioner.cli.seed_formulas import QUANTITIES, Tracks, tracks, truth
from positioner.cli.seed_scenario import DOWN_PU, S1_FROM_S, S2_FROM_S, UNTIL_S, UP_PU, Course
from positioner.control.law import balance_pa
from positioner.estimation import Ratios
from positioner.estimation.identifier import Array
from sim.valve import Valve

SETTLED_S = 0.2
"""The steady state is the last part of a step."""
LARGEST_MISMATCH = 0.01
"""Share of a, b, c that would be seen in the seed's figures 3 to 5."""
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
class Solved:
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
        """Hold values against the truth."""
        errors = values / true - 1
        return cls(float(errors.mean()), float(errors.std()), float(errors[-1]), float(np.abs(errors).max()))


@dataclass(frozen=True, slots=True)
class Identified:
    """What the daemon says of one number, SI units; NaN when it says nothing."""

    name: str
    value: float
    std: float
    true: float
    reason: str


@dataclass(frozen=True, slots=True)
class Step:
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
class Findings:
    """All that is said of one course."""

    noise: str
    period_s: float
    solved: tuple[Solved, ...]
    k: Scatter
    k_over_c: Scatter
    k_with_true_x: Scatter
    identified: tuple[Identified, ...]
    steps: tuple[Step, ...]
    claims: tuple[Claim, ...]


def findings(course: Course, file: ValveFile) -> Findings:
    """Return what a course says."""
    valve = file.valve
    true, seen = truth(valve), tracks(course)
    by_solve = tuple(
        Solved(name, float(row[-1]), true[name], float(np.abs(row / true[name] - 1).max()))
        for name, row in zip(QUANTITIES, seen.theta, strict=True)
    )
    k_over_c = Scatter.of(seen.friction_m_per_s2 / seen.theta[2], true["k_over_c"])
    steps = _steps(course, file, seed_ratios(seen))
    figures = {
        "a": max(each.worst_error for each in by_solve),
        "b": k_over_c.worst * valve.coulomb_n / (valve.spring_n_per_m * valve.stroke_m),
        "c": max(step.seed_error_pu for step in steps),
        "c daemon": max(step.daemon_error_pu for step in steps),
    }
    return Findings(
        noise=course.noise.name,
        period_s=course.period_s,
        solved=by_solve,
        k=Scatter.of(seen.friction_m_per_s2, true["k"]),
        k_over_c=k_over_c,
        k_with_true_x=Scatter.of(seen.friction_true_x_m_per_s2, true["k"]),
        identified=_identified(course, true),
        steps=steps,
        claims=tuple(
            Claim(claim, figure, LARGEST_MISMATCH if claim == "a" else LARGEST_ERROR_PU)
            for claim, figure in figures.items()
        ),
    )


def seed_ratios(seen: Tracks) -> Ratios:
    """Return what the seed's law goes by: its solve and the friction of the last instant of S3."""
    _, b, c = seen.theta[:, -1].tolist()
    return Ratios(b / c, float(seen.friction_m_per_s2[-1]) / c)


def by_the_seeds_law(course: Course, file: ValveFile, ratios: Ratios) -> tuple[Array, Array]:
    """Return time, s, and true position, m, of the same valve after the same S3, under the law with other ratios."""
    stroke_m = file.valve.stroke_m
    excitation_pa = course.command_pa[course.identifying]
    steps = [(S2_FROM_S - S1_FROM_S, UP_PU, 1), (UNTIL_S - S2_FROM_S, DOWN_PU, -1)]
    commands, periods = [excitation_pa], [np.full(len(excitation_pa), course.period_s)]
    for duration_s, reference_pu, direction in steps:
        count = round(duration_s / SEED_LAW_GRID_S)
        commands.append(np.full(count, max(0.0, balance_pa(reference_pu * stroke_m, direction, ratios))))
        periods.append(np.full(count, SEED_LAW_GRID_S))
    response = Valve.from_file(file).run(np.concatenate(commands), np.concatenate(periods))
    return response.time_s, response.position_m


def _steps(course: Course, file: ValveFile, ratios: Ratios) -> tuple[Step, ...]:
    stroke_m = file.valve.stroke_m
    by_law = by_the_seeds_law(course, file, ratios)
    by_daemon = course.time_s, course.true_m
    return tuple(
        Step(
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


def _identified(course: Course, true: dict[str, float]) -> tuple[Identified, ...]:
    last = course.readings[-1]
    found = []
    for name, value in true.items():
        estimate = getattr(last, name)
        found.append(Identified(name, estimate.value, estimate.std, value, estimate.reason.name))
    return tuple(found)
