"""Where searches begin: for the bare valve, and with an effect added.

The bare valve begins at the valve file's values, at a regression of forces over the moving samples, and at draws round
both. An effect begins at no strength, so that the extended valve is never worse than the base it extends, and on a grid
of strengths at the best base fits; what the record's positions suggest is in `seen`.

    A p + load = k_s x + F_v v + F_c sign(v)      least squares over the moving samples, m v' neglected
    z_b(q) = z_b - J^+ r(q)                       base parameters for a strength q of the effect, which must make up for
                                                  it: J = dr/dz_b without the effect, r with it
"""

from collections.abc import Iterable, Sequence

import numpy as np

from sim.composition import AREA, BASE, COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.data.motion import directions, velocity_m_per_s
from workbench.data.record import Record
from workbench.fit.guesses import values_seen
from workbench.fit.objective import LONGEST_MOVE, WIDE, SimulationError, root_weights
from workbench.model.parameters import Parameter, strengths

SPREAD = {SPRING: 0.1, VISCOUS: 0.7, COULOMB: 0.3}
"""Standard deviation of the draws, of the logarithm."""
STATIC_RATIO = (0.0, 0.4)
"""Range of the draws of log(F_s / F_c)."""
DRAWS_REGRESSED, DRAWS_FILE, DRAWS_EFFECT = 40, 12, 150
ENOUGH_MOVING = 20
EXCESSES = (1.0, 0.5, 0.1)
"""Of F_s - F_c of a base fit, with which strengths are tried: what the base took for it may be the effect."""
EACH_SEEDS, COMPENSATED = 2, 5
"""Strengths begun at each base fit, and with base parameters that make up for them; other searches begin at draws."""
PLAY = "backlash.width_m"
NARROWEST, WIDEST, PLAYS = 6e-3, 0.9, 5
"""Of the dead band 2 F_c / k_s, beyond which a play leaves no friction; widths in each of three bands."""
STATIC_SHIFTS = (1.0, 0.0, -1.0)


def base_starts(error: SimulationError, origins: Sequence[Vector], seed: int, count: int) -> list[Vector]:
    """Return coordinates: of the origins and draws round both the best by the screening cost.

    Args:
        error: by whose screening cost they are compared.
        origins: theta of the valve file, and that of the regression.
        seed: of the draws.
        count: how many.
    """
    generator = np.random.default_rng(seed)
    theta, regressed = origins
    pool = [theta, regressed, *_drawn(regressed, DRAWS_REGRESSED, generator), *_drawn(theta, DRAWS_FILE, generator)]
    return error.screened(map(error.coordinates, pool), count)


def effect_starts(
    error: SimulationError, added: Sequence[Parameter], seeds: Sequence[Vector], count: int
) -> list[Vector]:
    """Return coordinates: the base as it is, and at each of its seeds the best strengths by the screening cost.

    Args:
        error: by whose screening cost they are compared.
        added: the parameters of the effects to be added.
        seeds: theta of base fits, the best first, with the effects switched off.
        count: how many but for the base as it is.
    """
    ends = [tuple(each.least for each in added), tuple(each.most for each in added)]
    switched_off = error.coordinates(seeds[0])
    weakest = min((switched_off, *(_with(error, seeds[0], added, values) for values in ends)), key=error.cost)
    points = [*strengths(added), *values_seen(added, error.run.record)]
    grids = [
        [_with(error, _sticking(theta, part), added, values) for part in EXCESSES for values in points]
        for theta in seeds
    ]
    chosen = [z for grid in grids for z in error.screened(grid, EACH_SEEDS)]
    strong = [_with(error, seeds[0], added, values) for values in points]
    chosen += error.screened(_compensated(error, switched_off, strong), COMPENSATED)
    for band in with_plays(seeds[0], added):
        chosen += error.screened(map(error.coordinates, band), 1)
    between = _between(error, seeds[0], added)
    return [weakest, *chosen, *error.screened(between, count - len(chosen))]


def _compensated(error: SimulationError, base: Vector, grid: Sequence[Vector]) -> list[Vector]:
    """Return the strengths with the base's parameters moved by one Gauss-Newton step to make up for each.

    Static friction stays: its derivatives are a staircase's, a slip more or less.
    """
    rough = error.rough
    own = [i for i, each in enumerate(error.parameters) if each.index < len(BASE) and each.index != STATIC]
    J = rough.jacobian(base, rough.residuals(base), WIDE.difference)[:, own]
    compensated = []
    for z in grid:
        residuals = rough.residuals(z)
        weights = root_weights(residuals, WIDE.scale)
        move = np.linalg.lstsq(weights[:, None] * J, -weights * residuals)[0]
        there = z.copy()
        there[own] += np.clip(move, -LONGEST_MOVE, LONGEST_MOVE)
        compensated.append(np.clip(there, error.lower, error.upper))
    return compensated


def _between(error: SimulationError, theta: Vector, added: Sequence[Parameter]) -> list[Vector]:
    """Return draws between an effect's outermost strengths, with any part of the static friction."""
    generator = np.random.default_rng(0)
    corners = [error.coordinates(each) for each in (_sticking(theta, 0.0), theta)]
    pool = []
    for _ in range(DRAWS_EFFECT):
        z = corners[0] + generator.uniform() * (corners[1] - corners[0])
        for i, parameter in enumerate(error.parameters):
            if parameter in added:
                low, high = (_coordinate(parameter, theta, end(parameter.starts)) for end in (min, max))
                z[i] = generator.uniform(low, high)
        pool.append(z)
    return pool


def _coordinate(parameter: Parameter, theta: Vector, value: float) -> float:
    changed = theta.copy()
    changed[parameter.index] = value
    return parameter.coordinate(changed)


def _sticking(theta: Vector, part: float) -> Vector:
    """Leave only a part of what static friction has above Coulomb's."""
    changed = theta.copy()
    changed[STATIC] = theta[COULOMB] + part * (theta[STATIC] - theta[COULOMB])
    return changed


def _with(error: SimulationError, theta: Vector, added: Iterable[Parameter], values: Iterable[float]) -> Vector:
    changed = theta.copy()
    for parameter, value in zip(added, values, strict=True):
        changed[parameter.index] = value
    return error.coordinates(changed)


def forces_regressed(theta: Vector, record: Record, from_pressure: bool) -> Vector:
    """Return theta with k_s, F_v and F_c from the regression where it gives positive ones, F_s in proportion."""
    regressed = theta.copy()
    matrix, force_n = _moving(theta[AREA], record, from_pressure)
    if len(force_n) < ENOUGH_MOVING:
        return regressed
    for index, value in zip((SPRING, VISCOUS, COULOMB), np.linalg.lstsq(matrix, force_n)[0].tolist(), strict=True):
        if value > 0.0:
            regressed[index] = value
    regressed[STATIC] = regressed[COULOMB] * max(1.0, theta[STATIC] / theta[COULOMB]) if theta[COULOMB] else 0.0
    return regressed


def _moving(area_m2: float, record: Record, from_pressure: bool) -> tuple[Vector, Vector]:
    """Return the regressors (moving samples, 3) and the force, N, of the moving samples of all segments."""
    drive = record.pressure_pa if from_pressure and record.pressure_pa is not None else record.command_pa
    rows, forces = [], []
    for first, end in record.segments:
        x = np.where(record.judged, record.position_m, np.nan)[first:end]
        v = velocity_m_per_s(record.time_s[first:end], x)
        way = directions(x, record.noise_m)
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

    Empty if no play is among the parameters added.
    """
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
