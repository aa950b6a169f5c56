"""Small moves: the seed's law and slides on the same random steps of the seed's valve, in one run.

    python -m benchmarks.small_moves [--steps 100] [--rest-s 120] [--seed 0] [--laws NAME...]
    python -m benchmarks.small_moves --following [--noise-pu 1e-4] [--seed 0]

Each row is a valve of its own: first the daemon's S3 identifies it under the row's noise, and nothing else is told to
the controller; then come the steps, their sizes from 0.1 to 10 % of stroke, evenly in the logarithm (evenly in size
for the second row), 2 s each, in a loop of 1 ms with one cycle of delay; what comes every 0.5 s is `--following`.
Slower loops and pressures have more time, and only slides run from 20 ms on, where a sine identifies nothing. All
figures are of the true stem, in % of stroke: what the error is at the end of the step, and how far the stem was beyond
the reference on the way. The last table leaves each loop alone at a fixed reference. Takes some minutes. The last
column of the first is the processor time of one step of the control core, on average.

`--following` prints another table alone: a DCS that writes every 0.5 s, first a ramp of 1 % of stroke a second up and
down for a minute, then for another the noise of a controller's output, steps of 0.2 % (standard deviation) about 60 %.
Both laws have the valve's true numbers there, typed in, for a sine identifies nothing in a slow loop.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from drivers.in_memory import MemoryDriver
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from sim.slave.simulated_device import Device
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed")).valve
STROKE_M = SEED.stroke_m
STEP_S, S3_S = 2.0, 1.0
LOWEST, HIGHEST = 0.4, 0.9
"""Of the stroke: below, a spring without preload does not bring this valve down against its friction."""
SMALLEST, LARGEST = 1e-3, 0.1


Law = Literal["seed", "conventional", "slides"]
WRITTEN_S, FOLLOWED_S = 0.5, 60.0
RAMP_PER_S, WANDER = 0.01, 2e-3
"""Of the stroke."""
PERIODS_S = (1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2)
VISIBLE = 1e-4
"""Of the stroke: a stem that moves no farther between two writes has not."""
KNOWN = {
    "b_over_c_pa_per_m": -SEED.spring_n_per_m / SEED.diaphragm_area_m2,
    "k_over_c_pa": -SEED.coulomb_n / SEED.diaphragm_area_m2,
}
LAWS: tuple[Law, ...] = ("seed", "slides")
SLIDES: tuple[Law, ...] = ("slides",)


@dataclass(frozen=True, slots=True)
class Case:
    """A row: noise, effects that the law does not know, period of the loop, how the sizes are drawn."""

    name: str
    noise_pu: float = 1e-4
    effects: tuple[dict[str, object], ...] = ()
    period_s: float = 1e-3
    even_in_size: bool = False
    step_s: float = STEP_S
    laws: tuple[Law, ...] = LAWS
    known: bool = False
    """Whether the valve's numbers are typed in."""


CASES = (
    Case("noise 1e-4 p.u."),
    Case("1e-4, even in size", even_in_size=True),
    Case("noise 1e-3 p.u.", 1e-3),
    Case("1e-4, I/P lag 50 ms", effects=({"name": "ip_lag", "time_constant_s": 0.05},), step_s=4.0),
    Case("1e-4, backlash 0.3 %", effects=({"name": "backlash", "width_m": 3e-3 * STROKE_M},)),
    Case("1e-4, packing asymmetry 15 %", effects=({"name": "asymmetric_friction", "asymmetry": 0.15},)),
    Case("1e-4, loop of 5 ms", period_s=5e-3),
    Case("1e-4, loop of 20 ms", period_s=0.02, laws=SLIDES),
    Case("1e-4, loop of 50 ms", period_s=0.05, laws=SLIDES),
    Case("1e-4, loop of 100 ms", period_s=0.1, step_s=4.0, laws=SLIDES),
    Case("1e-4, loop of 200 ms", period_s=0.2, step_s=8.0, laws=SLIDES),
    Case(
        "1e-4, 50 ms, I/P lag 200 ms",
        effects=({"name": "ip_lag", "time_constant_s": 0.2},),
        period_s=0.05,
        step_s=10.0,
        laws=SLIDES,
    ),
    Case(
        "1e-4, 50 ms, I/P 40, 60 kPa/s",
        effects=({"name": "rate_limit", "filling_pa_per_s": 4e4, "venting_pa_per_s": 6e4},),
        period_s=0.05,
        step_s=8.0,
        laws=SLIDES,
    ),
    Case(
        "1e-4, 50 ms, friction grows 30 %",
        effects=({"name": "position_friction", "growth": 0.3, "travel_m": STROKE_M},),
        period_s=0.05,
        step_s=4.0,
        laws=SLIDES,
    ),
    Case(
        "1e-4, 50 ms, spring hardens",
        effects=({"name": "spring_hardening", "cubic_n_per_m3": 1e6},),
        period_s=0.05,
        step_s=4.0,
        laws=SLIDES,
    ),
)


