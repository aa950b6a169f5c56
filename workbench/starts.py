"""Where a search begins: the valve file's values, a regression of forces over the moving samples, and draws round both.

A p + load = k_s x + F_v v + F_c sign(v)      least squares over the moving samples, m v' neglected
"""

import numpy as np

from sim.composition import BASE
from sim.karnopp import Vector
from workbench.motion import directions, velocity_m_per_s
from workbench.record import Record

AREA, SPRING, VISCOUS, COULOMB, STATIC = (
    BASE.index(name) for name in ("diaphragm_area_m2", "spring_n_per_m", "viscous_ns_per_m", "coulomb_n", "static_n")
)
SPREAD = {SPRING: 0.1, VISCOUS: 0.7, COULOMB: 0.3}
"""Standard deviation of the draws, of the logarithm."""
STATIC_RATIO = (0.0, 0.4)
"""Range of the draws of log(F_s / F_c)."""
ENOUGH_MOVING = 20


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
