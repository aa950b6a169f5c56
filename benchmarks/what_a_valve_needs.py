"""Slides against PI, each where the other is at its best: does the law notice what the valve needs?

    python -m benchmarks.what_a_valve_needs [--steps 60] [--period-ms 20] [--seed 0] [--laws slides conventional]
    python -m benchmarks.what_a_valve_needs --slow-ramp

The seed's valve with one property at a time, on a device that samples by a clock of its own, `DEVICE_S`, 14 bits,
noise of half a quantum. Nothing is told but stroke and pressure limits: S3 is the staircase, under either law. Steps of
0.1 to 10 % of stroke, even in the logarithm, `STEP_S` each. Figures are of the true stem, % of stroke: its error at the
end, the share of steps that end within 0.1 and 0.25 %, how far it was beyond the way between the two references, its
travel over that of the references, and when it was last farther than 0.1 % off where it ends, s.

`--slow-ramp` asks for 0.12 % of stroke in 120 s, written so often, and prints what that costs in strokes.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.control.requests import QUIET, Requests
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed")).valve
STROKE_M = SEED.stroke_m
STEP_S = 10.0
DEVICE_S = 0.007
"""Of no whole ratio to the periods of the loop."""
QUANTUM = 1.0 / 2**14
LOWEST, HIGHEST, ABOVE_LOWEST = 0.4, 0.85, 0.02
"""Of the stroke; the last from where a slide down lands under no pressure, below which no stem can be sent."""
SMALLEST, LARGEST = 1e-3, 0.1
ENDED = 1e-3
SMOOTH = 1.05
"""F_s/F_c of a packing that hardly sticks, as of PTFE."""
S3_LIMIT_S = 1800.0
RAMP, RAMP_S = 1.2e-3, 120.0
WRITTEN_S = (0.1, 1.0, 5.0, 20.0)

CASES: dict[str, tuple[dict[str, object], ...]] = {
    "bare": (),
    "preload and asymmetry": (
        {"name": "preload", "force_n": 600.0},
        {"name": "asymmetric_friction", "asymmetry": 0.15},
    ),
    "soft packing": ({"name": "presliding", "stiffness_n_per_m": 1.5e6},),
    "soft, smooth packing": ({"name": "presliding", "stiffness_n_per_m": 1.5e6},),
    "I/P lag 0.3 s": ({"name": "ip_lag", "time_constant_s": 0.3},),
    "play 0.5 %": ({"name": "backlash", "width_m": 5e-3 * STROKE_M},),
    "double friction": (),
}


def valve_of(case: str) -> ValveFile:
    """Return the valve of a case."""
    valve = SEED.model_dump()
    if case == "double friction":
        valve |= {name: 2.0 * valve[name] for name in ("coulomb_n", "static_n")}
    if case == "soft, smooth packing":
        valve["static_n"] = SMOOTH * valve["coulomb_n"]
    return ValveFile.model_validate({"valve": valve, "effect": CASES[case]})


def lowest_of(valve: ValveFile) -> float:
    """Return the lowest reference, of the stroke."""
    lands = (valve.valve.coulomb_n / valve.valve.spring_n_per_m) / valve.valve.stroke_m
    return max(LOWEST, lands + ABOVE_LOWEST)


class OwnClock:
    """A simulated device that is asked when it has not just sampled: it shows what it sampled last."""

    status = 0

    def __init__(self, device: Device, period_s: float) -> None:
        self._device, self._period_s = device, period_s
        self.sample_counter, self._ticks = 0, 0
        self.position_m, self.pressure_pa, self.command_pa = device.position_m, device.pressure_pa, device.command_pa

    @property
    def device_time_us(self) -> int:
        return round(1e6 * self._period_s * self.sample_counter)

    def tick(self, command_pa: float) -> None:
        self._device.check(command_pa)
        self.sample_counter += 1
        while (self._ticks + 1) * DEVICE_S <= self.sample_counter * self._period_s:
            self._device.tick(self.command_pa)
            self._ticks += 1
        self.command_pa = command_pa
        self.position_m, self.pressure_pa = self._device.position_m, self._device.pressure_pa


class Loop:
    """A valve under a law, identified."""

    def __init__(self, valve: ValveFile, law: str, period_s: float, seed: int) -> None:
        file = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "cycle": {"pace": "device", "period_s": period_s},
                "safety": {"stale_after_s": 5 * max(period_s, DEVICE_S)},
                "control": {"law": law},
                "excitation": {"kind": "staircase", "staircase_limit_s": S3_LIMIT_S},
            }
        )
        slave = {
            "clock": {"mode": "lockstep", "period_s": DEVICE_S},
            "sensor": {"noise_std_m": 0.5 * QUANTUM * STROKE_M, "quantum_m": QUANTUM * STROKE_M, "seed": seed},
        }
        self.period_s = period_s
        self.valve = Valve.from_file(valve)
        self.valve.rest_at(0.0, 0.0)
        device = OwnClock(Device(self.valve, SlaveFile.model_validate(slave), {}), period_s)
        self.cycle = virtual_cycle(file, device, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
        for _ in run_identification(self.cycle, S3_LIMIT_S, wait=False):
            pass

    def path(self, reference: float, for_s: float) -> np.ndarray:
        """Return where the true stem is at each cycle after a reference is written, of the stroke."""
        before = self.cycle.requests
        self.cycle.requests = replace(
            before, eta=QUIET, reference_m=reference * STROKE_M, reference_writes=before.reference_writes + 1
        )
        at = []
        for _ in range(round(for_s / self.period_s)):
            self.cycle.once()
            at.append(self.valve.position_m / STROKE_M)
        return np.array(at)


@dataclass(frozen=True, slots=True)
class Made:
    """A step: error at its end, how far beyond, travel of the stem, of the stroke; and when it ended, s."""

    error: float
    beyond: float
    travel: float
    asked: float
    ended_s: float


def made(loop: Loop, references: list[float]) -> Iterator[Made]:
    """Yield how each step is made."""
    before = loop.path(references[0], 2 * STEP_S)[-1]
    asked_before = references[0]
    for reference in references[1:]:
        at = loop.path(reference, STEP_S)
        low, high = min(before, reference), max(before, reference)
        elsewhere = np.flatnonzero(np.abs(at - at[-1]) > ENDED)
        yield Made(
            error=float(at[-1] - reference),
            beyond=float(max(0.0, (low - at).max(), (at - high).max())),
            travel=float(np.abs(np.diff(np.concatenate(([before], at)))).sum()),
            asked=abs(reference - asked_before),
            ended_s=loop.period_s * float(elsewhere[-1] + 1 if elsewhere.size else 0),
        )
        before, asked_before = at[-1], reference


def asked(steps: int, seed: int, lowest: float = LOWEST) -> list[float]:
    """Return references, of the stroke."""
    rng, at = np.random.default_rng(seed), [0.6]
    for _ in range(steps):
        way = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))) * rng.choice((-1, 1)))
        at.append(at[-1] + (way if lowest <= at[-1] + way <= HIGHEST else -way))
    return at


HEAD = f"{'case':24}{'law':>13}" + "".join(
    f"{each:>9}" for each in ("rms", "worst", "<= 0.1", "<= 0.25", "beyond", "90 %", "travel", "s", "95 %, s")
)


def row(case: str, law: str, steps: list[Made]) -> str:
    """Return a row of the table."""
    error = 100 * np.abs([each.error for each in steps])
    beyond = 100 * np.array([each.beyond for each in steps])
    ended_s = np.array([each.ended_s for each in steps])
    travel = sum(each.travel for each in steps) / sum(each.asked for each in steps)
    figures = (
        f"{np.sqrt(np.mean(error**2)):9.3f}{error.max():9.3f}{100 * np.mean(error <= 0.1):8.0f} %"
        f"{100 * np.mean(error <= 0.25):8.0f} %{np.mean(beyond):9.2f}{np.quantile(beyond, 0.9):9.2f}{travel:9.2f}"
        f"{np.median(ended_s):9.2f}{np.quantile(ended_s, 0.95):9.2f}"
    )
    return f"{case:24}{law:>13}{figures}"


def slow_ramp(law: str, period_s: float, seed: int, written_s: float) -> str:
    """Say what a slow ramp costs."""
    loop = Loop(valve_of("bare"), law, period_s, seed)
    for reference in asked(20, seed):
        before = loop.path(reference, STEP_S)
    ways = np.arange(written_s, RAMP_S + 0.5 * written_s, written_s) * RAMP / RAMP_S
    at = np.concatenate([before[-1:], *(loop.path(float(reference + way), written_s) for way in ways)])
    travel, off = float(np.abs(np.diff(at)).sum()), 100 * abs(at[-1] - reference - RAMP)
    asked_for = f"{law}, written every {written_s:g} s: {100 * RAMP:g} % in {RAMP_S:g} s"
    return f"{asked_for} costs {travel:.3f} strokes, and ends {off:.3f} % off"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--period-ms", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--laws", nargs="+", default=["slides", "conventional"])
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=CASES)
    parser.add_argument("--slow-ramp", action="store_true")
    arguments = parser.parse_args()
    period_s = 1e-3 * arguments.period_ms
    if arguments.slow_ramp:
        for law, written_s in product(arguments.laws, WRITTEN_S):
            print(slow_ramp(law, period_s, arguments.seed, written_s), flush=True)
        return
    print(HEAD)
    for case in arguments.cases:
        for law in arguments.laws:
            valve = valve_of(case)
            loop = Loop(valve, law, period_s, arguments.seed)
            steps = list(made(loop, asked(arguments.steps, arguments.seed + 1, lowest_of(valve))))
            print(row(case, law, steps), flush=True)


if __name__ == "__main__":
    main()