class Late:
    """A device whose command comes into force one period late, as it does in real time."""

    def __init__(self, device: Device) -> None:
        self._device, self.command_pa = device, device.command_pa

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def tick(self, command_pa: float) -> None:
        self._device.check(command_pa)
        self._device.tick(self.command_pa)
        self.command_pa = command_pa


class Timed(Controller):
    """The controller, and the processor time that its steps have taken."""

    steps = busy_ns = 0

    def step(self, sample: Sample, requests: Requests) -> Decision:
        began_ns = time.thread_time_ns()
        decision = super().step(sample, requests)
        self.busy_ns += time.thread_time_ns() - began_ns
        self.steps += 1
        return decision


class Loop:
    """A valve, its device and the daemon's cycle, in virtual time; identified when it is made."""

    def __init__(self, law: Law, case: "Case", seed: int) -> None:
        self._period_s = case.period_s
        daemon = {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": case.period_s},
            "safety": {"stale_after_s": max(0.1, 3 * case.period_s)},
            "control": {"law": law},
            **({"law": KNOWN} if case.known else {}),
        }
        slave = {
            "clock": {"mode": "lockstep", "period_s": case.period_s},
            "sensor": {"noise_std_m": case.noise_pu * STROKE_M, "seed": seed},
        }
        self.valve = Valve.from_file(ValveFile.model_validate({"valve": SEED.model_dump(), "effect": case.effects}))
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        # Alpha above break-away, beta a third of the travel: the seed's own numbers.
        first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=44126.0, beta_pa=13238.0)
        pace = DevicePace()
        link = Link(MemoryDriver(Late(device)), pace)
        held_pa, _ = link.open()
        file = DaemonFile.model_validate(daemon)
        self.controller = Timed(Settings.of(file), held_pa)
        self.cycle = Cycle(link, self.controller, pace, first, recorder=None)
        if not case.known:
            self._identify(by_slides=file.by_slides)
        self.path(case.period_s)
        self.controller.steps = self.controller.busy_ns = 0

    def _identify(self, *, by_slides: bool) -> None:
        self._ask(eta=(0, 0, 0))
        if by_slides:
            while self.cycle.snapshot.decision.progress < 1:
                self.cycle.once()
        else:
            self.path(S3_S)
        self._ask(eta=QUIET)

    def _ask(self, **values: object) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)  # type: ignore[arg-type]

    def step_to(self, reference_m: float) -> None:
        self._ask(reference_m=reference_m, reference_writes=self.cycle.requests.reference_writes + 1)

    def path(self, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Run; return the true stem's position, m, and the command, Pa, at every cycle."""
        rows = []
        for _ in range(round(duration_s / self._period_s)):
            self.cycle.once()
            rows.append((self.valve.position_m, self.cycle.snapshot.decision.command_pa))
        position_m, command_pa = np.array(rows).T
        return position_m, command_pa


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of each step, of the stroke: error at the end, and the farthest beyond the reference."""

    error: np.ndarray
    overshoot: np.ndarray

    @property
    def said(self) -> str:
        e = np.abs(self.error)
        shares = "".join(f"{100 * np.mean(e <= limit):9.1f}" for limit in (1e-3, 2.5e-3))
        figures = (np.sqrt(np.mean(e**2)), np.percentile(e, 95), e.max(), np.percentile(self.overshoot, 95))
        return "".join(f"{100 * f:9.3f}" for f in figures) + f"{100 * self.overshoot.max():9.3f}" + shares


HEAD = "".join(f"{name:>9}" for name in ("rms", "95 %", "worst", "ov. 95 %", "ov. max", "<= 0.1", "<= 0.25", "us/step"))


def references(steps: int, seed: int, *, even_in_size: bool = False) -> Iterator[tuple[float, int]]:
    """Yield references, m, and the direction of the step to each."""
    rng = np.random.default_rng(seed)
    at = 0.6
    for _ in range(steps):
        low, high = (SMALLEST, LARGEST) if even_in_size else np.log((SMALLEST, LARGEST))
        drawn = rng.uniform(low, high)
        size = drawn if even_in_size else np.exp(drawn)
        direction = int(rng.choice((-1, 1)))
        if not LOWEST <= at + direction * size <= HIGHEST:
            direction = -direction
        at += direction * size
        yield at * STROKE_M, direction


def stepped(loop: Loop, steps: Iterator[tuple[float, int]], step_s: float) -> Outcome:
    """Let a loop make the steps."""
    loop.step_to(0.6 * STROKE_M)
    loop.path(max(1.0, step_s))
    errors, overshoots = [], []
    for reference_m, direction in steps:
        loop.step_to(reference_m)
        position_m, _ = loop.path(step_s)
        errors.append((position_m[-1] - reference_m) / STROKE_M)
        overshoots.append(max(0.0, float((direction * (position_m - reference_m)).max())) / STROKE_M)
    return Outcome(np.array(errors), np.array(overshoots))


def rested(loop: Loop, rest_s: float) -> str:
    """Say what a loop does that is left alone after a small step, the first two seconds apart."""
    loop.step_to(0.6 * STROKE_M)
    loop.path(2.0)
    loop.step_to(0.603 * STROKE_M)
    loop.path(2.0)
    position_m, command_pa = loop.path(rest_s)
    error = 100 * abs(position_m[-1] / STROKE_M - 0.603)
    return f"{int(np.count_nonzero(np.diff(command_pa))):10}{100 * np.ptp(position_m) / STROKE_M:12.4f}{error:12.4f}"


def written(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what a DCS writes every `WRITTEN_S`, of the stroke: a ramp up and down, and a controller's noise."""
    count = round(FOLLOWED_S / WRITTEN_S)
    ramp = 0.5 + RAMP_PER_S * WRITTEN_S * np.minimum(np.arange(count), np.arange(count)[::-1])
    return ramp, 0.6 + WANDER * np.random.default_rng(seed).standard_normal(count)


def followed(loop: Loop, references: np.ndarray) -> str:
    """Say how a loop follows: error, % of stroke; strokes of the stem a minute; its reversals from write to write."""
    loop.step_to(references[0] * STROKE_M)
    loop.path(20.0)
    parts = []
    for reference in references:
        loop.step_to(reference * STROKE_M)
        parts.append(loop.path(WRITTEN_S)[0] / STROKE_M)
    error = np.concatenate([part - reference for part, reference in zip(parts, references, strict=True)])
    strokes = float(np.abs(np.diff(np.concatenate(parts))).sum()) * 60.0 / FOLLOWED_S
    moved = np.diff([part[-1] for part in parts])
    ways = np.sign(moved[np.abs(moved) > VISIBLE])
    ends = np.array([part[-1] for part in parts]) - references
    return (
        f"{100 * np.sqrt(np.mean(error**2)):10.3f}{100 * np.sqrt(np.mean(ends**2)):9.3f}{strokes:9.2f}"
        f"{int(np.count_nonzero(np.diff(ways))) / FOLLOWED_S * 60:9.0f}"
    )


def following(seed: int, noise_pu: float, laws: Sequence[Law], periods_s: Sequence[float]) -> Iterator[str]:
    """Yield the table of references that come every 0.5 s."""
    ramp, noise = written(seed)
    own = " and ".join(f"{np.abs(np.diff(each)).sum() * 60.0 / FOLLOWED_S:.2f}" for each in (ramp, noise))
    yield f"a reference every {WRITTEN_S:g} s, strokes a minute of its own: {own}"
    columns = f"{'rms %':>10}{'at end':>9}{'strokes':>9}{'turns':>9}"
    yield f"{'':18}{'under a ramp':>37}{'under noise':>37}"
    yield f"{'':18}{columns}{columns}"
    for period_s in periods_s:
        for law in laws:
            case = Case("", noise_pu, period_s=period_s, known=True)
            said = "".join(followed(Loop(law, case, seed), each) for each in (ramp, noise))
            yield f"{1e3 * period_s:4g} ms {law:>10}{said}"


def report(steps: int, rest_s: float, seed: int, laws: Sequence[Law]) -> Iterator[str]:
    """Yield lines: the table of steps, the table of rests."""
    yield f"{steps} steps, % of stroke; ov.: overshoot; then the share of steps that end so near, %"
    yield f"{'':34}{'law':>10}{HEAD}"
    for case in CASES:
        for law in (each for each in case.laws if each in laws):
            loop = Loop(law, case, seed)
            outcome = stepped(loop, references(steps, seed + 1, even_in_size=case.even_in_size), case.step_s)
            step_us = loop.controller.busy_ns / loop.controller.steps / 1e3
            yield f"{case.name:34}{law:>10}{outcome.said}{step_us:9.1f}"
    yield ""
    yield f"left alone for {rest_s:g} s: changes of the command, travel of the stem, error, % of stroke"
    for case in CASES:
        for law in (each for each in case.laws if each in laws):
            if not case.even_in_size and law != "seed":
                yield f"{case.name:34}{law:>10}{rested(Loop(law, case, seed), rest_s)}"


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--rest-s", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=LAWS, metavar="NAME")
    parser.add_argument("--following", action="store_true", help="references every 0.5 s, alone")
    parser.add_argument("--noise-pu", type=float, default=1e-4, help="of the position, with --following (1e-4)")
    parser.add_argument("--periods-ms", nargs="+", type=float, default=[1e3 * each for each in PERIODS_S])
    arguments = parser.parse_args()
    started_s = time.monotonic()
    periods_s = [1e-3 * each for each in arguments.periods_ms]
    followed_lines = following(arguments.seed, arguments.noise_pu, arguments.laws, periods_s)
    lines = report(arguments.steps, arguments.rest_s, arguments.seed, arguments.laws)
    for line in followed_lines if arguments.following else lines:
        print(line, flush=True)
    print(f"{time.monotonic() - started_s:.0f} s")


if __name__ == "__main__":
    main()
