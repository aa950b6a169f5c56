"""Benches that impose the position, with a known answer."""

import numpy as np

from config.recording import Column, Recording
from tests.workbench.valves import SEED

AREA_M2, COULOMB_N, SPRING_N_PER_M, VISCOUS_NS_PER_M, WEIGHT_N = 0.01, 60.0, 3e3, 200.0, -25.0
VALVE = SEED.model_copy(
    update={"valve": SEED.valve.model_copy(update={"stroke_m": 0.1, "diaphragm_area_m2": 0.011, "mass_kg": 0.5})}
)


def bench(
    level_pa: float,
    seed: int,
    *,
    mu: float = 0.0,
    growth_n: float = 0.0,
    exponent: float = 1.0,
    excess_n: float = 0.0,
    yield_m: float = 0.0,
    viscous_ns_per_m: float = VISCOUS_NS_PER_M,
    extra_ns_per_m: float = 0.0,
    period_s: float = 0.02,
) -> Recording:
    """A rig pulls the stem up and down, each stroke at its own speed, at a pressure that swings by a fifth.

    The longer the period, the more the rows at reversals are off, which count for one direction or the other.
    """
    generator = np.random.default_rng(seed)
    corners_m = 0.05 + 0.045 * np.where(np.arange(13) % 2, 1.0, -1.0) * generator.uniform(0.7, 1.0, 13)
    at_s = np.cumsum([0.0, *np.exp(generator.uniform(np.log(1.5), np.log(15.0), 12))])
    time_s: Column = period_s * np.arange(round(at_s[-1] / period_s))
    position_m = np.interp(time_s, at_s, corners_m)
    velocity = np.gradient(position_m, time_s)
    direction = np.sign(velocity)
    if yield_m:
        shown = direction[0]
        for i in range(1, direction.size):
            shown = np.clip(shown + (position_m[i] - position_m[i - 1]) / yield_m, -1.0, 1.0)
            direction[i] = shown
    pressure_pa = level_pa * (1.0 + 0.2 * np.sin(0.7 * time_s))
    level_n = (
        COULOMB_N
        + mu * pressure_pa
        + growth_n * (pressure_pa / 1e5) ** exponent
        + excess_n * np.exp(-((velocity / 0.008) ** 2))
    )
    load_n = (
        -AREA_M2 * pressure_pa
        + SPRING_N_PER_M * position_m
        + viscous_ns_per_m * velocity
        + abs(extra_ns_per_m) * np.where(extra_ns_per_m * velocity > 0.0, velocity, 0.0)
        + level_n * direction
        + WEIGHT_N
        + 1.5 * generator.standard_normal(time_s.size)
    )
    return Recording(
        {
            "time_s": time_s,
            "pressure_pa": pressure_pa,
            "position_m": position_m + 2e-5 * generator.standard_normal(time_s.size),
            "load_n": load_n,
        }
    )


def benches(seed: int, **hidden: float) -> list[Recording]:
    """Three pressures of one bench."""
    return [bench(level_pa, seed + i, **hidden) for i, level_pa in enumerate((5e4, 1e5, 2e5))]
