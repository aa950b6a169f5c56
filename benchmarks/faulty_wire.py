"""A simulated device in lockstep on each bus, its wire spoilt on demand: what `benchmarks.campaign` tries.

    drop        the reply is lost              duplicate   it comes twice
    lose        the request is lost            reorder     it comes after that of the next request
    delay       it comes after the time-out    truncate    its end is missing
    disconnect  the connection ends            corrupt     a bit of it is wrong

Modbus TCP through a proxy that knows frames; RTU through a line that carries whole ones; CANopen at the node, whose
replies are its TPDOs. A corrupt CAN frame is none (its check sum): there, and where a bus has no connection, the case
is left out.
"""

import os
import select
import socket
import struct
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from threading import Lock, Thread
from time import sleep

from config.canopen_device import CanBus, CanopenDevice
from config.device import Device as DeviceTable
from config.device import ModbusRtuDevice, ModbusTcpDevice
from config.serial_port import SerialPort
from fieldbus.canopen.loopback import free_channel
from fieldbus.modbus.server import RegisterServer
from sim.slave import canopen_slave
from sim.slave.canopen_slave import NodeServer
from sim.slave.clocks import Clock
from sim.slave.device_registers import DeviceRegisters
from sim.slave.rtu_server import RtuServer
from sim.slave.simulated_device import Device

REPLY_TIMEOUT_S = 0.08
LATE_S = 1.3 * REPLY_TIMEOUT_S
WIRE_FAULTS = ("drop", "lose", "delay", "duplicate", "reorder", "truncate", "corrupt", "disconnect")
NOT_ON = {"canopen": {"corrupt", "disconnect"}, "rtu": {"disconnect"}, "modbus": set[str]()}
HEADER = struct.Struct(">HHHB")


class Spoiler:
    """What is wrong with the wire: a kind, for so many replies (or requests) from now on."""

    def __init__(self) -> None:
        self.kind = ""
        self.left = 0
        self._kept: list[bytes] = []
        self._lock = Lock()

    def begin(self, kind: str, count: int) -> None:
        """Spoil that many."""
        with self._lock:
            self.kind, self.left = kind, count

    def takes_request(self) -> bool:
        """Return whether a request gets lost."""
        return self.kind == "lose" and self._spend()

    def replies(self, reply: bytes) -> list[bytes]:
        """Return what comes in place of a reply.

        Raises:
            ConnectionResetError: the connection ends.
        """
        if self._kept:
            late, self._kept = self._kept, []
            return [reply, *late]
        if self.kind in ("", "lose") or not self._spend():
            return [reply]
        if self.kind == "disconnect":
            raise ConnectionResetError
        if self.kind == "delay":
            sleep(LATE_S)
        if self.kind == "reorder":
            self._kept = [reply]
        wrong = reply[:1] + bytes((reply[1] ^ 0x40,)) + reply[2:]
        instead = {"duplicate": [reply, reply], "delay": [reply], "truncate": [reply[: len(reply) // 2]]}
        return {**instead, "corrupt": [wrong]}.get(self.kind, [])

    def _spend(self) -> bool:
        with self._lock:
            spent = self.left > 0
            self.left -= spent
            return spent


@contextmanager
def on_bus(bus: str, device: Device, clock: Clock, spoiler: Spoiler) -> Iterator[tuple[DeviceTable, "Side"]]:
    """Put a device on a bus; give the daemon's table of it, and its far side."""
    with ExitStack() as stack:
        yield {"modbus": _tcp, "rtu": _rtu, "canopen": _canopen}[bus](device, clock, spoiler, stack)


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
    proxy = socket.create_server(("127.0.0.1", 0))
    stack.callback(proxy.close)
    stack.callback(proxy.shutdown, socket.SHUT_RDWR)
    Thread(target=_accept, args=(proxy, server.port, spoiler), daemon=True).start()
    return ModbusTcpDevice(port=proxy.getsockname()[1], reply_timeout_s=REPLY_TIMEOUT_S), Side(device)


def _accept(proxy: socket.socket, port: int, spoiler: Spoiler) -> None:
    while True:
        try:
            near, _ = proxy.accept()
        except OSError:
            return
        Thread(target=_carry_tcp, args=(near, port, spoiler), daemon=True).start()


def _carry_tcp(near: socket.socket, port: int, spoiler: Spoiler) -> None:
    with near, socket.create_connection(("127.0.0.1", port)) as far, suppress(OSError):
        while frame := _frame(near):
            if spoiler.takes_request():
                continue
            far.sendall(frame)
            for reply in spoiler.replies(_frame(far)):
                near.sendall(reply)


def _frame(line: socket.socket) -> bytes:
    """Return the next frame; b"" at the end."""
    head = line.recv(HEADER.size, socket.MSG_WAITALL)
    if len(head) < HEADER.size:
        return b""
    return head + line.recv(HEADER.unpack(head)[2] - 1, socket.MSG_WAITALL)


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

    def _send(self, identity: int, data: bytes) -> None:
        if 0x180 < identity < 0x200:
            for each in self._spoiler.replies(data):
                super()._send(identity, each)
        elif not (self._spoiler.kind == "lose" and identity < 0x580 and self._spoiler.takes_request()):
            super()._send(identity, data)


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
