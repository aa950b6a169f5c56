"""A position sensor that jumps, freezes or drifts in the middle of S3: what is accepted, and what of it is wrong?

    python -m benchmarks.sensor_faults [--cases 300] [--seed 0] [--kinds sine staircase]

The seed's valve with noise of 1e-4 of the stroke, in virtual time: S3 by a sine at 1 ms, by a staircase at 10 and at
50 ms. In each case the position is off once, from a random instant of S3 on:

    jump     by 0.05 to 30 % of the stroke, evenly in the logarithm, up or down
    freeze   at the value that it had
    drift    by 0.05 to 30 % of the stroke a second (a staircase: in all of S3), evenly in the logarithm

for one sample, for 1 to 1000 ms (a staircase: 30 periods), evenly in the logarithm, or for good. The clock of the
device and its counter go on, so nothing but the values tells. A drift stays. What the law then uses is held against
the truth: wrong is what lands a slide at mid-stroke, up or (after a staircase) down, more than three reported
deviations and 0.2 % of the stroke elsewhere, whether the sensor is taken to be right before the jump or after it.
"""

import argparse
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import exp, inf, log, sqrt
from typing import Any

import numpy as np

from config.codes import InhibitReason, Mode
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve

FILE = load_valve(shipped_valve("seed"))
STROKE_M = FILE.valve.stroke_m
SLOPE_PA_PER_M = FILE.valve.spring_n_per_m / FILE.valve.diaphragm_area_m2
FRICTION_PA = FILE.valve.coulomb_n / FILE.valve.diaphragm_area_m2
ALPHA_PA, BETA_PA = 44126.0, 13238.0
SMALLEST, LARGEST = 5e-4, 0.3
"""Of the stroke."""
DEVIATIONS, ALLOWED = 3.0, 2e-3
BEGINS_S = 0.1
GAVE_UP = (
    InhibitReason.STAIRCASE_IN_VAIN,
    InhibitReason.STAIRCASE_LIMITED,
    InhibitReason.STAIRCASE_UNANSWERED,
)


@dataclass(frozen=True, slots=True)
class Experiment:
    """How S3 is done, and how long it takes without a fault."""

    name: str
    period_s: float
    s3_s: float
    by_slides: bool


EXPERIMENTS = (
    Experiment("sine", 1e-3, 0.95, False),
    Experiment("staircase", 0.01, 14.0, True),
    Experiment("staircase", 0.05, 22.0, True),
)


@dataclass(frozen=True, slots=True)
class SensorFault:
    """From `at_s` on for `over_s` the position is off by `by_m` and `drift_m_per_s`, or, NaN, stays where it was."""

    at_s: float
    over_s: float
    by_m: float
    drift_m_per_s: float = 0.0

    @property
    def kind(self) -> str:
        """Its name, and whether it passes."""
        if self.drift_m_per_s:
            return "drift"
        freeze = "freeze" if np.isnan(self.by_m) else "jump"
        return f"{freeze}, stays" if self.over_s == inf else freeze


NO_FAULT = SensorFault(inf, inf, 0.0)


class Spoilt:
    """A device whose position sensor fails; all else goes on."""

    def __init__(self, device: Device, fault: SensorFault) -> None:
        self._device, self.fault = device, fault
        self.position_m = device.position_m
        self._measure()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def _measure(self) -> None:
        fault, now_s = self.fault, self._device.device_time_us / 1e6
        if not fault.at_s <= now_s < fault.at_s + fault.over_s:
            self.position_m = self._device.position_m
        elif not np.isnan(fault.by_m):
            self.position_m = self._device.position_m + fault.by_m + fault.drift_m_per_s * (now_s - fault.at_s)

    def tick(self, command_pa: float) -> None:
        self._device.tick(command_pa)
        self._measure()


def drawn(rng: np.random.Generator, each: Experiment) -> SensorFault:
    """Draw a fault."""
    at_s = BEGINS_S + rng.uniform(0.0, each.s3_s)
    longest_s = 30 * each.period_s if each.by_slides else 1.0
    over_s = (
        each.period_s,
        max(each.period_s, exp(rng.uniform(log(1e-3), log(longest_s)))),
        inf,
    )[rng.integers(3)]
    by_m = STROKE_M * exp(rng.uniform(log(SMALLEST), log(LARGEST))) * rng.choice((-1, 1))
    kind = rng.random()
    if kind < 0.3:
        return SensorFault(at_s, inf, 0.0, by_m / (each.s3_s if each.by_slides else 1.0))
    return SensorFault(at_s, over_s, by_m if kind < 0.7 else np.nan)


