"""Every fault of device, wire and gateway in every state of the service, on each bus: does it end as documented?

    python -m benchmarks.campaign [--buses modbus tls rtu canopen] [--every 1]
        [--keep FILE...] [--only-kept]

A case is a bus, a state, a safe action and a fault. The simulated valve is in lockstep, the gateway's clock is given,
so only time-outs take time. The valve is brought into the state, the fault begins, and after it:

    fault       the one documented, within its cycles; a single lost reply is none
    wire        no command outside the limits; in shadow none at all
    samples     none is published as good twice
    estimates   what an identification applied in spite of it is right within 5 %
    recovery    an acknowledgement moves nothing; mode and reference are followed again

Exit status 1 when a case does otherwise; it is printed. With --keep it may be broken off; the same command goes on.
"""

import argparse
import json
import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest.mock import patch

from benchmarks.faulty_wire import LATE_S, Side, faults_on, on_bus
from config.codes import Fault, Mode, Quality, State
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from drivers import driver_for
from drivers.boundary import DriverError
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.daemon import link as link_module
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.pacing import DevicePace
from positioner.daemon.snapshot import Snapshot
from positioner.testing.wire_faults import Spoiler
from sim.slave.clocks import Lockstep
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of

MOST_OPENINGS = 5
PERIOD_S, STALL_S, SILENCE_S = 2e-3, 2.0, 0.1
WINDOW, AFTER = 130, 90
"""Cycles with the fault, and after it."""
MANY = {"modbus": 8, "tls": 40, "rtu": 8, "canopen": 8}
"""Replies spoilt, where it is not one; on TLS records, of which each handshake has some."""
VALVE = load_valve(shipped_valve("seed"))
STROKE_M = VALVE.valve.stroke_m
SLOPE_PA_PER_M = -VALVE.valve.spring_n_per_m / VALVE.valve.diaphragm_area_m2
FRICTION_PA = -VALVE.valve.coulomb_n / VALVE.valve.diaphragm_area_m2
HELD_PA, HELD_M, MOST_PA = 24e3, 0.03, 420e3
RIGHT_WITHIN = 0.05
BUSES = ("modbus", "tls", "rtu", "canopen")
STATES = ("shadow", "standby", "manual", "S1 up", "S2 down", "S3", "fault")
ACTIONS = ("hold", "vent")


@dataclass(frozen=True, slots=True)
class FaultCase:
    """A fault, what it must end in (NONE among them: it may be none), and within how many cycles."""

    name: str
    ends_in: frozenset[Fault]
    cycles: int = 0
    device: dict[str, object] = field(default_factory=dict)
    """Table `[[fault]]` of the simulated device, without its time."""
    wire: tuple[str, int] = ("", 0)


def _ends(*faults: Fault) -> frozenset[Fault]:
    return frozenset(faults)


LOST = _ends(Fault.NO_REPLY, Fault.RESTARTED)
NONE = _ends(Fault.NONE)
DEVICE_FAULTS = (
    FaultCase("device drops", LOST, 6, {"kind": "drop", "over_s": 8 * PERIOD_S}),
    FaultCase("device freezes", _ends(Fault.STALE), 60, {"kind": "freeze", "over_s": 0.2}),
    FaultCase("device restarts", _ends(Fault.RESTARTED, Fault.NONE), 6, {"kind": "restart"}),
    FaultCase("sensor jumps", _ends(Fault.POSITION_RATE), 3, {"kind": "jump", "by_m": 0.03}),
    FaultCase("sensor spikes", _ends(Fault.POSITION_RATE), 3, {"kind": "jump", "by_m": 0.03, "over_s": PERIOD_S}),
    FaultCase("sensor drifts", NONE, 0, {"kind": "drift", "by_m": 0.01, "over_s": 0.2}),
    FaultCase("sensor says NaN", _ends(Fault.IMPLAUSIBLE), 6, {"kind": "nan", "over_s": 0.05}),
    FaultCase("supply falls", NONE, 0, {"kind": "supply", "to_pa": 10e3, "over_s": 0.1}),
)
OTHERS = (
    FaultCase("friction doubles", NONE),
    FaultCase("another master writes", _ends(Fault.OTHER_MASTER), 3),
    FaultCase("another master stops the node", _ends(Fault.DEVICE, Fault.NO_REPLY), 20),
    FaultCase("the daemon stands still", _ends(Fault.STALLED), 2),
    FaultCase("the DCS falls silent", _ends(Fault.DCS_SILENT), 60),
)
ON_MODBUS = ("device drops", "device restarts")
"""What a CANopen node cannot show so: it boots, or is silent, which the wire's faults are."""


