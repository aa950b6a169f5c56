"""Where a search begins: the valve file's values, a regression of forces over the moving samples, and draws round both.

A p + load = k_s x + F_v v + F_c sign(v)      least squares over the moving samples, m v' neglected
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from config.recording import Column
from sim.composition import AREA, COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.motion import directions, velocity_m_per_s
from workbench.parameters import Parameter
from workbench.record import Record

SPREAD = {SPRING: 0.1, VISCOUS: 0.7, COULOMB: 0.3}
"""Standard deviation of the draws, of the logarithm."""
STATIC_RATIO = (0.0, 0.4)
"""Range of the draws of log(F_s / F_c)."""
ENOUGH_MOVING = 20
PLAY = "backlash.width_m"
NARROWEST, WIDEST, PLAYS = 6e-3, 0.9, 5
"""Of the dead band 2 F_c / k_s, beyond which a play leaves no friction; widths in each of three bands."""
STATIC_SHIFTS = (1.0, 0.0, -1.0)
ENDS, INSIDE, ASIDE = (0.002, 0.998), (1.0, 4.0, 16.0), 0.1
"""Quantiles of the positions at their ends; how far inside these, in noises; how far outside, of what is swept."""
LEAST_REST, FEWEST_RESTS = 8, 6
LIKELY_QUANTA = 8
FINEST, COARSEST = 3.0, 8.0
"""A quantum is sought from so many noises to the swept positions divided by so many."""
PER_LOBE = 8.0


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


def values_seen(added: Sequence[Parameter], record: Record) -> list[tuple[float, ...]]:
    """Return values of the parameters that the positions suggest, for an effect that declares what of them it may be.

    Just inside their lowest or highest, or both; and the quanta to which they look rounded. Empty if none is declared.
    """
    kinds = {each.seen for each in added}
    suggested: list[dict[str, float]] = []
    if kinds & {"lowest", "swept"}:
        suggested += _ends_seen(record.position_m[record.judged], record.noise_m)
    if "quantum" in kinds:
        suggested += [{"quantum": each} for each in quanta_seen_m(record)]
    return [
        tuple(seen.get(each.seen, each.starts[0] if each.starts else each.least) for each in added)
        for seen in suggested
    ]


def _ends_seen(position_m: Column, noise_m: float) -> list[dict[str, float]]:
    lowest, highest = np.quantile(position_m, ENDS).tolist()
    aside = ASIDE * (highest - lowest)
    return [
        {"lowest": lowest + low, "swept": highest - high - (lowest + low)}
        for inside in (inside * noise_m for inside in INSIDE)
        for low, high in ((inside, inside), (inside, -aside), (-aside, inside))
    ]


def quanta_seen_m(record: Record) -> list[float]:
    """Return the steps, m, of which the places of rest look most to be multiples, the likeliest first.

    S(q) = |sum exp(2 pi i x_j / q)|, x_j mean position of the j-th rest: the noise is averaged away there.
    """
    places_m = _rests_m(record)
    if places_m.size < FEWEST_RESTS:
        return []
    swept_m = float(np.ptp(places_m))
    frequency = np.arange(COARSEST / swept_m, 1.0 / (FINEST * record.noise_m), 1.0 / (PER_LOBE * swept_m))
    height = np.abs(np.exp(2j * np.pi * np.outer(frequency, places_m)).sum(axis=1))
    peaks = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]))
    likeliest = peaks[np.argsort(-height[peaks])[:LIKELY_QUANTA]]
    return [float(each) for each in 1.0 / frequency[likeliest]]


def _rests_m(record: Record) -> Column:
    """Return the mean position of each rest long enough."""
    means = []
    for first, end in record.segments:
        position_m = np.where(record.judged, record.position_m, np.nan)[first:end]
        way = directions(position_m, record.noise_m)
        edges = [0, *(1 + np.flatnonzero(np.diff(way != 0))).tolist(), way.size]
        for begin, over in pairwise(edges):
            if way[begin] == 0 and over - begin >= LEAST_REST:
                means.append(float(np.nanmean(position_m[begin:over])))
    return np.array(means)


def drawn(theta: Vector, count: int, generator: np.random.Generator) -> list[Vector]:
    """Return draws round a parameter vector."""
    draws = []
    for _ in range(count):
        draw = theta.copy()
        for index, spread in SPREAD.items():
            draw[index] *= np.exp(spread * generator.standard_normal())
        draw[STATIC] = draw[COULOMB] * np.exp(generator.uniform(*STATIC_RATIO))
        draws.append(draw)
    return draws
