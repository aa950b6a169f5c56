"""Where searches begin: for the bare valve, and with an effect added.

The bare valve begins at landings, at the valve file's values, at a regression of forces over the moving samples, and at
draws round both. An effect begins at landings with each of its strengths, and on a grid of strengths at the best base
fit and the valve file's values, at none of them too, so that the extended valve is never worse than the base it
extends; then, where it is still in the race, at the other landings and base fits. What the record's positions suggest
is in `guesses`.

    A p + load = k_s x + F_v v + F_c sign(v)      least squares over the moving samples, m v' neglected, k_s = 0 stays;
                                                  where these say nothing of v (`sampling`), over the landings,
                                                  without F_v v

Landings say nothing of motion: what they do not hold, F_v, F_s inside its interval and the effect's own dynamics, is
scanned with the rest kept. Every other rest and those between solve for themselves: two starts without a common
measurement.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from config.valve_file import ValveParameters
from sim.composition import AREA, COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.data.motion import directions, velocity_m_per_s
from workbench.data.record import Record
from workbench.fit.agreement import Place
from workbench.fit.break_aways import broken_loose
from workbench.fit.descent import MIDDLING, WIDE, descended, scanned
from workbench.fit.guesses import guessed_values
from workbench.fit.landings import Landings, Rest, rests
from workbench.fit.objective import MIDDLE, SimulationError, smoothed
from workbench.model.free_run import FreeRun
from workbench.model.parameters import Parameter, strengths
from workbench.model.sampling import Sampling, landings, sampling, slide_time_s

SPREAD = {SPRING: 0.1, VISCOUS: 0.7, COULOMB: 0.3}
"""Standard deviation of the draws, of the logarithm."""
STATIC_RATIO = (0.0, 0.4)
"""Range of the draws of log(F_s / F_c)."""
DRAWS_REGRESSED, DRAWS_FILE = 40, 12
ENOUGH_MOVING, ENOUGH_LANDINGS, FEWEST_JUDGED = 20, 6, 12
REWEIGHED = 3
SLOWER = 10.0
STATIC_FACTORS = (1.0, 1.05, 1.2, 1.5)
EXCESSES = (1.0, 0.5, 0.1)
"""Of F_s - F_c of a base fit, with which strengths are tried: what the base took for it may be the effect."""
BEST_BASE, LANDINGS = "base fit 1", "landings"
"""Origins."""
AT_BEST, EACH_SEED = 2, 1
"""Strengths begun at the best base fit, and at each other."""
AS_GOOD = 1.1
"""Times the least cost of landings, within which they do not tell one solution from another."""
LANDED_BASE, LANDED_EFFECT = 1, 2
"""Searches begun at each half of the landings."""
ENOUGH_RESTS = 6
VISCOUS_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)
ABOUT = np.geomspace(4e-3, 0.4, 7)
"""Distances, of a log-parameter, in which what the landings do not hold is scanned about the grid,"""
ALTERNATIONS = 2
"""so many times in turn."""
VALLEY = 0.25
"""Step, of a log-parameter, along solutions that land alike."""
PLAY = "backlash.width_m"
NARROWEST, WIDEST, PLAYS = 6e-3, 0.9, 5
"""Of the dead band 2 F_c / k_s, beyond which a play leaves no friction; widths in each of three bands."""
STATIC_SHIFTS = (1.0, 0.0, -1.0)


class EffectStarts(NamedTuple):
    """Where searches with effects begin."""

    first: list[Place]
    strengths: list[list[Vector]]
    """Coordinates of each strength at the best base fit, from which most of `first` were chosen."""
    weakest: Place
    others: Callable[[], list[Place]]
    """Finds the others, which nobody needs where the first fall far behind another effect's."""


def base_starts(error: SimulationError, origins: Sequence[Vector], seed: int, count: int) -> list[Place]:
    """Return where the bare valve's searches begin: landings, origins and draws, the best by the screening cost.

    Args:
        error: by whose screening cost they are compared.
        origins: theta of the valve file, and that of the regression.
        seed: of the draws.
        count: how many draws.
    """
    generator = np.random.default_rng(seed)
    theta, regressed = origins
    drawn = [*_drawn(regressed, DRAWS_REGRESSED, generator), *_drawn(theta, DRAWS_FILE, generator)]
    halves = landed_halves(error)
    at_landings = [z for half in halves for z in landed_starts(error, half, (theta,), [()], (), LANDED_BASE)]
    return [
        *moved_starts(error, at_landings, ()),
        Place(error.coordinates(theta), "valve file"),
        Place(error.coordinates(regressed), "regression"),
        *(Place(z, f"draw {i}") for i, z in enumerate(error.screened(map(error.coordinates, drawn), count))),
    ]