def cases_on(bus: str) -> Iterator[FaultCase]:
    """Yield the faults that a bus can have."""
    for kind in faults_on(bus):
        yield FaultCase(f"{kind}, one", NONE, 0, wire=(kind, 1))
        may_pass = {Fault.NONE} if kind in ("duplicate", "reorder") else set()
        yield FaultCase(f"{kind}, many", LOST | may_pass, 12, wire=(kind, MANY[bus]))
    yield from (each for each in DEVICE_FAULTS if bus != "canopen" or each.name not in ON_MODBUS)
    yield from (each for each in OTHERS if bus == "canopen" or "node" not in each.name)


@dataclass(frozen=True, slots=True)
class Case:
    """A bus, a state, a safe action, a fault."""

    bus: str
    state: str
    action: str
    fault: FaultCase

    def __str__(self) -> str:
        return f"{self.bus}, {self.state}, {self.action}: {self.fault.name}"


@dataclass(slots=True)
class Outcome:
    """What a case ended in."""

    fault: Fault
    cycles: int
    violations: list[str]


def all_cases(buses: Sequence[str]) -> list[Case]:
    """Return every case."""
    return [
        Case(bus, state, action, fault)
        for bus in buses
        for fault in cases_on(bus)
        for state in STATES
        for action in (ACTIONS if state != "shadow" else ACTIONS[:1])
    ]


class _Pace(DevicePace):
    """The gateway's clock, given."""

    now = 0.0

    def now_s(self, device_time_s: float | None) -> float:  # noqa: ARG002 - ages are by the gateway's clock
        """Return it."""
        return self.now


class _Recorded(Lockstep):
    """Lockstep that notes what reaches the device."""

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self.commands: list[float] = []

    def command(self, command_pa: float) -> None:
        """Note and obey."""
        self.commands.append(command_pa)
        super().command(command_pa)


class Trial:
    """One valve on its bus, brought into a state."""

    def __init__(self, case: Case, device: Device, clock: _Recorded, pace: _Pace, cycle: Cycle) -> None:
        self.case, self.device, self.clock, self.cycle = case, device, clock, cycle
        self._pace = pace
        self.heart_beats = True
        self.good_s: list[float] = []

    @property
    def snapshot(self) -> Snapshot:
        """What the last cycle left."""
        return self.cycle.snapshot

    def ask(self, **values: object) -> None:
        """Write registers, as the DCS does."""
        counts = {"reference_m": "reference_writes", "mode": "mode_writes", "manual_pa": "manual_writes"}
        written = {count: getattr(self.cycle.requests, count) + 1 for name, count in counts.items() if name in values}
        self.cycle.requests = replace(self.cycle.requests, **values, **written)  # type: ignore[arg-type]

    def run(self, cycles: int, until: Callable[[Snapshot], bool] = lambda _: False) -> int:
        """Run so many cycles, or until something holds; return how many it took."""
        for number in range(1, cycles + 1):
            self._pace.now += PERIOD_S
            if self.heart_beats:
                self.ask(heartbeats=self.cycle.requests.heartbeats + 1)
            if self.case.state == "shadow" and not self.device.drops:
                self.device.tick(self.device.command_pa)  # whoever drives it
            self.cycle.once()
            if self.snapshot.sample.quality is Quality.GOOD:
                self.good_s.append(self.snapshot.sample.time_s)
            if until(self.snapshot):
                return number
        return cycles

    def stall(self) -> None:
        """Let the gateway stand still."""
        self._pace.now += STALL_S

    def enter(self) -> None:
        """Bring it into the state."""
        self.run(5)
        match self.case.state:
            case "manual":
                self.ask(mode=Mode.MANUAL, manual_pa=40e3)
                self.run(20)
            case "S1 up" | "S2 down":
                self.ask(mode=Mode.AUTOMATIC, reference_m=0.05 if self.case.state == "S1 up" else 0.01)
                self.run(8)
            case "S3":
                self.ask(mode=Mode.AUTOMATIC, eta=(0, 0, 0), alpha_pa=44126.0, beta_pa=13238.0)
                self.run(150)
            case "fault":
                self.stall()
                self.run(3)


