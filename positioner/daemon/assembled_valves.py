"""The valves of one process, put together from their files: cycles, registers, what is kept, recorded and looked at.

Each line has a thread that cycles, and valves on one line share it. At the end each device is given the command of its
safe action (`leave`); `positioner.control.settings` says which pressure that is (`safe_pa`).
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event, Thread

from config.codes import EventKind
from config.daemon_file import DaemonFile
from config.errors import InputError
from config.extended_valve import ExtendedValve
from drivers import driver_for
from drivers.boundary import DriverError
from fieldbus.modbus.function_codes import Registers
from fieldbus.modbus.request_counts import RequestCounts
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.control.travel.signal_path import SignalPath
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.backoff import Doors
from positioner.daemon.cycle import Cycle, run_in_turn
from positioner.daemon.cycles_together import SLOT_S, CyclesTogether
from positioner.daemon.end_signals import Endings
from positioner.daemon.first_look import impossible
from positioner.daemon.health import Health, HealthKeeper, HealthSettings, StoredHealth, ne107_condition
from positioner.daemon.health.ne107 import classes_of
from positioner.daemon.history import HistoryKeeper
from positioner.daemon.history.decision_events import Happened
from positioner.daemon.history.health_hours import HealthLook
from positioner.daemon.keeping_thread import Keeping
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.local_switch import locks_out
from positioner.daemon.logs import log_event, logging_valve
from positioner.daemon.memory import MemoryKeeper, StoredMemory
from positioner.daemon.memory.known_configuration import conditions_of, pressure_scales
from positioner.daemon.pacing import DevicePace, Pace, RealTimePace, prepare_process, raise_above_cycles
from positioner.daemon.recorder import Recorder
from positioner.daemon.refinement_process import RefinementProcess
from positioner.daemon.service_state import service_state
from positioner.daemon.sole_daemon import keep_alone
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from positioner.history.kept_tests import last_tested_s, records_folder

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Share:
    """Valves that one process runs: their files, what `[law] valve` of each names, and what errors call the file."""

    files: Sequence[DaemonFile]
    extended: Sequence[ExtendedValve | None]
    source: Path
    is_whole: bool
    """Whether these are all valves of the daemon."""

    @property
    def lines(self) -> list[list[int]]:
        """The places of the valves of each line together, each valve with a connection of its own alone."""
        lines: dict[object, list[int]] = {}
        for place, file in enumerate(self.files):
            lines.setdefault(file.device.line or file.valve.name, []).append(place)
        return list(lines.values())

    def split(self, number: int) -> "list[Share]":
        """Return so many shares at the most: valves of a line stay together, and loads are alike."""
        shares: list[list[int]] = [[] for _ in range(min(number, len(self.lines)))]
        for line in sorted(self.lines, key=lambda each: -sum(map(self._turns_per_s, each))):
            min(shares, key=lambda each: sum(map(self._turns_per_s, each))).extend(line)
        return [self._of(sorted(each)) for each in shares] if len(shares) > 1 else [self]

    def _turns_per_s(self, place: int) -> float:
        return 1.0 / self.files[place].cycle.period_s

    def _of(self, places: Sequence[int]) -> "Share":
        files, extended = [self.files[each] for each in places], [self.extended[each] for each in places]
        return Share(files, extended, self.source, is_whole=False)


@dataclass(frozen=True, slots=True)
class ServedValve:
    """One valve of the daemon, put together from its file."""

    file: DaemonFile
    settings: Settings
    link: Link
    controller: Controller
    cycle: Cycle
    pace: Pace
    recorder: Recorder | None
    keepers: tuple[HealthKeeper | MemoryKeeper, ...]
    """Of its health, and of what is known of it."""
    unreachable_reason: str | None
    """Why its device could not be reached at the start; the cycle goes on asking."""
    locked: Callable[[], bool]
    """Whether the local switch locks out."""
    alarms: AlarmList

    @property
    def name(self) -> str:
        """Its name."""
        return self.file.valve.name

    def served(self, requests: RequestCounts) -> SupervisoryRegisters:
        """Return its supervisory registers, the server's counts among them."""
        settings = self.settings
        state = partial(service_state, limits=settings.limits, shadow=self.file.cycle.shadow)
        return SupervisoryRegisters(
            self.cycle,
            self.file.valve.travel,
            settings.minimum_pa,
            settings.maximum_pa,
            self.name,
            state,
            requests,
            self.locked,
            SignalPath.of(self.file.travel),
            self.alarms,
        )

    def leave(self) -> None:
        """Give the device the command of the safe action."""
        with logging_valve(self.name):
            try:
                action = self.file.safety.action
                self.link.leave(self.settings.safe_pa(action, self.controller.left_pa), holds=action == "hold")
            except Exception:  # a driver that is not ours must not keep the other valves from theirs
                log.exception("the valve could not be left as configured")


