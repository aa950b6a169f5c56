"""A simulated device in lockstep on each bus, its wire spoilt on demand: what `benchmarks.campaign` tries.

Kinds of fault are those of `positioner.testing.wire_faults`.

Modbus TCP through a proxy that knows frames, on TLS through one that knows records, all that a wire sees there: one
that is spoilt ends the session, and those of a handshake are spoilt, too. RTU through a line that carries whole frames;
CANopen at the node, whose replies are its TPDOs. A corrupt CAN frame is none (its check sum): there, and where a bus
has no connection, the case is left out.
"""

import os
import select
import socket
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from threading import Thread

from config.canopen_device import CanBus, CanopenDevice
from config.device import Device as DeviceTable
from config.device import ModbusRtuDevice, ModbusTcpDevice
from config.roles import Role
from config.serial_port import SerialPort
from fieldbus.canopen.loopback import free_channel
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard
from positioner.testing.fault_proxy import spoilt_wire
from positioner.testing.wire_faults import WIRE_FAULTS, Spoiler
from sim.slave import canopen_slave
from sim.slave.canopen_slave import NodeServer
from sim.slave.clocks import Clock
from sim.slave.device_registers import DeviceRegisters
from sim.slave.rtu_server import RtuServer
from sim.slave.simulated_device import Device
from tests.certificates import tls

REPLY_TIMEOUT_S = 0.25
"""Long enough for a busy machine: what is late here is so on purpose."""
LATE_S = 1.3 * REPLY_TIMEOUT_S
NOT_ON = {"canopen": {"corrupt", "disconnect"}, "rtu": {"disconnect"}, "modbus": set[str](), "tls": set[str]()}
HANDSHAKE_TIMEOUT_S = 0.4
RECORD_HEADER, ENCRYPTED = 5, 23
"""Type, version and length of a TLS record (RFC 8446, section 5.1), and the type of those that say something."""


@contextmanager
def on_bus(bus: str, device: Device, clock: Clock, spoiler: Spoiler) -> Iterator[tuple[DeviceTable, "Side"]]:
    """Put a device on a bus; give the daemon's table of it, and its far side."""
    with ExitStack() as stack:
        yield {"modbus": _tcp, "tls": _tls, "rtu": _rtu, "canopen": _canopen}[bus](device, clock, spoiler, stack)


class Side:
    """The device's side of a bus: what another master does there."""

    def __init__(
        self, device: Device, start_node: Callable[[], None] | None = None, stop_node: Callable[[], None] | None = None
    ) -> None:
        self._device = device
        self.start_node, self.stop_node = start_node, stop_node
        """Start and stop the node by NMT, where there is such."""

    def write_set_point(self, command_pa: float) -> None:
        """Command it, as another master would."""
        self._device.command_pa = command_pa


def _tcp(device: Device, clock: Clock, spoiler: Spoiler, stack: ExitStack) -> tuple[DeviceTable, Side]:
    server = RegisterServer(DeviceRegisters(device, clock), "127.0.0.1", 0, 1)
    server.start()
    stack.callback(server.stop)
    port = stack.enter_context(spoilt_wire(server.port, spoiler))
    return ModbusTcpDevice(port=port, reply_timeout_s=REPLY_TIMEOUT_S), Side(device)


def _tls(device: Device, clock: Clock, spoiler: Spoiler, stack: ExitStack) -> tuple[DeviceTable, Side]:
    guard = Guard(tls("device", handshake_timeout_s=HANDSHAKE_TIMEOUT_S), lambda _: Role.OPERATOR)
    server = RegisterServer(DeviceRegisters(device, clock), "127.0.0.1", 0, 1, guard)
    server.start()
    stack.callback(server.stop)
    port = stack.enter_context(spoilt_wire(server.port, spoiler, _carry_secured))
    secured = tls("daemon", handshake_timeout_s=HANDSHAKE_TIMEOUT_S)
    return ModbusTcpDevice(port=port, reply_timeout_s=REPLY_TIMEOUT_S, tls=secured), Side(device)