def run_case(case: Case) -> Outcome:
    """Run a case."""
    change = [{"at_s": 1e3, "coulomb_n": 1.0}]
    slave = SlaveFile.model_validate(
        {
            "clock": {"mode": "lockstep", "period_s": PERIOD_S},
            "sensor": {"noise_std_m": 1e-5},
            "initial": {"position_m": HELD_M, "pressure_pa": HELD_PA},
            "change": change,
        }
    )
    device = device_of(slave, shipped_valve("seed"))
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": STROKE_M},
            "law": {"b_over_c_pa_per_m": SLOPE_PA_PER_M, "k_over_c_pa": FRICTION_PA},
            "cycle": {"pace": "device", "shadow": case.state == "shadow"},
            "safety": {"action": case.action, "stale_after_s": 0.1, "heartbeat_timeout_s": SILENCE_S},
            "supervision": {"position_rate": {"threshold": 60.0, "action": case.action}},
        }
    )
    clock, spoiler, pace = _Recorded(device), Spoiler(LATE_S), _Pace()
    with (
        patch.object(link_module, "awake_s", lambda: pace.now),
        on_bus(case.bus, device, clock, spoiler) as (table, side),
    ):
        shadow, settings = file.cycle.shadow, Settings.of(file)
        driver = driver_for(table.read_only() if shadow else table)
        often = "another master" in case.fault.name
        read_back_s = 0.0 if shadow else PERIOD_S / 2 if often else 50 * PERIOD_S
        link = Link(
            driver,
            pace,
            LinkSettings(0.5, read_back_s, settings.limits.restart_tolerance_pa, shadow=shadow),
        )
        try:
            held_pa = _opened(link)
            link.begin()
            cycle = Cycle(link, Controller(settings, held_pa), pace, Requests(), None)
            trial = Trial(case, device, clock, pace, cycle)
            trial.enter()
            return _judged(trial, spoiler, side, settings)
        finally:
            driver.close()


def _opened(link: Link) -> float:
    """Return the command that the device holds; of a machine too busy for its answer it is asked again."""
    for _ in range(MOST_OPENINGS):
        with suppress(DriverError):
            return link.open()[0]
    return link.open()[0]


def _judged(trial: Trial, spoiler: Spoiler, side: Side, settings: Settings) -> Outcome:
    case, violations = trial.case, list[str]()
    before = trial.snapshot.decision
    _begin(trial, spoiler, side)
    cycles = trial.run(WINDOW, lambda now: now.decision.fault not in (Fault.NONE, before.fault))
    found = trial.snapshot.decision
    expected = _expected(case)
    if found.fault not in expected:
        violations.append(f"ended in {found.fault.name} after {cycles} cycles")
    if found.fault not in (Fault.NONE, before.fault):
        if cycles > case.fault.cycles:
            violations.append(f"took {cycles} cycles, allowed are {case.fault.cycles}")
        if found.mode is not Mode.HOLD:
            violations.append(f"mode {found.mode.name}")
        action = settings.limits.action_on(found.fault)
        if action == "vent" and found.command_pa != 0.0:
            violations.append(f"vents with {found.command_pa:g} Pa")
    spoiler.begin("", 0)
    trial.heart_beats = True
    if side.start_node is not None:
        side.start_node()  # a node that was stopped is left to whoever stopped it
    trial.run(AFTER)
    violations += _recovery(trial)
    violations += _always(trial, settings)
    return Outcome(found.fault, cycles, violations)


def _begin(trial: Trial, spoiler: Spoiler, side: Side) -> None:
    fault, device = trial.case.fault, trial.device
    now_s = device.samples * PERIOD_S
    if fault.device:
        device.suffer({**fault.device, "at_s": now_s + PERIOD_S / 2})
    elif fault.wire[1]:
        spoiler.begin(*fault.wire)
    elif fault.name == "friction doubles":
        device.change_valve(coulomb_n=2.0 * VALVE.valve.coulomb_n, static_n=2.0 * VALVE.valve.static_n)
    elif fault.name == "another master writes":
        side.write_set_point(trial.snapshot.decision.command_pa + 5e3)
    elif side.stop_node is not None and "node" in fault.name:
        side.stop_node()
    elif fault.name == "the daemon stands still":
        trial.stall()
    else:
        trial.heart_beats = False


def _expected(case: Case) -> frozenset[Fault]:
    """Return what a case may end in: what was latched before stays, and nobody is missed where nobody commands."""
    expected = case.fault.ends_in
    commanded = case.state in ("manual", "S1 up", "S2 down", "S3")
    if case.fault.name == "the DCS falls silent" and not commanded:
        expected = NONE
    if case.fault.name == "another master writes" and case.state == "shadow":
        expected = NONE
    if case.fault.wire[1] and case.state == "shadow" and case.bus == "canopen":
        expected = expected | NONE  # it is read by SDO, and no TPDO is asked for
    return expected | ({Fault.STALLED} if case.state == "fault" else set())


