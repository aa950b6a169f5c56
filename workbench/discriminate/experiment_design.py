"""An experiment designed for rivals: levels, ramps and holds sought so that a refit imitates as little as possible.

A course is a first level and legs, each a ramp to a level, then a hold; a leg is a move. It begins as some consecutive
moves of an input of the menu (`separating_experiment`). One leg, or all lengths, is changed at random; a change is kept
if it separates more.

A valve A answers a course, under a pressure noise that makes it repeat itself no better than the recordings show. It
and its rival B are refitted to the answer by one Gauss-Newton step, each held to what the recordings so far say of its
parameters z:

    dz = argmin |r + J dz|^2 + dz' H dz,   e = r + J dz     r residuals, told when the stem moves; H over the recordings
                                                            so far, by `Fit.known`
    separation = C(e_B) / C(e_A)     C soft-L1 cost; both ways in the geometric mean, least of all pairs told apart
    sigma_p = k_s / A sqrt(sigma^2 - sigma_sensor^2)     of the noise, an autoregression of 0.2 s; sigma floor

The best few, and the best of the menu as they are, are then refitted in full under other noise, the better half under
more of it, and the one with the largest separation is chosen: by how many times a refitted rival is worse off than the
valve that answered.

Every course stays inside its bounds: pressures, rate, length; and every rival says that the stem stays in its window.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray

from config.errors import InputError
from config.experiment_limits import ExperimentLimits
from config.recording import Recording
from config.results.result import Brief
from sim.composition import AREA, SPRING, Composition
from sim.karnopp import Vector
from sim.open_loop import respond
from workbench.data.noise_floor import with_noise
from workbench.data.record import Record, ready
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import problem_of
from workbench.fit.likelihood import Likelihood, soft
from workbench.fit.minimiser import derivatives, descend
from workbench.fit.onsets import with_onsets
from workbench.fit.threads import on_threads
from workbench.select.separating_experiment import LENGTH_S, MARGIN, MENU, REST_S, Command, Experiment, Shape

MOST_MOVES = 8
"""Of one experiment."""
TRIED_CHANGES, KEPT = 25, 2
"""Changes tried of each course of the menu that is kept; how many are, changed and as they are."""
WINDOWS = 3
"""Courses cut out of an input of the menu."""
SEARCHED, CHECKED = (1, 2), (3, 4, 5)
"""Draws of the noise for which a course is sought, and for which the best are refitted in full."""
IMITATED = 1.001
"""A separation below it is none."""
CORRELATION_S = 0.2
SHORTEST_LEG_S = 0.05
"""Of a leg."""


@dataclass(frozen=True, slots=True)
class Terms:
    """On which the next experiment is chosen: its bounds, its moves, inputs that are not asked."""

    bounds: ExperimentLimits
    most_moves: int = MOST_MOVES
    seed: int = 0
    """Of the changes tried, and of the noise under which rivals answer."""
    without: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Leg:
    """A ramp to a level, Pa, then a hold; s."""

    level_pa: float
    ramp_s: float
    hold_s: float


@dataclass(frozen=True, slots=True, repr=False)
class Course(Brief):
    """A first level, Pa, held until the valve has settled, and the legs that follow."""

    name: str
    first_pa: float
    legs: tuple[Leg, ...]

    @property
    def moves(self) -> int:
        """Legs that go anywhere."""
        levels = [self.first_pa, *(leg.level_pa for leg in self.legs)]
        return sum(before != after for before, after in pairwise(levels))

    @property
    def duration_s(self) -> float:
        """With the first hold."""
        return REST_S + sum(leg.ramp_s + leg.hold_s for leg in self.legs)

    def points(self) -> tuple[tuple[float, float], ...]:
        """Return times, s, and pressures, Pa, between which the command goes straight."""
        time_s, level_pa = REST_S, self.first_pa
        points = [(0.0, level_pa), (time_s, level_pa)]
        for leg in self.legs:
            for length_s in (leg.ramp_s, leg.hold_s):
                time_s += length_s
                if length_s > 0.0:
                    points.append((time_s, leg.level_pa))
        return tuple(points)

    def sample_every(self, period_s: float) -> tuple[Command, Command]:
        """Return times, s, and commands, Pa, each held for a period."""
        at_s, levels_pa = np.array(self.points()).T
        time_s = np.asarray(period_s * np.arange(max(2, round(self.duration_s / period_s))), dtype=np.float64)
        return time_s, np.asarray(np.interp(time_s, at_s, levels_pa), dtype=np.float64)

    def within(self, bounds: ExperimentLimits) -> "Course":
        """Return it with its levels inside the pressures, its ramps no faster than the rate, no longer than allowed.

        Raises:
            InputError: the ramps alone take longer than allowed.
        """
        levels = np.clip([self.first_pa, *(leg.level_pa for leg in self.legs)], bounds.minimum_pa, bounds.maximum_pa)
        least_s = np.abs(np.diff(levels)) / bounds.rate_pa_per_s
        ramps_s = np.maximum([leg.ramp_s for leg in self.legs], least_s)
        holds_s = np.array([leg.hold_s for leg in self.legs])
        room_s = bounds.longest_s - REST_S - least_s.sum()
        if room_s <= 0.0:
            raise InputError(
                "experiment", f"{bounds.longest_s:g} s are too short for {len(self.legs)} moves at the rate"
            )
        spare_s = (ramps_s - least_s).sum() + holds_s.sum()
        part = min(1.0, room_s / spare_s) if spare_s > 0.0 else 1.0
        lengths = zip(
            levels[1:].tolist(), (least_s + part * (ramps_s - least_s)).tolist(), holds_s.tolist(), strict=True
        )
        return Course(
            self.name, float(levels[0]), tuple(Leg(level, ramp, part * hold) for level, ramp, hold in lengths)
        )


@dataclass(frozen=True, slots=True, repr=False)
class DesignedExperiment(Brief):
    """A course, and by how many times it leaves the rival worse off in the least distinct pair after a refit."""

    course: Course
    separation: float

    def experiment(self, period_s: float) -> Experiment:
        """Return it as an input sampled at a period, s."""
        return Experiment(self.course.name, self.separation, *self.course.sample_every(period_s))


def design_experiment(
    fits: Sequence[Fit],
    record: Record,
    terms: Terms,
    *,
    workers: int | None = None,
) -> DesignedExperiment | None:
    """Design the experiment that best tells fitted valves apart; None if no course stays inside the bounds.

    Args:
        fits: two or more.
        record: of all recordings so far.
        terms: to keep to.
        workers: threads, by default one a core.
    """
    rivalry = Rivalry(fits, record, terms)
    starts = list(courses(record, terms))
    rated = list(on_threads(rivalry.rate_step, starts, workers))
    inside = [i for i, logs in enumerate(rated) if logs is not None]
    if not inside:
        return None
    kept_pairs = tells_apart(np.array([rated[i] for i in inside]), log(IMITATED))

    def least(logs: Vector | None) -> float:
        return -inf if logs is None else float(logs[kept_pairs].min())

    def score(course: Course) -> float:
        return least(rivalry.rate_step(course))

    def change_one(i: int) -> Course:
        return improve_course(score, starts[i], least(rated[i]), terms.bounds, np.random.default_rng([terms.seed, i]))

    def rank_courses(found: Sequence[Course], draws: Sequence[int]) -> list[tuple[float, Course]]:
        refitted = on_threads(lambda course: least(rivalry.rate_refit(course, draws)), found, workers)
        return sorted(zip(refitted, found, strict=True), key=lambda each: -each[0])

    kept = sorted(inside, key=lambda i: -least(rated[i]))[:KEPT]
    found = [*on_threads(change_one, kept, workers), *(starts[i] for i in kept)]
    better = [course for _, course in rank_courses(found, CHECKED[:1])][:KEPT]
    separation, best = rank_courses(better, CHECKED)[0]
    return DesignedExperiment(best, exp(separation))


def tells_apart(rated: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    """Return the pairs that are told apart by some course; all where none is.

    Args:
        rated: what each course tells of each pair, (courses, pairs).
        least: that counts.
    """
    told = rated.max(axis=0) > least
    return told if told.any() else np.ones_like(told)


def improve_course(
    score: Callable[[Course], float],
    course: Course,
    most: float,
    bounds: ExperimentLimits,
    generator: np.random.Generator,
) -> Course:
    """Return a course changed at random, a change kept if it scores more than all before; `most`: as it is."""
    for _ in range(TRIED_CHANGES):
        changed = _change_inside(course, bounds, generator)
        there = score(changed)
        if there > most:
            course, most = changed, there
    return course


def _change_inside(course: Course, bounds: ExperimentLimits, generator: np.random.Generator) -> Course:
    """Return a course with one leg changed, or all lengths, or its first level; as it is where that takes too long."""
    try:
        return _change_course(course, bounds.maximum_pa - bounds.minimum_pa, generator).within(bounds)
    except InputError:
        return course


def _change_course(course: Course, span_pa: float, generator: np.random.Generator) -> Course:
    size = 10.0 ** generator.uniform(-2.0, -0.3)
    what, i = generator.integers(5), int(generator.integers(len(course.legs)))
    if what == 0:
        return replace(course, first_pa=course.first_pa + size * span_pa * generator.standard_normal())
    legs = list(course.legs)
    leg = legs[i]
    if what == 1:
        stretch = float(np.exp(2.0 * size * generator.standard_normal()))
        legs = [replace(each, ramp_s=stretch * each.ramp_s, hold_s=stretch * each.hold_s) for each in legs]
    elif what == 2:
        legs[i] = replace(
            leg, ramp_s=max(SHORTEST_LEG_S, leg.ramp_s) * float(np.exp(3.0 * size * generator.standard_normal()))
        )
    elif what == 3:
        legs[i] = replace(
            leg, hold_s=max(SHORTEST_LEG_S, leg.hold_s) * float(np.exp(3.0 * size * generator.standard_normal()))
        )
    else:
        legs[i] = replace(leg, level_pa=leg.level_pa + size * span_pa * float(generator.standard_normal()))
    return replace(course, legs=tuple(legs))


def courses(record: Record, terms: Terms) -> Iterator[Course]:
    """Yield stretches of each input of the menu that keep to the terms, drawn out to the whole length."""
    bounds = terms.bounds
    least_pa, most_pa = float(record.command_pa.min()), float(record.command_pa.max())
    low_pa, high_pa = max(least_pa, bounds.minimum_pa), min(most_pa, bounds.maximum_pa)
    room_s = min(LENGTH_S, bounds.longest_s - REST_S)
    for name in (each for each in MENU if each not in terms.without):
        first, legs = _legs(MENU[name])
        most = max(0, len(legs) - terms.most_moves)
        for begin in sorted({round(most * share) for share in np.linspace(0.0, 1.0, WINDOWS)}):
            chosen = legs[begin : begin + terms.most_moves]
            level = legs[begin - 1].level_pa if begin else first
            lengths_s = sum(leg.ramp_s + leg.hold_s for leg in chosen)
            drawn_out = room_s / lengths_s

            def pressure(share: float) -> float:
                return low_pa + (high_pa - low_pa) * min(max(share, MARGIN), 1.0 - MARGIN)

            yield Course(
                name,
                pressure(level),
                tuple(Leg(pressure(leg.level_pa), drawn_out * leg.ramp_s, drawn_out * leg.hold_s) for leg in chosen),
            ).within(bounds)


def _legs(shape: Shape) -> tuple[float, list[Leg]]:
    """Return an input of the menu as a first level and legs; levels as shares, 0 to 1, of the range."""
    count = 2400
    levels = shape(np.arange(count) / count)
    way = np.sign(np.round(np.diff(levels), 9))
    legs: list[Leg] = []
    step_s = LENGTH_S / count
    for at, going in enumerate(way.tolist()):
        if not going:
            if legs:
                legs[-1] = replace(legs[-1], hold_s=legs[-1].hold_s + step_s)
        elif legs and at and going == way[at - 1]:
            legs[-1] = replace(legs[-1], level_pa=float(levels[at + 1]), ramp_s=legs[-1].ramp_s + step_s)
        else:
            legs.append(Leg(float(levels[at + 1]), step_s, 0.0))
    return float(levels[0]), legs


class Rivalry:
    """Fitted valves held against each other's answers."""

    def __init__(self, fits: Sequence[Fit], record: Record, terms: Terms) -> None:
        self._record = record
        self._bounds = terms.bounds
        self._seed = terms.seed
        self._compositions = [Composition.from_file(each.valve) for each in fits]
        self._fits = list(fits)
        self._sigma_m = max(record.floor_or_scale_m, min(each.rms_m for each in fits))

    @cached_property
    def _information(self) -> list[NDArray[np.float64]]:
        """H of each rival: what the recordings so far say of its parameters, and that none is off by a factor of e."""
        roots = [each.known.root for each in self._fits]
        return [root.T @ root + np.eye(len(root)) for root in roots]

    def rate_step(self, course: Course) -> Vector | None:
        """Return the log separation of each pair after one step, (pairs,); None where the stem leaves its window."""
        return self._pairs(course, SEARCHED, self._after_step)

    def rate_refit(self, course: Course, draws: Sequence[int]) -> Vector | None:
        """Return the log separation of each pair after refits in full, (pairs,); None where the stem leaves its window.

        Args:
            course: to be answered.
            draws: of the noise.
        """
        return self._pairs(course, draws, self._after_refit)

    def _pairs(self, course: Course, draws: Sequence[int], cost: Callable[[Record, int], float]) -> Vector | None:
        """Return log C_B / C_A of each pair, the mean over both ways and over draws of the noise."""
        count = len(self._compositions)
        logs = np.zeros((count, count))
        for draw in draws:
            for i in range(count):
                answer = self.answer(i, course, draw)
                if answer is None:
                    return None
                costs = np.log([cost(answer, j) for j in range(count)])
                logs[i] += costs - costs[i]
        one, other = np.triu_indices(count, 1)
        return np.asarray((logs[one, other] + logs[other, one]) / (2 * len(draws)))

    def answer(self, i: int, course: Course, draw: int) -> Record | None:
        """Return how valve i answers a course; None where the stem leaves its window.

        Args:
            i: of the fits.
            course: what is played to it.
            draw: of the noise of sensor and pressure: the valve repeats itself no better than the recordings show.
        """
        composition, period_s = self._compositions[i], self._record.period_s
        generator = np.random.default_rng([self._seed, draw])
        time_s, command_pa = course.sample_every(period_s)
        noise_pa = self._noise_pa(i) * _autoregression(generator, command_pa.size - 1, period_s)
        step_s = min(period_s, composition.step_s)
        response = respond(composition, composition.theta, command_pa[:-1] + noise_pa, period_s, step_s=step_s)
        # The first hold brings the valve from rest to where the course begins: a free run starts after it.
        settled = time_s >= REST_S
        position_m = response.indicated_m[settled]
        if position_m.min() < self._bounds.low_m or position_m.max() > self._bounds.high_m:
            return None
        sensed_m = position_m + self._record.scale_m * generator.standard_normal(position_m.size)
        columns = {"time_s": time_s[settled], "command_pa": command_pa[settled], "position_m": sensed_m}
        return ready(with_noise(Recording(columns), self._record.scale_m))

    def _noise_pa(self, i: int) -> float:
        theta = self._compositions[i].theta
        spread_m = np.sqrt(max(0.0, self._sigma_m**2 - self._record.scale_m**2))
        return float(theta[SPRING] / theta[AREA] * spread_m)

    def _like(self, i: int, record: Record) -> Likelihood:
        fit = self._fits[i]
        return problem_of(fit, record).likelihood(self._compositions[i], tuple(fit.parameters))

    def _after_step(self, answer: Record, j: int) -> float:
        """Return C after one step, the onsets as they suit the valve."""
        like, theta = self._like(j, answer), self._compositions[j].theta
        onsets_s, groups = with_onsets(like, theta)
        r = groups.whole
        J = derivatives(like, like.coordinates(theta), onsets_s)[:, : len(like.parameters)]
        dz = -np.linalg.solve(J.T @ J + self._information[j], J.T @ r)
        return float(min(soft(r).sum(), soft(r + J @ dz).sum()))

    def _after_refit(self, answer: Record, j: int) -> float:
        """Return C after a fit in full, the parameters held to what the recordings so far say of them."""
        like, theta = self._like(j, answer), self._compositions[j].theta
        z = like.coordinates(theta)
        root = np.asarray(np.linalg.cholesky(self._information[j]).T, dtype=np.float64)
        held = descend(like, z, with_onsets(like, theta)[0], held=(z, root))
        return float(soft(held.groups.whole).sum())


def _autoregression(generator: np.random.Generator, count: int, period_s: float) -> Vector:
    """Return noise of variance 1 that forgets itself over `CORRELATION_S`, (count,)."""
    from scipy.signal import lfilter  # takes half a second to load, and most who load this file never ask for it

    kept = float(np.exp(-period_s / CORRELATION_S))
    fresh = generator.standard_normal(count)
    fresh[1:] *= np.sqrt(1.0 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], fresh), dtype=np.float64)
