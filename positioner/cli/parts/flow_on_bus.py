"""A case of `demo --loop flow` on wires: slave as a process, daemon's cycle and DCS each on Modbus TCP.

    slave process  <- FC23, a period of the valve per command ->  cycle, supervisory registers  <- FC3, FC16 ->  DCS

Device and cycle run in lockstep, so the time is the device's, and the DCS writes between two cycles: as fast as the
wires answer, and the same run every time. The process reads the position that the daemon measured.
"""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from config.codes import Mode
from config.device import ModbusTcpDevice
from config.errors import CommandFailed
from config.slave_file import SlaveFile
from config.travel import Travel
from drivers import driver_for
from fieldbus.modbus.server import RegisterServer
from positioner.cli.parts.children import port_in, running
from positioner.cli.parts.flow_cases import STROKE_M, FlowCase, FlowOutcome, flow_files, outcome_on
from positioner.control.requests import Requests
from positioner.daemon.cycle import Cycle
from positioner.daemon.snapshot import Snapshot
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from positioner.dcs import Dcs
from positioner.virtual.virtual_cycle import lockstep_cycle, played

REPLY_TIMEOUT_S = 5.0
IDENTIFY = {"eta_1": 0, "eta_2": 0, "eta_3": 0}
QUIET = {"eta_1": 1, "eta_2": 1, "eta_3": 1}


def outcome_on_modbus(case: FlowCase) -> FlowOutcome:
    """Run a case with everything on Modbus TCP.

    Raises:
        CommandFailed: the valve could not be identified, or a wire failed.
    """
    daemon, slave = flow_files(case)
    with ExitStack() as on_exit:
        folder = Path(on_exit.enter_context(TemporaryDirectory()))
        (folder / "slave.toml").write_text(_toml(slave))
        ready = on_exit.enter_context(running("sim", folder / "slave.toml", "--listen-port", "0"))
        device = ModbusTcpDevice(port=port_in(ready), reply_timeout_s=REPLY_TIMEOUT_S)
        cycle = lockstep_cycle(daemon, driver_for(device), Requests())
        on_exit.callback(cycle.link.release)
        limits = daemon.pressure
        registers = SupervisoryRegisters(cycle, Travel(STROKE_M), limits.minimum_pa, limits.maximum_pa)
        server = RegisterServer(registers, "127.0.0.1", 0, 1)
        server.start()
        on_exit.callback(server.stop)
        dcs = on_exit.enter_context(Dcs("127.0.0.1", server.port, timeout_s=REPLY_TIMEOUT_S))
        dcs.set("mode", Mode.AUTOMATIC)
        _identify(cycle, dcs, daemon.excitation.staircase_limit_s)
        return outcome_on(case, cycle, lambda reference_pu: dcs.set("reference", reference_pu))


def _identify(cycle: Cycle, dcs: Dcs, within_s: float) -> None:
    """Have the valve identified by the registers, the cycle going on between two requests."""
    dcs.set_all(IDENTIFY)

    def ask(_: Snapshot, __: Requests) -> Requests:
        if dcs.get("progress") >= 1:
            dcs.set_all(QUIET)
        return cycle.requests

    for snapshot in played(cycle, ask, cycle.snapshot.sample.time_s + within_s):
        if snapshot.decision.applied.count:
            return
    raise CommandFailed(f"not identified within {within_s:g} s")


def _toml(slave: SlaveFile) -> str:
    clock, sensor = slave.clock, slave.sensor
    return f"""[clock]
mode = "{clock.mode}"
period_s = {clock.period_s}
[sensor]
noise_std_m = {sensor.noise_std_m}
seed = {sensor.seed}
"""
