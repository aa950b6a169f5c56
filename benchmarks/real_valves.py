"""Random valves as plants have them, under the law of slides: is anything wrong accepted, do small steps land?

    python -m benchmarks.real_valves [--valves 50] [--steps 40] [--seed 0] [--law slides] [--periods-ms MS...]
                                     [--left-alone-s 0 [--disturbance 0] [--reference-noise 0]]

Each valve is drawn anew: stroke 20 to 100 mm, bench range 60 to 100 kPa, friction 2 to 12 % of it, F_s/F_c 1.05 to 1.4,
stops at both ends; of preload (to 40 % of the bench range), packing asymmetry (to 30 %), presliding, I/P lag (to
500 ms), backlash (to 1 %), friction growing over the stroke (to 30 %) and a hardening spring each with even chance; a
position of 10 to 16 bits with noise up to half a quantum; a loop of 1 to 200 ms whose commands come into force one
period late and which loses up to 1 % of its replies. Nothing is told to the controller but stroke and pressure limits:
S3 identifies by a staircase.

Then slides to `PROBES` places each way, made by hand, tell the truth, and what the static law says of where they land
is held against its own deviation. Then come the steps, 0.1 to 10 % of stroke, evenly in the logarithm: landed is a true
indicated position within 0.1 % of stroke or one quantum.

The least excursion of a step by e to r, direction s, is that of two slides by a law that knows everything:

    max(m_-s(r), m_s(r) - abs(e))      m_s = (F_s,s - F_c,s)/k_s + (F_s,s + F_c,-s)/k_p - w, or the shortest that counts

each with the friction of its direction and the spring at r; a packing of stiffness k_p gives way before it breaks
loose, play w is taken up. What counts is seen for a slide, though it is shown shorter by half a quantum. Whoever goes
on in the direction of the last slide before turning round needs less: a ratio may be below 1. The first `LEARNING`
steps are counted apart. Some 10 s a valve. With `--left-alone-s 3600` each is then left for an hour at its last
reference, and changes of the command after the first minute are counted: there are none without a limit cycle. With
`--disturbance 0.01` the I/P meanwhile drifts to and fro by 1 % of the bench range, once in `DRIFTS_S`: what moves the
stem has to be answered, what does not, not. With `--reference-noise 2e-4` a DCS writes every `WRITTEN_S` a reference
that is off by that share of the stroke, a standard deviation; what the stem travels in that time stands beside the
changes. `--steps 0` only identifies, in seconds a valve. `--law conventional` has another law. `--periods-ms 1 20`
gives every valve each of these in place of its own.
"""

import argparse
import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from benchmarks.small_moves import Late
from config.codes import Mode
from config.daemon_file import DaemonFile
from config.law_names import law_names
from config.slave_file import SlaveFile
from config.valve_file import ValveFile
from drivers.boundary import NoReply, Reading
from drivers.in_memory import MemoryDriver, Plant
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.estimation.landings.landing_detector import VISIBLE
from sim.open_loop import STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve

SMALLEST, LARGEST = 1e-3, 0.1
WITHIN = 1e-3
"""Of the stroke."""
EXCURSION, AN_EXCURSION = 1.15, 0.2
"""Of the least: what is aimed at; less than this is none."""
SETTLED_S, DRIFTS_S = 60.0, 600.0
"""Of being left alone, what does not count; period of a disturbance."""
WRITTEN_S = 0.5
LEARNING = 10
"""Steps in which the shortest slides are learnt."""
PROBES = (0.35, 0.5, 0.65)
DEVIATIONS = 3.0
S3_LIMIT_S = 3600.0
NO_PRESLIDING = {"stiffness_n_per_m": 1e12}


@dataclass(frozen=True, slots=True)
class Drawn:
    """A valve, and how it is seen."""

    file: ValveFile
    period_s: float
    quantum_m: float
    noise_m: float
    loss: float
    maximum_pa: float
    bench_pa: float
    lag_s: float
    present: frozenset[str]
    """The effects that are not switched off."""

    @property
    def stroke_m(self) -> float:
        return self.file.valve.stroke_m


