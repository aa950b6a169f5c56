"""The daemon, assembled: `positioner run`.

Start: connect, hold the pressure the device has, look whether its measurement can be true, then serve. End (a signal,
or a thread that died; `end_signals`): stop serving, leave each valve in its configured safe state
(`assembled_valves`, `leave`), finish the recordings.

Valves whose cycles need more than one processor are shared among processes, a worker each; this one then serves their
registers at the one port, and starts a worker anew that has ended (`positioner.daemon.workers`).
"""

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from config.daemon_file import DaemonFile, SupervisoryTable
from config.extended_valve import ExtendedValve
from config.registers import WRITER_AT
from config.roles import Role
from config.tls_table import Tls
from fieldbus.modbus.admission import ServerLimits
from fieldbus.modbus.function_codes import Registers
from fieldbus.modbus.request_counts import RequestCounts
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard
from positioner.daemon.assembled_valves import AssembledValves, Share
from positioner.daemon.cycle_load import cycle_load
from positioner.daemon.end_signals import Endings
from positioner.daemon.history import HistoryKeeper
from positioner.daemon.logs import log_event, logging_valve, start_logging
from positioner.daemon.platform_needs import goes_without
from positioner.daemon.service_manager import ServiceManager
from positioner.daemon.workers import Workers

log = logging.getLogger(__name__)

SIGNAL_CHECK_S = 0.05
"""How often the main thread looks whether a signal came."""


class Served(Protocol):
    """All valves of the daemon, in this process or in others."""

    registers: Mapping[int, Registers]
    """Of each, by its unit."""

    def begin(self) -> None:
        """Cycle."""
        ...

    def look(self, wait_s: float) -> None:
        """Wait so long, and see to what has happened meanwhile."""
        ...

    @property
    def turns(self) -> Sequence[int]:
        """Counts that grow while all cycles turn."""
        ...

    def end(self, endings: Endings) -> None:
        """Cycle no more, and leave each valve in its safe state."""
        ...


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
    endings, manager, counts = Endings(), ServiceManager(), RequestCounts()
    with ExitStack() as on_exit:
        on_exit.callback(start_logging(files[0].log.level).stop)
        if lacks := goes_without():
            log_event(log, logging.WARNING, "cycles are less punctual on this system", without=lacks)
        shares = Share(files, extended, source, is_whole=True).split(_processes(files, source))
        history = HistoryKeeper(files[0].history, source.parent)
        on_exit.callback(lambda: history.stop(endings.reason or "it could not start"))
        served: Served
        if len(shares) == 1:
            served = AssembledValves(shares[0], counts, history, on_exit)
        else:
            served = Workers(shares, counts, history.offer, on_exit)
        history.start()
        server = _server(files[0].supervisory, served.registers, history, counts)
        server.start()
        on_exit.callback(server.stop)
        for file in files:
            with logging_valve(file.valve.name):
                unit, host = file.supervisory.unit, file.supervisory.host
                log_event(log, logging.INFO, "serving", host=host, port=server.port, unit=unit)
        try:
            served.begin()
            said = f"serving {', '.join(file.valve.name for file in files)} on {server.address}"
            print(said, flush=True)
            manager.ready(max(map(_slowest_s, files)), said)
            while not endings.came:
                served.look(SIGNAL_CHECK_S)
                manager.feed(served.turns)
        finally:
            manager.stopping(endings.reason)
            server.stop()
            served.end(endings)
        log_event(log, logging.INFO, "stopped", status=endings.status, reason=endings.reason)
    return endings.status


def _processes(files: Sequence[DaemonFile], source: Path) -> int:
    """Return how many processes are to cycle: as many as the file says, else as few as the valves need.

    Raises:
        InputError: they need much more than there is.
    """
    load = cycle_load(files)
    if load is not None:
        load.require_that_it_fits(str(source))
    return files[0].service.processes or (1 if load is None else load.needed)


def _slowest_s(file: DaemonFile) -> float:
    """Return how long one cycle may take, replies that do not come included."""
    return max(file.cycle.period_s, file.device.longest_exchange_s)


def _server(
    where: SupervisoryTable, registers: Mapping[int, Registers], history: HistoryKeeper, counts: RequestCounts
) -> RegisterServer:
    others = {unit: each for unit, each in registers.items() if unit != where.unit}
    return RegisterServer(
        registers[where.unit],
        where.host,
        where.port,
        where.unit,
        None if where.tls is None else guard_of(where.tls),
        others,
        _server_limits(where),
        history.session,
        counts,
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
