"""A simulated slave on whichever bus its file names: valve, device, clock and server put together."""

from pathlib import Path
from typing import TYPE_CHECKING

from config.canopen_device import require_can
from config.errors import InputError
from config.roles import Role
from config.slave_file import CanopenBus, ModbusRtuBus, ModbusTcpBus, SlaveFile, load_slave, valve_path
from config.valve_file import load_valve, require_air
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard
from sim.effect import find_effect
from sim.slave.clocks import Clock, clock_of
from sim.slave.device_registers import DeviceRegisters
from sim.slave.rtu_server import RtuServer
from sim.slave.simulated_device import Device
from sim.valve import Valve

if TYPE_CHECKING:
    from sim.slave.canopen_slave import NodeServer

VALVE_STEP_S = 1e-5
"""The integration step, or the period if that is shorter."""


class Slave:
    """A simulated slave, listening as soon as it is made.

    Args:
        path: the slave file.
        port: another TCP port, or channel of the loopback CAN bus, than the file's; 0 takes any free one.

    Raises:
        InputError: a fault in the slave file or its valve file, the bus cannot be opened, or the node id is taken.

    Attributes:
        address: where; ends in `:` and its port or channel.
    """

    def __init__(self, path: Path, port: int | None = None) -> None:
        file = load_slave(path)
        if isinstance(file.bus, CanopenBus):
            require_can(str(path), "bus.kind")
        device = device_of(file, valve_path(file, path))
        self._clock = clock_of(file, device)
        if isinstance(file.bus, CanopenBus):
            self._server: RegisterServer | RtuServer | NodeServer = _node(file.bus, device, self._clock, port, path)
        else:
            registers = DeviceRegisters(device, self._clock, file.bus.map)
            self._server = _register_server(registers, file.bus, port)
        self._server.start()
        self.address = self._server.address

    def catch_up(self) -> None:
        """Let the time pass that is due; call it often enough that no request has much to catch up."""
        with self._server.lock:
            self._clock.catch_up()

    def stop(self) -> None:
        """Leave the bus."""
        self._server.stop()


def _node(bus: CanopenBus, device: Device, clock: Clock, port: int | None, path: Path) -> "NodeServer":
    from fieldbus.canopen.loopback import free_channel
    from sim.slave.canopen_slave import NodeServer

    if port is not None:
        bus = bus.model_copy(update={"channel": free_channel() if port == 0 else str(port)})
    return NodeServer(bus, device, clock, str(path))


def _register_server(
    registers: DeviceRegisters, bus: ModbusTcpBus | ModbusRtuBus, port: int | None
) -> RegisterServer | RtuServer:
    if isinstance(bus, ModbusRtuBus):
        if port is not None:
            raise InputError("--listen-port", "is of Modbus TCP; the slave is on a serial line")
        return RtuServer(registers, bus.serial, bus.unit)
    # As a device has it: what an observer may not, an operator may.
    guard = Guard(bus.tls, lambda _: Role.OPERATOR) if bus.tls else None
    return RegisterServer(registers, bus.host, bus.port if port is None else port, bus.unit, guard)


def device_of(file: SlaveFile, valve_file: Path) -> Device:
    """Return the device of a slave file, its valve at rest.

    Raises:
        InputError: a fault in the valve file, or the changes contradict each other.
    """
    described = require_air(load_valve(valve_file), str(valve_file), "the simulated device obeys pressures")
    if any(find_effect(each.name, str(valve_file)).by_setpoint for each in described.effect):
        raise InputError(str(valve_file), "has a positioner: the simulated device obeys pressures, not set points")
    valve = Valve.from_file(described, step_s=min(VALVE_STEP_S, file.clock.period_s), source=str(valve_file))
    valve.rest_at(file.initial.position_m, file.initial.pressure_pa)
    return Device(valve, file, described.valve.model_dump(exclude={"name", "kind"}))