def drawn(rng: np.random.Generator) -> Drawn:
    """Draw a valve."""
    stroke_m, bench_pa = rng.uniform(0.02, 0.1), rng.uniform(60e3, 100e3)
    area_m2 = 0.035 * (stroke_m / 0.02) ** 0.6 * rng.uniform(0.8, 1.25)
    span_n = bench_pa * area_m2
    spring = span_n / stroke_m
    coulomb_n = span_n * np.exp(rng.uniform(np.log(0.02), np.log(0.12)))
    mass_kg = rng.uniform(1.0, 6.0)
    valve = {
        "name": "drawn",
        "mass_kg": mass_kg,
        "diaphragm_area_m2": area_m2,
        "spring_n_per_m": spring,
        "viscous_ns_per_m": 2 * rng.uniform(1.0, 3.0) * np.sqrt(spring * mass_kg),
        "coulomb_n": coulomb_n,
        "static_n": coulomb_n * rng.uniform(1.05, 1.4),
        "stribeck_velocity_m_per_s": 2.54e-4,
        "deadzone_ratio": 0.6,
        "stroke_m": stroke_m,
    }
    stop = {"lower_m": 0.0, "travel_m": stroke_m, "stiffness_n_per_m": 2000 * spring, "damping_ns_per_m": 1e4}
    # Every effect is there, an absent one switched off, so that one compiled kernel serves all valves.
    strengths: list[tuple[str, dict[str, float], dict[str, float]]] = [
        ("preload", {"force_n": span_n * rng.uniform(0.0, 0.4)}, {"force_n": 0.0}),
        ("asymmetric_friction", {"asymmetry": rng.uniform(-0.3, 0.3)}, {"asymmetry": 0.0}),
        ("presliding", {"stiffness_n_per_m": coulomb_n / stroke_m * 10 ** rng.uniform(2.0, 4.0)}, NO_PRESLIDING),
        ("ip_lag", {"time_constant_s": rng.uniform(0.0, 0.5)}, {"time_constant_s": 0.0}),
        ("backlash", {"width_m": stroke_m * rng.uniform(0.0, 0.01)}, {"width_m": 0.0}),
        ("position_friction", {"growth": rng.uniform(0.0, 0.3)}, {"growth": 0.0}),
        ("spring_hardening", {"cubic_n_per_m3": spring / stroke_m**2 * rng.uniform(0.0, 0.3)}, {"cubic_n_per_m3": 0.0}),
    ]
    present = {name for name, _, _ in strengths if rng.random() < 0.5}
    effects = [{"name": name, **(on if name in present else off)} for name, on, off in strengths]
    effects[5]["travel_m"] = stroke_m
    quantum_m = stroke_m / 2 ** int(rng.integers(10, 17))
    return Drawn(
        file=ValveFile.model_validate({"valve": valve, "effect": [{"name": "end_stop", **stop}, *effects]}),
        period_s=round(float(np.exp(rng.uniform(np.log(1e-3), np.log(0.2)))), 3),
        quantum_m=quantum_m,
        noise_m=quantum_m * rng.uniform(0.0, 0.5),
        loss=rng.uniform(0.0, 0.01),
        maximum_pa=2.5 * bench_pa,
        bench_pa=bench_pa,
        present=frozenset(present),
        lag_s=float(str(effects[3]["time_constant_s"])),
    )


class Losing(MemoryDriver):
    """A driver that loses replies."""

    def __init__(self, plant: Plant, loss: float, rng: np.random.Generator) -> None:
        super().__init__(plant)
        self._loss, self._rng = loss, rng

    def exchange(self, command_pa: float) -> Reading:
        reading = super().exchange(command_pa)
        if self._rng.random() < self._loss:
            raise NoReply("lost")
        return reading


class Disturbed(Late):
    """A late device whose I/P drifts to and fro by an amplitude, Pa, once it is told to."""

    amplitude_pa = 0.0

    def tick(self, command_pa: float) -> None:
        drift_pa = self.amplitude_pa * np.sin(2 * np.pi * 1e-6 * self.device_time_us / DRIFTS_S)
        self._device.check(command_pa)
        self._device.tick(max(0.0, self.command_pa + drift_pa))
        self.command_pa = command_pa


class Step(NamedTuple):
    """What a step took: how far it went beyond, of the stroke, changes of the command, s until the last of them."""

    beyond: float
    slides: int
    took_s: float