def effect_starts(
    error: SimulationError,
    added: Sequence[Parameter],
    seeds: Sequence[Vector],
    *,
    landed: bool = True,
    points: Sequence[tuple[float, ...]] = (),
) -> EffectStarts:
    """Return where searches with effects begin: at each base fit the best strengths by screening, and at landings.

    Args:
        error: by whose screening cost they are compared.
        added: the parameters of the effects to be added.
        seeds: theta of base fits, the best first, with the effects switched off; the last two are the valve file's and
            the regression's.
        landed: begin at landings too; they are the same whatever the base fits.
        points: values of the added parameters; by default those that their effects declare, and the record suggests.
    """
    guesses = guessed_values(added, error.run.record, slow=error.run.by.slow)
    points = list(points) or [*strengths(added), *guesses]
    if error.run.by.slow:
        points += [tuple(_slower(each, value) for each, value in zip(added, values, strict=True)) for values in points]
    # The positions show a quantum so well that landings begin with the likeliest alone, and keep it.
    rounds = any(each.guess == "quantum" for each in added)
    solved = (rounds and guesses[:1]) or points

    def at_landings(half: Half) -> list[Place]:
        return landed_starts(error, half, seeds[-2:][:1], solved, added, LANDED_EFFECT)

    def grid(theta: Vector) -> list[Vector]:
        return [_with(error, _sticking(theta, part), added, values) for part in EXCESSES for values in points]

    halves = landed_halves(error) if landed else []
    at_first_half = [place for half in halves[:1] for place in at_landings(half)]
    at_best = [_smoothed(error, z) for z in grid(seeds[0])]
    plays = with_plays(seeds[0], added)
    of_file = [i for i in (len(seeds) - 2,) if i > 0]
    weakest = weakest_start(error, added, seeds[0])

    def at_base_fits(chosen: Iterable[int]) -> list[Place]:
        return [Place(z, f"base fit {i + 1}") for i in chosen for z in error.screened(grid(seeds[i]), EACH_SEED)]

    first = [
        *(Place(z, BEST_BASE) for z in error.screened(at_best, AT_BEST)),
        *(Place(z, BEST_BASE) for band in plays for z in error.screened(map(error.coordinates, band), 1)),
        *at_base_fits(of_file),
        # Viscous friction stands in no landing: where it is far off, a start from there is far off until it is moved.
        *moved_starts(error, at_first_half[:1], added),
    ]

    def others() -> list[Place]:
        landed = [*at_first_half[1:], *(place for half in halves[1:] for place in at_landings(half))]
        further = [i for i in range(1, len(seeds)) if i not in of_file]
        return [weakest, *at_base_fits(further), *moved_starts(error, landed, added)]

    return EffectStarts(first, [at_best[i :: len(points)] for i in range(len(points))], weakest, others)


def _slower(parameter: Parameter, value: float) -> float:
    """Return a value ten times as slow: where samples lie far apart, effects that show are slower than declared."""
    if parameter.name.endswith("_per_s"):
        value /= SLOWER
    elif parameter.name.endswith("_s"):
        value *= SLOWER
    return min(max(value, parameter.least), parameter.most)


def weakest_start(error: SimulationError, added: Sequence[Parameter], seed: Vector) -> Place:
    """Return the best base fit with the effects as weak as they may be, at whichever end of their ranges that is.

    What goes either way from nothing is weakest there, not at an end; and there stems take long to simulate.

    Args:
        error: by whose cost the ends are compared.
        added: the parameters of the effects to be added.
        seed: theta of the best base fit, with the effects switched off.
    """
    nothing = {each.name: float(seed[each.index]) for each in added if each.least < 0.0 < each.most}
    ends = [
        tuple(nothing.get(each.name, each.least) for each in added),
        tuple(nothing.get(each.name, each.most) for each in added),
    ]
    places = (error.coordinates(seed), *(_with(error, seed, added, values) for values in ends))
    return Place(min(places, key=error.cost), BEST_BASE)


class Half(NamedTuple):
    """Half of the landings, all where there are too few, from which searches begin."""

    origin: str
    chosen: Sequence[Rest]