def _carry_secured(near: socket.socket, port: int, spoiler: Spoiler) -> None:
    """Carry TLS records between a connection and a port."""
    far = socket.create_connection(("127.0.0.1", port))
    spoiler.forget()
    for each in (near, far):
        each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    requests = partial(_carry_records, near, far, lambda record: [] if spoiler.takes_request() else [record])
    Thread(target=requests, daemon=True).start()
    _carry_records(far, near, spoiler.replies)


def _carry_records(near: socket.socket, far: socket.socket, spoilt: Callable[[bytes], Sequence[bytes]]) -> None:
    """Carry one way until either end hangs up."""
    with suppress(OSError):
        while record := _record(near):
            for carried in spoilt(record) if record[0] == ENCRYPTED else [record]:
                far.sendall(carried)
    for end in (near, far):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
    near.close()


def _record(line: socket.socket) -> bytes:
    """Return the next record; b"" at the end."""
    head = line.recv(RECORD_HEADER, socket.MSG_WAITALL)
    if len(head) < RECORD_HEADER:
        return b""
    return head + line.recv(int.from_bytes(head[3:]), socket.MSG_WAITALL)


def _rtu(device: Device, clock: Clock, spoiler: Spoiler, stack: ExitStack) -> tuple[DeviceTable, Side]:
    ends = [os.openpty() for _ in range(2)]
    for controlling, end in ends:
        tty.setraw(end)
        os.set_blocking(controlling, False)
        stack.callback(os.close, controlling)
        stack.callback(os.close, end)
    (near, near_end), (far, far_end) = ends
    stop_read, stop_write = os.pipe()
    thread = Thread(target=_carry_rtu, args=(near, far, stop_read, spoiler), daemon=True)
    thread.start()
    stack.callback(thread.join)
    stack.callback(os.close, stop_write)
    registers = DeviceRegisters(device, clock)
    server = RtuServer(registers, SerialPort(path=os.ttyname(far_end), baud=115200), 1)
    server.start()
    stack.callback(server.stop)
    serial = SerialPort(path=os.ttyname(near_end), baud=115200)
    return ModbusRtuDevice(serial=serial, reply_timeout_s=REPLY_TIMEOUT_S), Side(device)


def _carry_rtu(near: int, far: int, stop: int, spoiler: Spoiler) -> None:
    while True:
        ready, _, _ = select.select((near, far, stop), (), ())
        if stop in ready:
            os.close(stop)
            return
        with suppress(BlockingIOError):
            if near in ready and (request := os.read(near, 4096)) and not spoiler.takes_request():
                os.write(far, request)
            if far in ready:
                for reply in spoiler.replies(os.read(far, 4096)):
                    os.write(near, reply)


class SpoiltNode(NodeServer):
    """A node whose TPDOs are spoilt."""

    def __init__(self, bus: CanBus, device: Device, clock: Clock, spoiler: Spoiler) -> None:
        self._spoiler = spoiler
        super().__init__(bus, device, clock, "campaign")

    def send(self, identity: int, data: bytes) -> None:
        if 0x180 < identity < 0x200:
            for each in self._spoiler.replies(data):
                super().send(identity, each)
        elif not (self._spoiler.kind == "lose" and identity < 0x580 and self._spoiler.takes_request()):
            super().send(identity, data)


def _canopen(device: Device, clock: Clock, spoiler: Spoiler, stack: ExitStack) -> tuple[DeviceTable, Side]:
    canopen_slave.LISTEN_S = 0.0  # it is alone on its channel
    channel = free_channel()
    node = SpoiltNode(CanBus(channel=channel, node=5), device, clock, spoiler)
    node.start()
    stack.callback(node.stop)

    def manage(command: int) -> None:
        with node.lock:
            node.node.receive(0, bytes((command, 5)))

    table = CanopenDevice(channel=channel, node=5, reply_timeout_s=REPLY_TIMEOUT_S, heartbeat_s=0.1)
    return table, Side(device, partial(manage, 1), partial(manage, 2))


def faults_on(bus: str) -> Sequence[str]:
    """Return the faults of the wire that a bus can have."""
    return [each for each in WIRE_FAULTS if each not in NOT_ON[bus]]
