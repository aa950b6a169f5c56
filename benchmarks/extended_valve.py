"""What an extended valve is worth to the law of slides: each effect of the library, with and without its inverse.

    python -m benchmarks.extended_valve [--steps 100] [--period-s 0.02] [--step-s 2.0] [--seed 0] [--effects NAME...]

The seed's valve with one effect more, at the strength in the middle of those that it declares (a weaker one, where
that would not let the stem make the steps). Its position comes with noise of 1e-4 of the stroke; commands come into
force one period late. Without: S3's staircase identifies a straight law, as the daemon does where it knows the stroke
only. With: `[law] valve` names the valve file with the effect, and nothing is identified. Then come random steps of
0.1 to 10 % of stroke, evenly in the logarithm; they have twice the time where the actuator fills slowly. Errors are of
the true stem at the end of each step, % of stroke; the first row is the valve without any effect. All run one compiled
composition, the others' parameters off.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from benchmarks.small_moves import Late
from config.codes import Mode
from config.daemon_file import DaemonFile
from config.extended_valve import ExtendedValve
from config.slave_file import SlaveFile
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from drivers.in_memory import MemoryDriver
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from sim.composition import Composition
from sim.effect import Effect, first_effects, shipped_effect
from sim.slave.simulated_device import Device
from sim.static_inverse import extended_valve
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed")).valve
STROKE_M = SEED.stroke_m
NOISE = 1e-4
VALVE_STEP_S = 1e-4
LOWEST, HIGHEST, FIRST = 0.4, 0.62, 0.5
SMALLEST, LARGEST = 1e-3, 0.1
SLOW = {"rate_limit": 2.0}
"""Factor on the time of a step: filling the actuator from one balance to the other alone takes 0.6 s."""
WEAK = {"supply_limit": 0, "friction_drift": 1}
"""Which of the declared strengths, where the middle one would not let the stem make the steps."""


def typical(effect: Effect) -> EffectTable:
    """Return an effect's table at a strength in the middle."""
    values = []
    for parameter in effect.parameters.values():
        starts = parameter.starts_for(SEED)
        values.append(starts[WEAK.get(effect.name, len(starts) // 2)])
    return EffectTable.model_validate({"name": effect.name, **dict(zip(effect.parameters, values, strict=True))})


def off(effect: Effect) -> EffectTable:
    """Return an effect's table with which it vanishes."""
    return EffectTable.model_validate(
        {"name": effect.name, **dict(zip(effect.parameters, effect.off(SEED), strict=True))}
    )


class Loop:
    """A valve and the daemon's cycle, in virtual time; ready for the first step when it is made."""

    def __init__(self, composition: Composition, extended: ExtendedValve | None, period_s: float, seed: int) -> None:
        self._period_s = period_s
        file = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "cycle": {"pace": "device", "period_s": period_s},
                "safety": {"stale_after_s": max(0.1, 3 * period_s)},
                "control": {"law": "slides"},
            }
        )
        slave = {
            "clock": {"mode": "lockstep", "period_s": period_s},
            "sensor": {"noise_std_m": NOISE * STROKE_M, "seed": seed},
        }
        self.valve = Valve(composition, step_s=VALVE_STEP_S)
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        pace = DevicePace()
        link = Link(MemoryDriver(Late(device)), pace)
        held_pa, _ = link.open()
        self.controller = Controller(Settings.of(file, extended), held_pa)
        self.cycle = Cycle(link, self.controller, pace, Requests(mode=Mode.AUTOMATIC, mode_writes=1), recorder=None)
        if extended is None:
            self._ask(eta=(0, 0, 0))
            for _ in range(round(file.excitation.staircase_limit_s / period_s)):
                self.cycle.once()
                if self.cycle.snapshot.decision.progress >= 1:
                    break
            self._ask(eta=QUIET)
        self.stand(period_s)

    @property
    def identified(self) -> bool:
        """Whether the staircase came to an end: one whose supply does not give what it asks for waits for it."""
        return self.cycle.snapshot.decision.applied.ratios is not None

    def _ask(self, **values: object) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)  # type: ignore[arg-type]

    def step_to(self, reference_m: float) -> None:
        """Write the reference."""
        self._ask(reference_m=reference_m, reference_writes=self.cycle.requests.reference_writes + 1)

    def stand(self, duration_s: float) -> float:
        """Let time pass; return where the stem is, m."""
        for _ in range(round(duration_s / self._period_s)):
            self.cycle.once()
        return self.valve.position_m


