"""How well the noise of a recording is found: `python -m benchmarks.noise [CASES]`.

Simulated valves of low friction that ramp to somewhere and rest there, in legs of 5 to 40 samples and 0.2 s; `moving`
is the share of a leg that the command ramps. The sensor has 10 to 16 bits over the stroke, with white noise before
rounding. The truth is what a reading is off by, sqrt(σ_w^2 + q^2/12). The second table has sensors that round first,
with the noise of the wire after: that rounding repeats and is no noise, the truth is σ_w. A cell: how many of the
estimates lie within 20 % of it, how many of all are unknown, and the least and greatest ratio of estimate and truth.
"""

import sys
from collections.abc import Iterator, Sequence

import numpy as np

from config.valve_file import ValveFile, ValveParameters, load_valve, shipped_valve
from signals.noise import Array, position_noise_m
from sim.composition import Composition
from sim.open_loop import respond

PERIODS_S = (1e-3, 1e-2, 0.1, 1.0, 10.0)
MOVING = (0.0, 0.25, 0.5, 0.75, 1.0)
SENSORS = ((10, 0.0), (10, 0.5), (12, 0.4), (14, 1.0), (16, 0.5), (16, 8.0))
"""Bits over the stroke, and the white noise in quanta."""
ROUND_FIRST = ((10, 0.1), (10, 0.2), (10, 0.3), (10, 0.5))
"""The same of sensors that round before the noise."""
WITHIN = 0.2
SAMPLES = 3000
SETTLES_S = 0.2
"""What each leg is longer by: the stem swings for some tenths of a second after it was driven."""
SEED = load_valve(shipped_valve("seed")).valve
VALVE = ValveFile(valve=ValveParameters.model_validate(SEED.model_dump() | {"coulomb_n": 100.0, "static_n": 115.0}))
STEP_S = 0.05


def commands(period_s: float, moving: float, generator: np.random.Generator) -> Array:
    """Return the pressures, Pa, of ramps and rests, (SAMPLES,)."""
    middle_pa = 0.5 * SEED.spring_n_per_m * SEED.stroke_m / SEED.diaphragm_area_m2
    command_pa = np.full(SAMPLES, middle_pa)
    done, last_pa = 0, middle_pa
    while moving and done < SAMPLES:
        leg = min(int(generator.integers(5, 41)) + round(SETTLES_S / period_s), SAMPLES - done)
        target_pa = middle_pa * generator.uniform(0.2, 1.8)
        ramp = max(1, round(moving * leg))
        command_pa[done : done + leg] = target_pa
        command_pa[done : done + ramp] = np.linspace(last_pa, target_pa, ramp + 1)[1:]
        done, last_pa = done + leg, target_pa
    return command_pa


def ratio(
    period_s: float, moving: float, bits: int, quanta: float, seed: int, *, rounds_first: bool = False
) -> float | None:
    """Return the estimate over the truth; None where it is unknown."""
    generator = np.random.default_rng([seed, bits])
    command_pa = commands(period_s, moving, generator)
    composition = Composition.from_file(VALVE)
    middle_m = 0.5 * SEED.stroke_m
    position_m = respond(
        composition,
        composition.theta,
        command_pa[:-1],
        period_s,
        position_m=middle_m,
        pressure_pa=float(command_pa[0]),
        step_s=min(period_s, STEP_S),
    ).indicated_m
    quantum_m = SEED.stroke_m / 2**bits
    white_m = quanta * quantum_m * generator.standard_normal(SAMPLES)
    if rounds_first:
        found = position_noise_m(np.round(position_m / quantum_m) * quantum_m + white_m, command_pa)
        return None if found is None else found / (quantum_m * quanta)
    found = position_noise_m(np.round((position_m + white_m) / quantum_m) * quantum_m, command_pa)
    return None if found is None else found / (quantum_m * (quanta**2 + 1.0 / 12.0) ** 0.5)


def table(cases: int, sensors: Sequence[tuple[int, float]], *, rounds_first: bool = False) -> Iterator[str]:
    """Yield the table, a row a sampling period."""
    yield "period    " + "".join(f"{f'moving {100 * moving:.0f} %':>24}" for moving in MOVING)
    for period_s in PERIODS_S:
        cells = []
        for moving in MOVING:
            found = [
                ratio(period_s, moving, bits, quanta, seed, rounds_first=rounds_first)
                for bits, quanta in sensors
                for seed in range(cases)
            ]
            known = [each for each in found if each is not None]
            within = sum(abs(each - 1.0) < WITHIN for each in known)
            ends = f" {min(known):.2f}-{max(known):.2f}" if known else ""
            cells.append(f"{within}+{len(found) - len(known)}/{len(found)}{ends}")
        yield f"{period_s:g} s".ljust(10) + "".join(f"{each:>24}" for each in cells)


if __name__ == "__main__":
    print("within 20 %, + unknown, / all; least and greatest ratio to the truth")
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    print(*table(cases, SENSORS), sep="\n")
    print("rounded before the noise")
    print(*table(cases, ROUND_FIRST, rounds_first=True), sep="\n")