def identified(each: Experiment, fault: SensorFault, seed: int) -> tuple[Decision, str]:
    """Return what S3 leaves, and what ended it."""
    daemon = {
        "valve": {"stroke_m": STROKE_M},
        "cycle": {"pace": "device", "period_s": each.period_s},
        "safety": {"stale_after_s": max(0.1, 4 * each.period_s)},
        "control": {"law": "slides" if each.by_slides else "seed"},
        "excitation": {"travel_window": (0.3, 0.9)},
    }
    slave = SlaveFile.model_validate(
        {
            "clock": {"mode": "lockstep", "period_s": each.period_s},
            "sensor": {"noise_std_m": 1e-4 * STROKE_M, "seed": seed},
        }
    )
    valve = Valve.from_file(FILE)
    valve.rest_at(0.0, 0.0)
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=ALPHA_PA, beta_pa=BETA_PA)
    cycle = virtual_cycle(DaemonFile.model_validate(daemon), Spoilt(Device(valve, slave, {}), fault), first)

    def run(until_s: float) -> bool:
        while cycle.snapshot.sample.now_s < until_s:
            cycle.once()
            decision = cycle.snapshot.decision
            if decision.progress >= 1 or decision.fault or decision.inhibit_reason in GAVE_UP:
                return True
        return False

    run(BEGINS_S)
    cycle.requests = replace(cycle.requests, eta=(0, 0, 0))
    ended = run(BEGINS_S + 10 * each.s3_s)
    cycle.requests = replace(cycle.requests, eta=QUIET)
    cycle.once()
    cycle.once()
    decision = cycle.snapshot.decision
    return decision, decision.fault.name if decision.fault else "" if ended else "too long"


def off(each: Experiment, decision: Decision, by_m: float) -> float:
    """Return how far slides land off, of what is allowed, the sensor taken to be off by `by_m`."""
    ratios, law = decision.applied.ratios, decision.static_law
    assert ratios is not None
    middle_m, worst = 0.5 * STROKE_M, 0.0
    for s in (1, -1) if each.by_slides else (1,):
        true_pa = SLOPE_PA_PER_M * (middle_m - by_m) + s * FRICTION_PA
        if each.by_slides:
            row = np.array((middle_m, float(s > 0), -float(s < 0)))
            std_pa = sqrt(max(0.0, float(row @ law.covariance @ row)))
        else:
            estimates = decision.estimates
            std_pa = float(np.hypot(middle_m * estimates.b_over_c.std, estimates.k_over_c.std))
        allowed_pa = max(DEVIATIONS * std_pa, ALLOWED * STROKE_M * SLOPE_PA_PER_M)
        worst = max(worst, abs(ratios.balance_pa(middle_m, s) - true_pa) / allowed_pa)
    return worst


def report(each: Experiment, cases: int, seed: int) -> Iterator[str]:
    """Yield what became of the cases of one experiment."""
    yield f"{each.name}, {1e3 * each.period_s:g} ms"
    rng = np.random.default_rng(seed)
    counts: dict[str, Counter[str]] = {}
    for number in range(cases):
        fault = drawn(rng, each) if number else NO_FAULT
        decision, ended = identified(each, fault, number)
        what = f"refused: {ended or decision.applied.last_refusal.name}"
        if decision.applied.ratios is not None:
            by_m = (0.0, 0.0 if np.isnan(fault.by_m) else fault.by_m)
            worst = min(off(each, decision, one) for one in by_m)
            what = "right" if worst <= 1.0 else "WRONG"
            if worst > 1.0:
                yield (
                    f"    wrong: {fault.kind} at {fault.at_s:.3f} s for {fault.over_s:.4f} s by "
                    f"{100 * fault.by_m / STROKE_M:.3f} %, {100 * fault.drift_m_per_s / STROKE_M:.3f} %/s: "
                    f"off {worst:.1f} times what is allowed"
                )
        counts.setdefault(fault.kind if number else "none", Counter())[what] += 1
    for kind, found in sorted(counts.items()):
        yield f"    {kind:14s} {dict(found.most_common())}"


def main() -> None:
    """Print the report."""
    logging.disable(logging.CRITICAL)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=("sine", "staircase"), default=["sine", "staircase"])
    arguments = parser.parse_args()
    for each in EXPERIMENTS:
        if each.name in arguments.kinds:
            print(*report(each, arguments.cases, arguments.seed), sep="\n", flush=True)


if __name__ == "__main__":
    main()