class Loop:
    """A drawn valve with the daemon's cycle, in virtual time."""

    def __init__(self, each: Drawn, rng: np.random.Generator, law: str = "slides") -> None:
        self._each, self._rng = each, rng
        period_s = each.period_s
        daemon = {
            "valve": {"stroke_m": each.stroke_m},
            "cycle": {"pace": "device", "period_s": period_s},
            "pressure": {"maximum_pa": each.maximum_pa},
            "safety": {"stale_after_s": 8 * period_s, "lost_after_cycles": 6},
            "control": {"law": law, "excursion_limit": 0.5},
            "excitation": {"kind": "staircase", "staircase_limit_s": S3_LIMIT_S},
        }
        slave = {
            "clock": {"mode": "lockstep", "period_s": period_s},
            "sensor": {"noise_std_m": each.noise_m, "quantum_m": each.quantum_m, "seed": int(rng.integers(2**31))},
            "supply": {"maximum_pa": each.maximum_pa},
        }
        self.valve = Valve.from_file(each.file, step_s=min(STEP_S, period_s))
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        pace = DevicePace()
        self.device = Disturbed(device)
        link = Link(Losing(self.device, each.loss, rng), pace)
        held_pa, _ = link.open()
        controller = Controller(Settings.of(DaemonFile.model_validate(daemon)), held_pa)
        self.cycle = Cycle(link, controller, pace, Requests(mode=Mode.AUTOMATIC, mode_writes=1), recorder=None)

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    @property
    def time_s(self) -> float:
        return self.cycle.snapshot.sample.now_s

    def ask(self, **values: object) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)  # type: ignore[arg-type]

    def identify(self) -> None:
        """Let S3 run until it is complete or has ended."""
        self.ask(eta=(0, 0, 0))
        self.cycle.once()
        until_s = self.time_s + S3_LIMIT_S
        while self.decision.progress < 1 and self.time_s < until_s:
            self.cycle.once()
            if self.decision.state.name != "S3_IDENTIFY":
                break
        self.ask(eta=QUIET)
        self.cycle.once()
        self.cycle.once()

    def step_to(self, reference_m: float, longest_s: float) -> Step:
        """Ask for a position until the law has rested longer than a DCS's scan; return what that took."""
        at_m = self.valve.indicated_m
        low_m, high_m = min(at_m, reference_m), max(at_m, reference_m)
        self.ask(reference_m=reference_m, reference_writes=self.cycle.requests.reference_writes + 1)
        farthest_m, last_pa, changes = 0.0, self.decision.command_pa, 0
        begin_s = since_s = self.time_s
        quiet_s = 1.5 + 40 * self._each.period_s + 20 * self._each.lag_s
        while self.time_s - begin_s < longest_s and self.time_s - since_s < quiet_s:
            self.cycle.once()
            x_m = self.valve.indicated_m
            farthest_m = max(farthest_m, low_m - x_m, x_m - high_m)
            if self.decision.command_pa != last_pa:
                last_pa, since_s, changes = self.decision.command_pa, self.time_s, changes + 1
        return Step(farthest_m / self._each.stroke_m, changes, since_s - begin_s)

    def left_alone(self, alone: "Alone") -> tuple[int, float]:
        """Return what happens from now on, but for the first while: changes of the command, travel in strokes."""
        self.device.amplitude_pa = alone.disturbance * self._each.bench_pa
        asked_m, begin_s = self.cycle.requests.reference_m, self.time_s
        writes, changes, travel_m = 0, 0, 0.0
        while self.time_s < begin_s + alone.duration_s:
            if alone.reference_noise and self.time_s - begin_s >= WRITTEN_S * writes:
                off_m = alone.reference_noise * self._each.stroke_m * self._rng.standard_normal()
                writes += 1
                self.ask(reference_m=asked_m + off_m, reference_writes=self.cycle.requests.reference_writes + 1)
            before_pa, before_m = self.decision.command_pa, self.valve.position_m
            self.cycle.once()
            if self.time_s > begin_s + min(SETTLED_S, alone.duration_s):
                changes += self.decision.command_pa != before_pa
                travel_m += abs(self.valve.position_m - before_m)
        return changes, travel_m / self._each.stroke_m