def landed_halves(error: SimulationError) -> list[Half]:
    """Return every other rest, and those between, where there are enough for both: they share no measurement."""
    found = () if error.run.by.slow else rests(error.run.record)
    if len(found) < 2 * ENOUGH_RESTS:
        return [Half(LANDINGS, found)]
    return [Half(f"even {LANDINGS}", found[::2]), Half(f"odd {LANDINGS}", found[1::2])]


def landed_starts(
    error: SimulationError,
    half: Half,
    seeds: Sequence[Vector],
    points: Sequence[tuple[float, ...]],
    added: Sequence[Parameter],
    count: int,
) -> list[Place]:
    """Return the best starts from landings: at each strength the landings' solution, viscous friction from a grid.

    What landings do not hold is left to `moved_starts`.

    Args:
        error: by whose screening cost they are compared.
        half: of the landings.
        seeds: theta from which the landings are solved.
        points: values of the added parameters to begin with.
        added: the parameters of the effects to be added.
        count: how many at most.
    """
    if error.run.by.slow:
        return told_starts(error, seeds, points, added, count)
    landed = _landed(error, Landings(error, half.chosen), seeds, points, added)
    return [Place(z, half.origin) for z in error.screened(landed, count)]


def moved_starts(error: SimulationError, landed: Sequence[Place], added: Sequence[Parameter]) -> list[Place]:
    """Return the starts from landings with what these do not hold moved to where the simulation comes closest.

    Args:
        error: by whose cost that is judged.
        landed: as `landed_starts` returns them.
        added: the parameters of the effects to be added.
    """
    if error.run.by.slow:
        return list(landed)
    moving = [i for i, each in enumerate(error.parameters) if each.index in (VISCOUS, STATIC) or each in added]
    return [replace(each, z=_in_motion(smoothed(error.rough, each.z), each.z, moving)) for each in landed]


def told_starts(
    error: SimulationError,
    seeds: Sequence[Vector],
    points: Sequence[tuple[float, ...]],
    added: Sequence[Parameter],
    count: int,
) -> list[Place]:
    """Return the same where samples lie farther apart than slides last: each landing by itself, then static friction.

    Told which way the stem went, the model lands by the static balance whatever static friction is: no stairs, so that
    most strengths lead down to the landings' solution. Which did is told by the landings too, and by the simulation
    only once static friction is there: while that is off, the solution misses slips that a worse one happens to make.
    Where landings are all that is judged, that is the search.
    """
    if not error.run.by.held:
        return []
    run = FreeRun(error.composition, error.run.record, from_pressure=error.run.from_pressure, by=error.run.by.told())
    landing = tuple(each for each in error.parameters if each.index != STATIC)
    solved: list[tuple[float, Vector]] = []
    for theta in seeds:
        there = SimulationError(run, error.composition, landing, theta)
        if there.count < FEWEST_JUDGED:
            return []
        for values in dict.fromkeys(points):
            begin = there.coordinates(_changed(theta, added, values))
            z = descended(there, descended(there, begin, WIDE), MIDDLING)
            solved.append((there.cost(z), there.theta(z)))
    least = min((cost for cost, _ in solved), default=0.0)
    best = [theta for cost, theta in solved if cost <= AS_GOOD * least]
    loose = [
        _breaking_loose(error, z)
        for theta in best
        for z in error.screened([error.coordinates(scaled(theta, STATIC, each)) for each in STATIC_FACTORS], count)
    ]
    if loose:
        least_z = error.least(loose, MIDDLE)
        loose += [_along(error, run, least_z, each, best) for each in _not_told(best, added)]
    return [Place(z, LANDINGS) for z in _apart(error, loose, count)]


def _breaking_loose(error: SimulationError, z: Vector) -> Vector:
    """Return z with static friction moved to where the simulation comes closest."""
    return _in_motion(error, z, [i for i, each in enumerate(error.parameters) if each.index == STATIC])


def _not_told(as_good: Sequence[Vector], added: Sequence[Parameter]) -> list[Parameter]:
    """Return what the landings leave open: solutions as good as each other have it wherever they began."""
    return [each for each in added if float(np.ptp([each.coordinate(theta) for theta in as_good])) > ABOUT[-1]]