def _recovery(trial: Trial) -> Iterator[str]:
    """Acknowledge, choose a mode and write a reference: yield what is not as documented."""
    if trial.case.state == "S3":
        trial.ask(eta=QUIET)
        trial.run(3)
        applied = trial.snapshot.decision.applied
        if applied.count and applied.ratios is not None and trial.case.fault.name != "friction doubles":
            for found, true in ((applied.ratios.b_over_c, SLOPE_PA_PER_M), (applied.ratios.k_over_c, FRICTION_PA)):
                if abs(found / true - 1.0) > RIGHT_WITHIN:
                    yield f"applied {found:g}, true is {true:g}"
    if trial.snapshot.decision.fault is Fault.NONE:
        return
    held_pa = trial.snapshot.decision.command_pa
    trial.ask(acknowledgements=trial.cycle.requests.acknowledgements + 1)
    trial.run(3)
    free = trial.snapshot.decision
    if free.fault is not Fault.NONE or free.mode is not Mode.HOLD:
        yield f"not free after the acknowledgement: {free.fault.name}, {free.mode.name}"
    if trial.case.state == "shadow":
        return
    if free.command_pa != held_pa:
        yield f"the acknowledgement moves it from {held_pa:g} to {free.command_pa:g} Pa"
    trial.ask(mode=Mode.AUTOMATIC, eta=QUIET)
    trial.run(2)
    trial.ask(reference_m=trial.snapshot.sample.position_m + 0.01)
    trial.run(3)
    if trial.snapshot.decision.state is not State.S1_UP:
        yield f"does not follow again: {trial.snapshot.decision.state.name}"


def _always(trial: Trial, settings: Settings) -> Iterator[str]:
    commands = trial.clock.commands
    if trial.case.state == "shadow" and commands:
        yield f"{len(commands)} commands in shadow"
    if any(not settings.minimum_pa <= each <= settings.maximum_pa for each in commands):
        yield f"commands from {min(commands):g} to {max(commands):g} Pa"
    if any(after == before for before, after in zip(trial.good_s, trial.good_s[1:], strict=False)):
        yield "a sample was published as good twice"


def table(outcomes: Sequence[tuple[Case, Outcome]]) -> list[str]:
    """Return the table: a row a fault, with its cases on all buses, what they ended in, and the most cycles to it."""
    by_fault: dict[str, list[tuple[Case, Outcome]]] = defaultdict(list)
    for case, outcome in outcomes:
        by_fault[case.fault.name].append((case, outcome))
    bad = sum(bool(outcome.violations) for _, outcome in outcomes)
    head = ["| fault | cases | ends in | most cycles to it |", "|---|---|---|---|"]
    return [f"{len(outcomes)} cases, {bad} not as documented.", "", *head, *map(_row, by_fault, by_fault.values())]


def _row(name: str, outcomes: Sequence[tuple[Case, Outcome]]) -> str:
    new = [(case, each) for case, each in outcomes if each.fault is not Fault.NONE]
    new = [(case, each) for case, each in new if case.state != "fault" or each.fault is not Fault.STALLED]
    names = sorted({each.fault.name.lower().replace("_", " ") for _, each in new}) or ["none"]
    most = max((each.cycles for _, each in new), default="")
    return f"| {name} | {len(outcomes)} | {', '.join(names)} | {most} |"


def _kept(path: Path) -> dict[str, Outcome]:
    """Return what earlier runs found, by case."""
    if not path.exists():
        return {}
    lines = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return {case: Outcome(Fault(fault), cycles, violations) for case, fault, cycles, violations in lines}


def main() -> int:
    """Run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--buses", nargs="+", choices=BUSES, default=BUSES)
    parser.add_argument("--every", type=int, default=1, help="run every n-th case")
    parser.add_argument("--keep", type=Path, nargs="+", default=(), help="what was found; added to the first")
    parser.add_argument("--only-kept", action="store_true", help="the table of what was found so far")
    arguments = parser.parse_args()
    logging.disable(logging.CRITICAL)
    outcomes, kept = [], {case: each for path in arguments.keep for case, each in _kept(path).items()}
    for case in all_cases(arguments.buses)[:: arguments.every]:
        if arguments.only_kept and str(case) not in kept:
            continue
        outcome = kept.get(str(case)) or run_case(case)
        outcomes.append((case, outcome))
        if arguments.keep and str(case) not in kept:
            with arguments.keep[0].open("a", encoding="utf-8") as file:
                file.write(json.dumps([str(case), outcome.fault, outcome.cycles, outcome.violations]) + "\n")
        for violation in outcome.violations:
            print(f"{case}: {violation}", flush=True)
    print("\n".join(table(outcomes)))
    return 1 if any(outcome.violations for _, outcome in outcomes) else 0


if __name__ == "__main__":
    raise SystemExit(main())
