"""Ramps: how near does a law come to what a stem can do that only moves by jumps?

    python -m benchmarks.ramps [--periods-ms 10 20 100] [--rates 0.05 0.2 0.5 1 2 5] [--laws slides] [--seed 0]

A stem that breaks loose only where it is sent d = (F_s - F_c)/k_s follows a ramp by jumps of d. At best it is d/2 ahead
after each and d/2 behind before the next:

    rms >= d/sqrt(12)        5.33 mm of 101.6 mm: 1.51 % of stroke for the seed's valve

Each ramp goes up by 30 % of stroke and down again, and is written every 0.1 s. The valve is that of
`benchmarks.what_a_valve_needs`, bare, identified and moved 20 times before. Printed is the rms error of the true stem,
as a multiple of the bound, and the travel of the stem over that of the reference.
"""

import argparse

import numpy as np

from benchmarks.what_a_valve_needs import SEED, STROKE_M, Loop, asked, valve_of

BOUND = (SEED.static_n - SEED.coulomb_n) / SEED.spring_n_per_m / STROKE_M / np.sqrt(12)
"""Of the stroke."""
FROM, WAY = 0.45, 0.3
WRITTEN_S = 0.1
PRACTISED, PRACTICE_S = 20, 4.0


def followed(loop: Loop, rate: float) -> tuple[float, float]:
    """Return rms error over the bound and travel over the reference's, of a ramp up and down, strokes a second."""
    up = FROM + np.arange(0.0, WAY, rate * WRITTEN_S)
    references = np.concatenate((up, up[::-1]))
    loop.path(FROM, 10.0)
    parts = [loop.path(float(each), WRITTEN_S) for each in references]
    error = np.concatenate([part - each for part, each in zip(parts, references, strict=True)])
    travel = float(np.abs(np.diff(np.concatenate(parts))).sum())
    return float(np.sqrt(np.mean(error**2))) / BOUND, travel / (2 * WAY)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--periods-ms", type=float, nargs="+", default=[10.0, 20.0, 100.0])
    parser.add_argument("--rates", type=float, nargs="+", default=[0.05, 0.2, 0.5, 1.0, 2.0, 5.0], help="%%/s")
    parser.add_argument("--laws", nargs="+", default=["slides", "conventional"])
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print(f"d/sqrt(12) = {100 * BOUND:.2f} % of stroke; rms error over it, travel over the reference's, at a rate of")
    print(f"{'':24}" + "".join(f"{f'{each:g} %/s':>16}" for each in arguments.rates))
    for period_ms in arguments.periods_ms:
        for law in arguments.laws:
            loop = Loop(valve_of("bare"), law, 1e-3 * period_ms, arguments.seed)
            for reference in asked(PRACTISED, arguments.seed + 1):
                loop.path(reference, PRACTICE_S)
            found = [followed(loop, 0.01 * each) for each in arguments.rates]
            print(f"{period_ms:6g} ms {law:>14} " + "".join(f"{rms:9.2f}{way:7.2f}" for rms, way in found), flush=True)


if __name__ == "__main__":
    main()