def _along(
    error: SimulationError, run: FreeRun, z: Vector, open_parameter: Parameter, as_good: Sequence[Vector]
) -> Vector:
    """Return z with what the landings leave open moved to where the simulation comes closest, the landings kept.

    A preload and an asymmetry that make up for each other land alike, and break loose elsewhere: the valley between the
    solutions that land as well is gone along from end to end, then about the best place found.
    """
    i = error.parameters.index(open_parameter)
    kept = tuple(each for each in error.parameters if each.index not in (STATIC, open_parameter.index))

    def landed(near: Vector, coordinate: float) -> Vector:
        there = near.copy()
        there[i] = np.clip(coordinate, error.lower[i], error.upper[i])
        theta = error.theta(there)
        landing = SimulationError(run, error.composition, kept, theta)
        return error.coordinates(landing.theta(descended(landing, landing.coordinates(theta), MIDDLING)))

    def least(valley: Iterable[Vector]) -> Vector:
        return error.least([z, *(_breaking_loose(error, each) for each in valley)], MIDDLE)

    ends = sorted(open_parameter.coordinate(theta) for theta in as_good)
    ahead, back = np.arange(z[i], ends[-1] + VALLEY, VALLEY), np.arange(z[i], ends[0] - VALLEY, -VALLEY)
    z = least(there for way in (ahead, back) for there in accumulate(way[1:], landed, initial=z))
    for _ in range(ALTERNATIONS):
        before = z
        z = least(landed(before, before[i] + distance) for distance in (*ABOUT, *-ABOUT))
        if np.array_equal(z, before):
            break
    return z


def _apart(error: SimulationError, pool: Sequence[Vector], count: int) -> list[Vector]:
    """Return the best of a pool, and of those as good the one farthest from it: what is not told must be seen open."""
    ranked = error.screened(pool, len(pool))
    if len(ranked) <= count:
        return ranked
    least = error.rough.cost(ranked[0], MIDDLE)
    as_good = [z for z in ranked if error.rough.cost(z, MIDDLE) <= AS_GOOD * least]
    farthest = max(as_good, key=lambda z: float(np.abs(z - ranked[0]).max()))
    others = [z for z in ranked[1:] if z is not farthest]
    return [ranked[0], farthest, *others][:count] if farthest is not ranked[0] else ranked[:count]


def _changed(theta: Vector, added: Iterable[Parameter], values: Iterable[float]) -> Vector:
    changed = theta.copy()
    for parameter, value in zip(added, values, strict=True):
        changed[parameter.index] = value
    return changed


def _landed(
    error: SimulationError,
    landings: Landings,
    seeds: Sequence[Vector],
    points: Sequence[tuple[float, ...]],
    added: Sequence[Parameter],
) -> list[Vector]:
    kept = [each.index for each in added if landings.behind_path or each.guess == "quantum"]
    found = []
    for theta in seeds:
        for values in points:
            begin = theta.copy()
            begin[[each.index for each in added]] = values
            solved = landings.solved(begin, kept)
            if solved:
                loose = broken_loose(error, landings, solved.theta)
                viscous = [scaled(loose, VISCOUS, factor) for factor in VISCOUS_FACTORS]
                found += [_smoothed(error, z) for z in error.screened(map(error.coordinates, viscous), 1)]
    return found


def _smoothed(error: SimulationError, z: Vector) -> Vector:
    """Return z, or where a sensor rounds, all but the quantum moved to where the positions before lie inside it."""
    smooth = smoothed(error.rough, z)
    return z if smooth is error.rough else descended(smooth, z, MIDDLING)


def _in_motion(error: SimulationError, z: Vector, moving: Sequence[int]) -> Vector:
    """Return z with what the landings do not hold moved to where the simulation comes closest, all else kept."""
    for _ in range(ALTERNATIONS):
        before = z
        for i in moving:
            z = scanned(error, z, i, ABOUT, MIDDLE)
        if np.array_equal(z, before):
            break
    return z


def scaled(theta: Vector, index: int, factor: float) -> Vector:
    """Return a parameter vector with one of its parameters multiplied."""
    changed = theta.copy()
    changed[index] *= factor
    return changed


def _sticking(theta: Vector, part: float) -> Vector:
    """Leave only a part of what static friction has above Coulomb's."""
    changed = theta.copy()
    changed[STATIC] = theta[COULOMB] + part * (theta[STATIC] - theta[COULOMB])
    return changed


def _with(error: SimulationError, theta: Vector, added: Iterable[Parameter], values: Iterable[float]) -> Vector:
    return error.coordinates(_changed(theta, added, values))