class AssembledValves:
    """All of them, from their files to their safe state.

    Args:
        share: which.
        counts: of requests, which their registers show.
        history: that they are entered in.
        on_exit: ends what it begins.

    Raises:
        InputError: a device is not as described, or the only valve's is not there; another daemon keeps what is kept.
    """

    def __init__(self, share: Share, counts: RequestCounts, history: HistoryKeeper, on_exit: ExitStack) -> None:
        self._on_exit = on_exit
        refinement, doors = RefinementProcess(), Doors()
        on_exit.callback(refinement.stop)
        is_alone = share.is_whole and len(share.files) == 1
        paced = zip(share.files, share.extended, _paces(share.files, is_alone=is_alone), strict=True)
        self._valves = [
            _assembled(file, valve, pace, share.source, is_alone, on_exit, refinement, doors, history)
            for file, valve, pace in paced
        ]
        self._lines = [[self._valves[each] for each in line] for line in share.lines]
        self._stop = Event()
        ahead = [
            (valve.cycle, valve.pace)
            for (valve, *others) in self._lines
            if not others and isinstance(valve.pace, RealTimePace) and valve.link.reply_timeout_s is not None
        ]
        self._together = CyclesTogether(ahead, self._stop) if len(ahead) > 1 else None
        asked = {cycle for cycle, _ in ahead} if self._together else set()
        self._threads = [
            Thread(
                target=run_in_turn,
                args=([valve.cycle for valve in together], self._stop),
                name=f"cycle of {together[0].name}",
            )
            for together in self._lines
            if together[0].cycle not in asked
        ]
        if self._together is not None:
            self._threads.append(Thread(target=self._together.run, name=f"cycles of {len(ahead)} valves"))
        self.registers: Mapping[int, Registers] = {
            valve.file.supervisory.unit: valve.served(counts) for valve in self._valves
        }

    def begin(self) -> None:
        """Cycle, record and keep."""
        for valve in self._valves:
            if valve.unreachable_reason is not None:
                with logging_valve(valve.name):
                    log_event(log, logging.WARNING, "device is not there", reason=valve.unreachable_reason)
            if valve.recorder is not None:
                valve.recorder.start()
                self._on_exit.callback(valve.recorder.stop)
            for keeper in valve.keepers:
                keeper.start()
                self._on_exit.callback(keeper.stop)
        keeping = Keeping([keeper for valve in self._valves for keeper in valve.keepers])
        keeping.start()
        self._on_exit.callback(keeping.stop)
        prepare_process(len(self._threads))
        for thread in self._threads:
            thread.start()
        raise_above_cycles()

    def look(self, wait_s: float) -> None:
        """Wait so long."""
        self._threads[0].join(wait_s)

    @property
    def turns(self) -> list[int]:
        """How often each has cycled."""
        return [valve.cycle.statistics.cycles for valve in self._valves]

    def end(self, _endings: Endings) -> None:
        """Cycle no more, and give each device its last command; lines at the same time, for a silent one takes long."""
        self._stop.set()
        if self._together is not None:
            self._together.wake()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()
        with ThreadPoolExecutor(len(self._lines)) as at_once:
            list(at_once.map(_leave_in_turn, self._lines))


