"""The daemon on a device that is not ours: another library's server, another friction model, a clock of its own.

    python -m benchmarks.other_device [--periods-ms 20 100] [--steps 20] [--lag-s 0.04] [--viscous-ns-per-m 1300]
                                      [--asymmetry 0] [--bits 12] [--register-pa 100] [--seed 0]

The device is that of `tests/other_device.py`: a preload, no time stamp, no counter, no function 23; a position of 12
bits, pressure and command in whole mbar, or as fine as 16 bits are (`--bits 16 --register-pa 10`). The daemon is a
process; the DCS writes eta = 0, 0, 0 and nothing about the valve, then steps of 0.5 to 10 % of the stroke. A move
has ended when the daemon has taken the reference, and the command has stood for 60 of its cycles; so a busy machine
makes moves longer, and ends none. Its time is until the stem is within 0.1 % of where it ends, for good. Errors are of
the true stem, % of stroke; a step has landed within 0.1 % or a quantum, whichever is more.
All in real time: 200 steps take five minutes at 20 ms, and a quarter of an hour at 100 ms.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from tests.other_device import MBAR_PA, Parameters, Registers, other_device
from tests.other_site import LAW, Move, identified_at, moved

LANDED = 1e-3
"""Of the stroke, or a quantum."""
LOWEST, HIGHEST = 0.15, 0.85
SMALLEST, LARGEST = 0.005, 0.1
IDENTIFIED_WITHIN_S = 600.0


def references(steps: int, seed: int) -> Iterator[float]:
    """Yield references, p.u."""
    rng = np.random.default_rng(seed)
    at = 0.5
    for _ in range(steps):
        way = rng.uniform(SMALLEST, LARGEST) * rng.choice((-1, 1))
        at += way if LOWEST <= at + way <= HIGHEST else -way
        yield float(at)


def report(period_s: float, steps: int, parameters: Parameters, registers: Registers, seed: int) -> Iterator[str]:
    """Yield lines: what was identified against the truth, and how the steps went."""
    with other_device(0.4 * parameters.stroke_m, parameters, registers) as device:
        began_s = time.monotonic()
        with identified_at(device, period_s, IDENTIFIED_WITHIN_S) as dcs:
            found = dcs.get_all(*(f"{name}_{what}" for name in LAW for what in ("e", "std")), "landings")
            took_s = time.monotonic() - began_s
            yield f"{1e3 * period_s:g} ms: identified in {took_s:.0f} s from {found['landings']:.0f} landings"
            for name, true in zip(LAW, parameters.static_law, strict=True):
                value, std = found[f"{name}_e"], found[f"{name}_std"]
                off = 100 * (value / true - 1)
                yield f"    {name:12} {value:12.6g}  true {true:12.6g}  {off:+6.2f} %  deviation {std:8.3g}"
            moves = [moved(device, dcs, each) for each in references(steps, seed)]
    yield f"    {steps} steps: {said(moves, max(LANDED, 1 / registers.counts))}"


def said(moves: Sequence[Move], landed: float) -> str:
    """Say how moves went, and how many landed within a share of the stroke."""
    error = 100 * np.abs([each.error for each in moves])
    duration_s = np.array([each.duration_s for each in moves])
    slides = np.mean([each.slides for each in moves])
    return (
        f"{100 * np.mean(error <= 100 * landed):.1f} % landed within {100 * landed:.3f} %, "
        f"rms {np.sqrt(np.mean(error**2)):.3f} %, worst {error.max():.3f} %; "
        f"time per move {np.median(duration_s):.2f} s, at most {duration_s.max():.2f} s; "
        f"{slides:.1f} slides a move"
    )


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--periods-ms", type=float, nargs="+", default=[20.0, 100.0])
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--lag-s", type=float, default=Parameters().lag_s, help="of the I/P (0.04)")
    parser.add_argument(
        "--viscous-ns-per-m", type=float, default=Parameters().viscous_ns_per_m, help="of the stem (1300)"
    )
    parser.add_argument("--asymmetry", type=float, default=0.0, help="of the friction, more of it upward")
    parser.add_argument("--bits", type=int, default=12, help="of the position (12)")
    parser.add_argument("--register-pa", type=float, default=MBAR_PA, help="of pressure and command (100)")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    parameters = replace(
        Parameters(),
        lag_s=arguments.lag_s,
        viscous_ns_per_m=arguments.viscous_ns_per_m,
        asymmetry=arguments.asymmetry,
    )
    registers = Registers(2**arguments.bits, arguments.register_pa)
    for period_ms in arguments.periods_ms:
        for line in report(1e-3 * period_ms, arguments.steps, parameters, registers, arguments.seed):
            print(line, flush=True)


if __name__ == "__main__":
    main()