@dataclass(frozen=True, slots=True)
class Alone:
    """How a valve is left alone after its steps: drift of the I/P over the bench range, noise of the reference, p.u."""

    duration_s: float = 0.0
    disturbance: float = 0.0
    reference_noise: float = 0.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one valve."""

    reason: str
    worst: float
    """Error of a predicted landing over its deviation."""
    residual: float
    took_s: float
    landed: tuple[bool, ...]
    errors: tuple[float, ...]
    taken: tuple[Step, ...]
    excursions: tuple[float, ...]
    """Over the least."""
    why: str
    changes: int = 0
    """Of the command, while it was left alone."""
    strokes: float = 0.0
    """Of the stem, in that time."""


def probed(each: Drawn, loop: Loop) -> float:
    """Return how far slides land off the static law, at the worst, in its own deviations."""
    law, valve, stroke_m = loop.decision.static_law, Valve.from_file(each.file, step_s=STEP_S), each.stroke_m
    settle_s, worst = 0.5 + 20 * each.lag_s, 0.0
    ratios = law.ratios
    for s in (1, -1):
        for probe in PROBES:
            pressure_pa = -(ratios.b_over_c * probe * stroke_m + s * ratios.k_over_c) + ratios.offset_pa
            if not 0.0 < pressure_pa < each.maximum_pa:
                continue
            valve.rest_at(0.0, 0.0)
            for command_pa in (0.0, each.maximum_pa if s < 0 else 0.0, pressure_pa):
                valve.advance(command_pa, settle_s)
            off_m = valve.indicated_m - probe * stroke_m
            row = np.array((probe * stroke_m, float(s > 0), -float(s < 0)))
            deviation_m = np.sqrt(float(row @ law.covariance @ row)) / law.slope.value
            worst = max(worst, abs(off_m) / float(np.hypot(deviation_m, law.residual_m)))
    return worst


def shortest_slide_m(each: Drawn, position_m: float, direction: int) -> float:
    """Return the shortest slide that breaks the stem loose at a place after one the other way, m, as indicated."""
    valve, effect = each.file.valve, {e.name: e.parameters for e in each.file.effect}
    asymmetry = direction * effect["asymmetric_friction"]["asymmetry"]
    grown = 1 + effect["position_friction"]["growth"] * position_m / each.stroke_m
    spring = valve.spring_n_per_m + 3 * effect["spring_hardening"]["cubic_n_per_m3"] * position_m**2
    static_n, coulomb_n = (1 + asymmetry) * grown * valve.static_n, (1 + asymmetry) * grown * valve.coulomb_n
    gave_n = static_n + (1 - asymmetry) * grown * valve.coulomb_n
    gave_way_m = gave_n / effect["presliding"]["stiffness_n_per_m"] - effect["backlash"]["width_m"]
    return float(max((static_n - coulomb_n) / spring + gave_way_m, VISIBLE * each.stroke_m + 0.5 * each.quantum_m))


def least_excursion_m(each: Drawn, from_m: float, to_m: float) -> float:
    """Return the least excursion of a step, m: see the head of this module."""
    s = 1 if to_m > from_m else -1
    return max(shortest_slide_m(each, to_m, -s), shortest_slide_m(each, to_m, s) - abs(to_m - from_m))


NOT_LEFT = Alone()


def outcome(
    seed: int, steps: int, alone: Alone = NOT_LEFT, law: str = "slides", period_s: float | None = None
) -> tuple[Drawn, Outcome]:
    """Return a drawn valve, with a period of its own unless one is given, and what became of it."""
    rng = np.random.default_rng(seed)
    each = drawn(rng)
    each = each if period_s is None else replace(each, period_s=period_s)
    loop = Loop(each, rng, law)
    loop.identify()
    decision = loop.decision
    if decision.applied.ratios is None:
        return each, Outcome(
            decision.static_law.reason.name, 0.0, 0.0, loop.time_s, (), (), (), (), decision.inhibit_reason.name
        )
    took_s, worst = loop.time_s, probed(each, loop)
    residual = decision.static_law.residual_m / each.stroke_m
    stroke_m = each.stroke_m
    least_m = max(shortest_slide_m(each, 0.5 * stroke_m, s) for s in (1, -1))
    ratios = decision.applied.ratios
    bottom = max(0.1, (-ratios.k_over_c - ratios.offset_pa) / -ratios.b_over_c / each.stroke_m + 0.02)
    low, high = bottom + least_m / each.stroke_m + 0.03, 0.87 - least_m / each.stroke_m
    longest_s = 20.0 + 400 * each.period_s + 60 * each.lag_s
    at = 0.5 * (low + high)
    loop.step_to(at * each.stroke_m, longest_s)
    errors, taken, excursions = [], [], []
    for _ in range(steps):
        size = np.exp(rng.uniform(np.log(SMALLEST), np.log(LARGEST))) * rng.choice((-1, 1))
        before_m = loop.valve.indicated_m
        at = at + size if low < at + size < high else at - size
        at = min(max(at, low), high)
        taken.append(loop.step_to(at * stroke_m, longest_s))
        errors.append(loop.valve.indicated_m / stroke_m - at)
        excursions.append(taken[-1].beyond * stroke_m / least_excursion_m(each, before_m, at * stroke_m))
    allowed = max(WITHIN, each.quantum_m / each.stroke_m)
    why = loop.decision.inhibit_reason.name
    changes, strokes = loop.left_alone(alone) if alone.duration_s else (0, 0.0)
    return each, Outcome(
        "accepted",
        worst,
        residual,
        took_s,
        tuple(abs(e) <= allowed for e in errors),
        tuple(errors),
        tuple(taken),
        tuple(excursions),
        why,
        changes,
        strokes,
    )


HEAD = (
    "seed     ms  lag s  effects                            S3 s  off, deviations  residual %  landed  rms %"
    "  excursion  changes  strokes"
)
GROUPS_S = ((0.0, 5e-3), (5e-3, 20e-3), (20e-3, 60e-3), (60e-3, 1.0))
ALL_S = GROUPS_S[0][0], GROUPS_S[-1][1]


def line(seed: int, each: Drawn, found: Outcome) -> str:
    """Return what became of one valve."""
    names = ",".join(name.split("_")[0][:4] for name in sorted(each.present))
    head = f"{seed:4d} {1e3 * each.period_s:6.0f} {each.lag_s:6.2f}  {names:34s} {found.took_s:5.0f}"
    if found.reason != "accepted":
        return f"{head}  refused: {found.reason} {found.why}"
    head = f"{head} {found.worst:16.2f} {100 * found.residual:11.3f}"
    if not found.landed:
        return head
    rms = 100 * np.sqrt(np.mean(np.square(found.errors)))
    return (
        f"{head} {np.mean(found.landed):7.2f} {rms:6.3f}"
        f" {np.quantile(found.excursions, 0.9):10.2f} {found.changes:8d} {found.strokes:8.3f} {found.why}"
    )


def together(results: list[tuple[Drawn, Outcome]]) -> Iterator[str]:
    """Yield what all valves say together."""
    accepted = [found for _, found in results if found.reason == "accepted"]
    refused = Counter(found.reason for _, found in results if found.reason != "accepted")
    yield f"accepted {len(accepted)} of {len(results)}; refused: {dict(refused)}"
    wrong = sum(found.worst > DEVIATIONS for found in accepted)
    yield f"accepted, and off by more than three deviations somewhere: {wrong} valves"
    yield f"changed their command while left alone: {sum(found.changes > 0 for found in accepted)} valves"
    for low_s, high_s in (*GROUPS_S, ALL_S):
        group = [found for each, found in results if found.landed and low_s <= each.period_s < high_s]
        if not group:
            continue
        landed = 100 * np.mean([ok for found in group for ok in found.landed])
        yield (
            f"{1e3 * low_s:4.0f} to {1e3 * high_s:4.0f} ms: {landed:5.1f} % of {steps(group)} steps landed; "
            + "; ".join(
                f"{name} {said_of(found.excursions[part] for found in group)}"
                for name, part in (("excursion in the first steps", slice(LEARNING)), ("later", slice(LEARNING, None)))
            )
        )


def steps(group: list[Outcome]) -> int:
    """Return how many steps outcomes have."""
    return sum(len(found.landed) for found in group)


def said_of(parts: Iterable[tuple[float, ...]]) -> str:
    """Say how long excursions were, over the least; steps without one do not count."""
    ratios = np.array([ratio for part in parts for ratio in part if ratio > AN_EXCURSION])
    if not ratios.size:
        return "none"
    within = 100 * np.mean(ratios <= EXCURSION)
    middle, most = np.quantile(ratios, (0.5, 0.9))
    return f"median {middle:.2f}, 90 % {most:.2f}, within {EXCURSION} in {within:.0f} % of {ratios.size}"


def main() -> None:
    logging.disable(logging.CRITICAL)  # each lost reply has its line
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=50)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0, help="of the first valve")
    parser.add_argument("--left-alone-s", type=float, default=0.0)
    parser.add_argument("--disturbance", type=float, default=0.0, help="of an I/P that drifts, over the bench range")
    parser.add_argument("--reference-noise", type=float, default=0.0, help="of the stroke, every 0.5 s, meanwhile")
    parser.add_argument("--law", choices=law_names(), default="slides")
    parser.add_argument("--periods-ms", type=float, nargs="+", default=[], help="in place of the valves' own")
    arguments = parser.parse_args()
    alone = Alone(arguments.left_alone_s, arguments.disturbance, arguments.reference_noise)
    periods_s = [1e-3 * each for each in arguments.periods_ms] or [None]
    print(HEAD)
    results = []
    for seed in range(arguments.seed, arguments.seed + arguments.valves):
        for period_s in periods_s:
            results.append(outcome(seed, arguments.steps, alone, arguments.law, period_s))
            print(line(seed, *results[-1]), flush=True)
    print("", *together(results), sep="\n")


if __name__ == "__main__":
    main()
