"""The daemon, assembled: `positioner run`.

Start: connect, hold the pressure the device has, look whether its measurement can be true, then serve. End (a signal,
or a thread that died): stop serving, leave each valve in its configured safe state, finish the recordings.
"""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event, Thread

from config.codes import EventKind
from config.daemon_file import DaemonFile, SupervisoryTable
from config.errors import InputError
from config.extended_valve import ExtendedValve
from config.registers import WRITER_AT
from config.roles import Role
from config.tls_table import Tls
from drivers import driver_for
from drivers.boundary import DriverError
from fieldbus.modbus.admission import ServerLimits
from fieldbus.modbus.request_counts import RequestCounts
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.control.travel.signal_path import SignalPath
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.cycle import Cycle, run_in_turn
from positioner.daemon.cycle_load import IMPOSSIBLE, cycle_load
from positioner.daemon.ending import Endings
from positioner.daemon.first_look import impossible
from positioner.daemon.health import Health, HealthKeeper, HealthSettings, StoredHealth, ne107_condition
from positioner.daemon.health.ne107 import Ne107Condition, classes_of
from positioner.daemon.history import HistoryKeeper, ValveHistory
from positioner.daemon.history.decision_events import Happened
from positioner.daemon.history.health_hours import HealthLook
from positioner.daemon.keeping import Keeping, Kept
from positioner.daemon.kept_alone import keep_alone
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.local_switch import locks_out
from positioner.daemon.logs import log_event, logging_valve, start_logging
from positioner.daemon.memory import MemoryKeeper, StoredMemory
from positioner.daemon.memory.conditions import conditions_of, pressure_scales
from positioner.daemon.pacing import DevicePace, Pace, RealTimePace, prepare_process, raise_above_cycles
from positioner.daemon.platform_needs import goes_without
from positioner.daemon.recorder import Recorder
from positioner.daemon.refinement_process import RefinementProcess
from positioner.daemon.service_manager import ServiceManager
from positioner.daemon.service_state import service_state
from positioner.daemon.supervisory_registers import SupervisoryRegisters

log = logging.getLogger(__name__)

SIGNAL_CHECK_S = 0.05
"""How often the main thread looks whether a signal came."""


@dataclass(frozen=True, slots=True)
class ServedValve:
    """One valve of the daemon, put together from its file."""

    file: DaemonFile
    settings: Settings
    link: Link
    controller: Controller
    cycle: Cycle
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


def serve(files: Sequence[DaemonFile], source: Path, extended: Sequence[ExtendedValve | None]) -> int:
    """Run the daemon of these valves until a signal stops it; return the exit status.

    The only valve's device must be there. Of several, one that is not there is a fault of that valve alone.

    Args:
        files: of each valve.
        source: what errors call them.
        extended: what `[law] valve` of each names.

    Raises:
        InputError: a device is not there or not as described, a port is taken, recordings cannot be written.
    """
    endings, manager = Endings(), ServiceManager()
    with ExitStack() as on_exit:
        on_exit.callback(start_logging(files[0].log.level).stop)
        if lacks := goes_without():
            log_event(log, logging.WARNING, "cycles are less punctual on this system", without=lacks)
        _refuse_overload(files, source)
        refinement = RefinementProcess()
        on_exit.callback(refinement.stop)
        history = HistoryKeeper(files[0].history, source.parent)
        on_exit.callback(lambda: history.stop(endings.reason or "it could not start"))
        paced = zip(files, extended, _paces(files), strict=True)
        valves = [
            _assembled(file, valve, pace, source, len(files) == 1, on_exit, refinement, history)
            for file, valve, pace in paced
        ]
        history.start()
        server = _server(valves, history)
        server.start()
        on_exit.callback(server.stop)
        for recorder in [valve.recorder for valve in valves if valve.recorder is not None]:
            recorder.start()
            on_exit.callback(recorder.stop)
        for valve in valves:
            _announce(valve, server.port)
            for keeper in valve.keepers:
                keeper.start()
                on_exit.callback(keeper.stop)
        keeping = Keeping([Kept(keeper, valve.name) for valve in valves for keeper in valve.keepers])
        keeping.start()
        on_exit.callback(keeping.stop)
        try:
            said = f"serving {', '.join(valve.name for valve in valves)} on {server.address}"
            print(said, flush=True)
            manager.ready(max(_slowest_s(valve.file) for valve in valves), said)
            _run(valves, server, endings, manager)
        finally:
            manager.stopping(endings.reason)
            _leave(valves)
        log_event(log, logging.INFO, "stopped", status=endings.status, reason=endings.reason)
    return endings.status


def _refuse_overload(files: Sequence[DaemonFile], source: Path) -> None:
    """Refuse valves whose cycles no such machine can run; warn of those that it cannot run in time.

    Raises:
        InputError: they need much more than there is.
    """
    load = cycle_load(files)
    if load is None or load.fits:
        return
    if load.share > IMPOSSIBLE:
        raise InputError(str(source), load.said)
    log_event(log, logging.WARNING, "the valves need more than there is", load=load.said)