def references(steps: int, seed: int) -> Iterator[float]:
    """Yield references, m."""
    rng = np.random.default_rng(seed)
    at = FIRST
    for _ in range(steps):
        size = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST)))) * int(rng.choice((-1, 1)))
        at += size if LOWEST <= at + size <= HIGHEST else -size
        yield at * STROKE_M


@dataclass(frozen=True, slots=True)
class Outcome:
    """Errors of the true stem at the ends of the steps, of the stroke: (steps,)."""

    error: np.ndarray

    @property
    def rms(self) -> float:
        """Their root mean square."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def identified(self) -> bool:
        """Whether there are any: what is not identified does not move."""
        return not np.isnan(self.error).any()


@dataclass(frozen=True, slots=True)
class Course:
    """How the steps are made."""

    steps: int
    period_s: float
    step_s: float
    seed: int

    def outcome(self, composition: Composition, extended: ExtendedValve | None) -> Outcome:
        """Make them on a valve; of one that could not be identified errors are NaN."""
        loop = Loop(composition, extended, self.period_s, self.seed)
        if extended is None and not loop.identified:
            return Outcome(np.full(self.steps, nan))
        loop.step_to(FIRST * STROKE_M)
        loop.stand(max(2.0, self.step_s))
        errors = []
        for reference_m in references(self.steps, self.seed + 1):
            loop.step_to(reference_m)
            errors.append((loop.stand(self.step_s) - reference_m) / STROKE_M)
        return Outcome(np.array(errors))


def report(course: Course, names: Sequence[str]) -> Iterator[str]:
    """Yield the table."""
    library = [shipped_effect(name, "benchmark") for name in first_effects()]
    whole = Composition.of(ValveFile(valve=SEED, effect=tuple(off(each) for each in library)), library)
    bare = course.outcome(whole, extended_valve(ValveFile(valve=SEED), "seed")).rms
    yield f"{course.steps} steps, {course.step_s:g} s each, at {1e3 * course.period_s:g} ms; errors in % of stroke"
    yield f"{'effect':22}{'without: rms':>13}{'worst':>8}{'with: rms':>11}{'worst':>8}{'of bare':>9}{'less by':>9}"
    yield f"{'(none)':22}{'':13}{'':8}{100 * bare:11.4f}"
    for effect in library:
        if effect.name not in names:
            continue
        table = typical(effect)
        on = {f"{effect.name}.{key}": float(value) for key, value in table.parameters.items()}
        valve = replace(whole, theta=whole.changed(whole.theta, on))
        slower = replace(course, step_s=SLOW.get(effect.name, 1.0) * course.step_s)
        without = slower.outcome(valve, None)
        with_it = slower.outcome(valve, extended_valve(ValveFile(valve=SEED, effect=(table,)), effect.name))
        told = f"{without.rms / with_it.rms:9.1f}" if without.identified else ""
        yield f"{effect.name:22}{_said(without):>21}{_said(with_it):>19}{with_it.rms / bare:9.1f}{told}"


def _said(outcome: Outcome) -> str:
    """Return errors as they are printed, % of stroke: rms and the worst."""
    worst = 100 * float(np.abs(outcome.error).max())
    return f"{100 * outcome.rms:11.4f}{worst:8.3f}" if outcome.identified else "not identified"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--period-s", type=float, default=0.02)
    parser.add_argument("--step-s", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--effects", nargs="+", choices=first_effects(), default=first_effects(), metavar="NAME")
    arguments = parser.parse_args()
    started_s = time.monotonic()
    course = Course(arguments.steps, arguments.period_s, arguments.step_s, arguments.seed)
    for line in report(course, arguments.effects):
        print(line, flush=True)
    print(f"{time.monotonic() - started_s:.0f} s")


if __name__ == "__main__":
    main()