def forces_regressed(theta: Vector, record: Record, valve: ValveParameters, from_pressure: bool) -> Vector:
    """Return theta with k_s, F_v and F_c from the regression where it gives positive ones, F_s in proportion."""
    by = sampling(record, valve)
    if by.slow or record.period_s > slide_time_s(valve, record.scale_m):
        return _landings_regressed(theta, record, valve, by)
    regressed = theta.copy()
    matrix, force_n = _moving(theta[AREA], record, from_pressure)
    if len(force_n) < ENOUGH_MOVING:
        return regressed
    first = 0 if theta[SPRING] else 1
    found = np.linalg.lstsq(matrix[:, first:], force_n)[0].tolist()
    for index, value in zip((SPRING, VISCOUS, COULOMB)[first:], found, strict=True):
        if value > 0.0:
            regressed[index] = value
    regressed[STATIC] = regressed[COULOMB] * max(1.0, theta[STATIC] / theta[COULOMB]) if theta[COULOMB] else 0.0
    return regressed


def _landings_regressed(theta: Vector, record: Record, valve: ValveParameters, by: Sampling) -> Vector:
    """Return theta with k_s and F_c from the bare balance of the settled landings, least squares thrice reweighed."""
    regressed = theta.copy()
    landed = [each for each, settled in landings(record, valve) if settled]
    if len(landed) < ENOUGH_LANDINGS:
        return regressed
    rows = np.array([max(each.first - by.held, 0) for each in landed])
    matrix = np.array([(each.position_m, float(each.direction)) for each in landed])
    force_n = theta[AREA] * record.command_pa[rows]
    if record.load_n is not None:
        force_n = force_n + record.load_n[rows]
    weights = np.ones(rows.size)
    for _ in range(REWEIGHED):
        found = np.linalg.lstsq(weights[:, None] * matrix, weights * force_n)[0]
        left = np.abs(force_n - matrix @ found)
        weights = (1.0 + (left / max(float(np.median(left)), np.finfo(float).tiny)) ** 2) ** -0.25
    if (found > 0.0).all():
        regressed[[SPRING, COULOMB]] = found
        regressed[STATIC] = found[1] * max(1.0, theta[STATIC] / theta[COULOMB]) if theta[COULOMB] else found[1]
    return regressed


def _moving(area_m2: float, record: Record, from_pressure: bool) -> tuple[Vector, Vector]:
    """Return the regressors (moving samples, 3) and the force, N, of the moving samples of all segments."""
    drive = record.pressure_pa if from_pressure and record.pressure_pa is not None else record.command_pa
    rows, forces = [], []
    for first, end in record.segments:
        x = np.where(record.valid, record.position_m, np.nan)[first:end]
        v = velocity_m_per_s(record.time_s[first:end], x)
        way = directions(x, record.scale_m)
        force_n = area_m2 * drive[first:end]
        if not from_pressure:
            force_n[1:] = 0.5 * (force_n[1:] + force_n[:-1])
        if record.load_n is not None:
            force_n = force_n + record.load_n[first:end]
        moving = (way != 0) & np.isfinite(x) & np.isfinite(v)
        rows.append(np.column_stack([x, v, way])[moving])
        forces.append(force_n[moving])
    return np.concatenate(rows), np.concatenate(forces)


def with_plays(theta: Vector, added: Sequence[Parameter]) -> list[list[Vector]]:
    """Return theta with narrow, middling and wide plays that friction has stood in for, in all or in part.

    Empty if no play is among the parameters added, or there is no spring that tells how wide it may be.
    """
    if not theta[SPRING]:
        return []
    widest_m = 2.0 * theta[COULOMB] / theta[SPRING]
    widths_m = np.geomspace(NARROWEST * widest_m, WIDEST * widest_m, 3 * PLAYS).reshape(3, PLAYS).tolist()
    return [
        [_with_play(theta, play, width_m, part) for width_m in band for part in STATIC_SHIFTS]
        for play in added
        if play.name == PLAY
        for band in widths_m
    ]


def _with_play(theta: Vector, play: Parameter, width_m: float, part: float) -> Vector:
    changed = theta.copy()
    shift_n = 0.5 * theta[SPRING] * width_m
    changed[play.index] = width_m
    changed[COULOMB] -= shift_n
    changed[STATIC] += part * shift_n
    return changed


def _drawn(theta: Vector, count: int, generator: np.random.Generator) -> list[Vector]:
    """Return draws round a parameter vector."""
    draws = []
    for _ in range(count):
        draw = theta.copy()
        for index, spread in SPREAD.items():
            draw[index] *= np.exp(spread * generator.standard_normal())
        draw[STATIC] = draw[COULOMB] * np.exp(generator.uniform(*STATIC_RATIO))
        draws.append(draw)
    return draws