def _assembled(
    file: DaemonFile,
    extended: ExtendedValve | None,
    pace: Pace,
    source: Path,
    is_alone: bool,
    on_exit: ExitStack,
    refinement: RefinementProcess,
    history: HistoryKeeper,
) -> ServedValve:
    keep_alone(file, source.parent, on_exit)
    settings = Settings.of(file, extended)
    link_settings = LinkSettings.of(file, settings.limits.restart_tolerance_pa)
    device = file.device.read_only() if file.cycle.shadow else file.device
    link = Link(driver_for(device), pace, link_settings)
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
    memory = _memory(file, extended, source)
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
            health, lambda: cycle.snapshot, file.valve.name, stored, partial(_tell_of_health, happened), alarms
        )
    ]
    if memory is not None:
        keepers.append(_memory_keeper(memory, file.valve.name, controller, cycle))
    return ServedValve(
        file, settings, link, controller, cycle, recorder, tuple(keepers), unreachable_reason, locked, alarms
    )


def _memory(file: DaemonFile, extended: ExtendedValve | None, source: Path) -> StoredMemory | None:
    if file.memory.folder is None:
        return None
    return StoredMemory.in_folder(source.parent / file.memory.folder, file.valve.name, conditions_of(file, extended))


def _memory_keeper(memory: StoredMemory, valve: str, controller: Controller, cycle: Cycle) -> MemoryKeeper:
    return MemoryKeeper(
        memory,
        valve,
        decided=lambda: cycle.snapshot.decision,
        knowledge=lambda: controller.knowledge,
        now_s=lambda: cycle.snapshot.sample.now_s,
    )


def _announce(valve: ServedValve, port: int) -> None:
    with logging_valve(valve.name):
        where = valve.file.supervisory
        log_event(log, logging.INFO, "serving", host=where.host, port=port, unit=where.unit)
        if valve.unreachable_reason is not None:
            log_event(log, logging.WARNING, "device is not there", reason=valve.unreachable_reason)


def _run(valves: Sequence[ServedValve], server: RegisterServer, endings: Endings, manager: ServiceManager) -> None:
    """Run the cycles until something ends the daemon; nobody is served any more once they stop.

    Each has a thread of its own, save that valves on one line share that line's.
    """
    stop = Event()
    lines = _by_line(valves)
    prepare_process(len(lines))
    threads = [
        Thread(
            target=run_in_turn, args=([valve.cycle for valve in together], stop), name=f"cycle of {together[0].name}"
        )
        for together in lines
    ]
    for thread in threads:
        thread.start()
    raise_above_cycles()
    try:
        while not endings.came:
            threads[0].join(SIGNAL_CHECK_S)
            manager.feed([valve.cycle.statistics.cycles for valve in valves])
    finally:
        server.stop()
        stop.set()
        for thread in threads:
            thread.join()


def _leave(valves: Sequence[ServedValve]) -> None:
    """Give each device the command of its safe action; lines at the same time, for a silent one takes its time-out."""
    lines = _by_line(valves)
    with ThreadPoolExecutor(len(lines)) as at_once:
        list(at_once.map(_leave_in_turn, lines))


def _leave_in_turn(valves: Sequence[ServedValve]) -> None:
    for valve in valves:
        valve.leave()


def _slowest_s(file: DaemonFile) -> float:
    """Return how long one cycle may take, replies that do not come included."""
    return max(file.cycle.period_s, file.device.longest_exchange_s)


def _by_line(valves: Sequence[ServedValve]) -> list[list[ServedValve]]:
    """Return the valves of each line together, each valve with a connection of its own alone."""
    lines: dict[object, list[ServedValve]] = {}
    for valve in valves:
        lines.setdefault(valve.file.device.line or valve.name, []).append(valve)
    return list(lines.values())


def _paces(files: Sequence[DaemonFile]) -> list[Pace]:
    """Return when each valve's cycle begins: in real time, each of several has its own slot of the period.

    On a line that keeps one that does not answer from taking the others' time; elsewhere it keeps them from asking for
    the interpreter at once.
    """
    if len(files) == 1:
        (file,) = files
        return [DevicePace() if file.cycle.pace == "device" else RealTimePace(file.cycle.period_s)]
    lines = [file.device.line for file in files]
    return [
        DevicePace()
        if file.cycle.pace == "device"
        else RealTimePace(
            file.cycle.period_s, file.cycle.period_s * lines[:index].count(line) / lines.count(line), may_spin=False
        )
        for index, (file, line) in enumerate(zip(files, lines, strict=True))
    ]


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


def _tell_of_health(history: ValveHistory, condition: Ne107Condition) -> None:
    history.happened(Happened(EventKind.HEALTH, condition.status, condition.cause))


def _server(valves: Sequence[ServedValve], history: HistoryKeeper) -> RegisterServer:
    first, *others = valves
    where, requests = first.file.supervisory, RequestCounts()
    return RegisterServer(
        first.served(requests),
        where.host,
        where.port,
        where.unit,
        None if (tls := first.file.supervisory.tls) is None else guard_of(tls),
        {valve.file.supervisory.unit: valve.served(requests) for valve in others},
        _server_limits(where),
        history.session,
        requests,
    )


def _server_limits(table: SupervisoryTable) -> ServerLimits:
    reserved = frozenset(table.reserved_hosts)
    return ServerLimits(
        table.most_clients,
        table.clients_per_host,
        reserved,
        table.requests_per_s,
        table.idle_s,
        table.allowed_networks,
    )


def guard_of(tls: Tls) -> Guard:
    """Return who may do what at the supervisory port."""
    # What nobody may write, the registers themselves refuse, and say so.
    return Guard(tls, lambda at: WRITER_AT.get(at, Role.OBSERVER))


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
    return Recorder(folder, file.valve.name, table.file_bytes, table.keep_files, table.file_s, table.compress)