def _assembled(
    file: DaemonFile,
    extended: ExtendedValve | None,
    pace: Pace,
    source: Path,
    is_alone: bool,
    on_exit: ExitStack,
    refinement: RefinementProcess,
    doors: Doors,
    history: HistoryKeeper,
) -> ServedValve:
    keep_alone(file, source.parent, on_exit)
    settings = Settings.of(file, extended)
    link_settings = LinkSettings.of(file, settings.limits.restart_tolerance_pa)
    device = file.device.read_only() if file.cycle.shadow else file.device
    link = Link(driver_for(device), pace, link_settings, doors)
    on_exit.callback(link.release)
    where = str(source) if is_alone else f"{source}: valve {file.valve.name}"
    unreachable_reason = None
    try:
        held_pa, reading = link.open()
    except DriverError as error:
        if is_alone:
            raise InputError(where, f"device: {error}") from None
        held_pa, unreachable_reason = settings.minimum_pa, str(error)
    else:
        if said := impossible(file, held_pa, reading, settings.limits):
            raise InputError(where, said)
    recorder = _recorder(file, source)
    memory = (
        None
        if file.memory.folder is None
        else StoredMemory.in_folder(source.parent / file.memory.folder, file.valve.name, conditions_of(file, extended))
    )
    controller = Controller(
        settings,
        held_pa,
        refinement.refiner(blocking=file.cycle.pace == "device"),
        memory.kept.knowledge if memory else None,
    )
    stored = (
        None
        if file.health.folder is None
        else StoredHealth.in_folder(source.parent / file.health.folder, file.valve.name, pressure_scales(file))
    )
    health = Health(HealthSettings.of_file(file), stored.kept.record if stored else None)
    with logging_valve(file.valve.name):
        happened = history.valve(file, health.settings.fault_classes)
        cycle = Cycle(link, controller, pace, _first_requests(file), recorder, file.valve.name, health, happened)
    happened.look = partial(_look, cycle, health)
    locked = happened.locked = locks_out(file.supervisory.local_switch)
    alarms = AlarmList(
        lambda kind, status, cause: happened.happened(Happened(kind, status, cause)),
        lambda cause: classes_of(health)[cause],
    )
    keepers: list[HealthKeeper | MemoryKeeper] = [
        HealthKeeper(
            health,
            lambda: cycle.snapshot,
            file.valve.name,
            stored,
            lambda now: happened.happened(Happened(EventKind.HEALTH, now.status, now.cause)),
            alarms,
        )
    ]
    health.watch.tested(last_tested_s(records_folder(file, source)))
    if memory is not None:
        keepers.append(
            MemoryKeeper(
                memory,
                file.valve.name,
                decided=lambda: cycle.snapshot.decision,
                knowledge=lambda: controller.knowledge,
                now_s=lambda: cycle.snapshot.sample.now_s,
            )
        )
    return ServedValve(
        file, settings, link, controller, cycle, pace, recorder, tuple(keepers), unreachable_reason, locked, alarms
    )


def _leave_in_turn(valves: Sequence[ServedValve]) -> None:
    for valve in valves:
        valve.leave()


def _paces(files: Sequence[DaemonFile], *, is_alone: bool) -> list[Pace]:
    """Return when each valve's cycle begins: in real time, each of several has its own slot of the period.

    On a line that keeps one that does not answer from taking the others' time; elsewhere it keeps them from asking for
    the interpreter at once.
    """
    if is_alone:
        (file,) = files
        return [DevicePace() if file.cycle.pace == "device" else RealTimePace(file.cycle.period_s)]
    lines = [file.device.line for file in files]
    return [
        DevicePace()
        if file.cycle.pace == "device"
        else RealTimePace(
            file.cycle.period_s,
            _phase_s(file.cycle.period_s, lines[:index].count(line), lines.count(line), together=line is None),
            may_spin=False,
        )
        for index, (file, line) in enumerate(zip(files, lines, strict=True))
    ]


def _phase_s(period_s: float, number: int, valves: int, *, together: bool) -> float:
    """Return when in its period one of so many valves begins; those that one thread asks, together in slots."""
    slots = max(1, int(period_s / SLOT_S)) if together else valves
    return period_s * int(number * slots / valves) / slots


def _look(cycle: Cycle, health: Health) -> HealthLook:
    """Return a valve's health and counts as they are now."""
    statistics, counts = cycle.statistics, cycle.link.counts
    return HealthLook(
        ne107_condition(cycle.snapshot.decision, health).status,
        health.record,
        health.friction_pa,
        statistics.cycles,
        statistics.missed_periods,
        counts.lost_samples,
        counts.lost_replies,
        cycle.recorder.unrecorded if cycle.recorder else 0,
    )


def _first_requests(file: DaemonFile) -> Requests:
    return Requests(
        alpha_pa=file.excitation.alpha_pa,
        beta_pa=file.excitation.beta_pa,
        omega_rad_per_s=file.excitation.omega_rad_per_s,
    )


def _recorder(file: DaemonFile, source: Path) -> Recorder | None:
    if file.recorder is None:
        return None
    folder = source.parent / file.recorder.folder
    table = file.recorder
    return Recorder(
        folder, file.valve.name, table.file_bytes, table.keep_files, table.file_s, table.compress, file.valve.kind
    )
