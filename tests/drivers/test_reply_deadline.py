"""The reply time-out is a deadline on the whole reply: a device that dribbles it byte by byte gains nothing.

In virtual time, so that "in time" and "too late" are exact; and once on a real wire for each bus.
"""

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from config.device import ModbusRtuDevice, ModbusTcpDevice
from config.roles import Role
from config.serial_port import SerialPort
from config.slave_file import SlaveFile
from config.tls_table import Tls
from config.valve_file import shipped_valve
from drivers import modbus_rtu
from drivers.boundary import BadReply, NoConnection, NoReply
from drivers.modbus_rtu import ModbusRtuDriver
from drivers.modbus_tcp import ModbusTcpDriver
from fieldbus.modbus import client as modbus_client
from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.client_errors import NotConnected, ReplyTimeout
from fieldbus.modbus.rtu import framed
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.server_connection import ServerConnection
from fieldbus.modbus.tls import Guard
from positioner.cli.parts.pseudo_line import pseudo_line
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.slave import device_of
from tests.certificates import tls
from tests.drivers.test_modbus_rtu import ScriptedDevice

pytestmark = pytest.mark.real_time

TIMEOUT_S = 0.2
READ_11 = struct.pack(">BHH", 3, 0, 11)
REPLY = b"\3\x16" + bytes(22)
PUSH_PA = 80e3


class Clock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now_s = 50.0

    def monotonic(self) -> float:
        return self.now_s


class Dribbling:
    """A socket on which a byte of the reply comes every `gap_s`; it waits as its time-out says."""

    def __init__(self, clock: Clock, gap_s: float) -> None:
        self._clock, self.gap_s = clock, gap_s
        self._left = b""
        self._timeout_s = TIMEOUT_S
        self.sent_with_s: list[float] = []
        self.is_open = True

    def fileno(self) -> int:
        return 5 if self.is_open else -1

    def close(self) -> None:
        self.is_open = False

    def settimeout(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s

    def sendall(self, frame: bytes) -> None:
        self.sent_with_s.append(self._timeout_s)
        self._left = frame[:4] + struct.pack(">HB", len(REPLY) + 1, 1) + REPLY

    def recv(self, _size: int) -> bytes:
        self._clock.now_s += min(self.gap_s, self._timeout_s)
        if self.gap_s > self._timeout_s:
            raise TimeoutError
        data, self._left = self._left[:1], self._left[1:]
        return data


@pytest.fixture
def client() -> ModbusClient:
    return ModbusClient("127.0.0.1", 1, 1, TIMEOUT_S)


@pytest.mark.parametrize("gap_s", [TIMEOUT_S / 30, TIMEOUT_S / 4, TIMEOUT_S])
def test_a_reply_that_dribbles_is_given_up_when_the_time_out_of_the_first_byte_would_end(
    client: ModbusClient, gap_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(modbus_client, "time", clock)
    line = Dribbling(clock, gap_s)
    client.line = line  # type: ignore[assignment]
    start_s = clock.now_s
    with pytest.raises(ReplyTimeout, match="no reply within 200 ms"):
        client.transact(READ_11)
    assert clock.now_s - start_s == pytest.approx(TIMEOUT_S), "31 bytes, so that it never was whole"
    assert not line.is_open
    with pytest.raises(NotConnected, match="the connection is closed"):
        client.transact(READ_11)


def test_a_reply_in_pieces_that_is_whole_in_time_counts_and_the_next_has_all_of_its_time(
    client: ModbusClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(modbus_client, "time", clock)
    line = Dribbling(clock, TIMEOUT_S / 32)
    client.line = line  # type: ignore[assignment]
    for _ in range(3):
        assert client.transact(READ_11) == REPLY
    assert line.sent_with_s == [TIMEOUT_S] * 3


class Babbler:
    """A serial line on which something always comes, whole frames never."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.is_open = True

    def open(self) -> None: ...

    def close(self) -> None:
        self.is_open = False

    def send(self, _frame: bytes, _within_s: float) -> float:
        return self._clock.now_s

    def receive(self, _until_s: float) -> bytes:
        self._clock.now_s += TIMEOUT_S / 10
        assert self._clock.now_s < 60.0, "it listens for ever"
        return b"\x55"


def test_on_a_serial_line_somebody_who_never_stops_keeps_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(modbus_rtu, "time", clock)
    driver = ModbusRtuDriver(ModbusRtuDevice(serial=SerialPort(path="/dev/ttyS9"), reply_timeout_s=TIMEOUT_S))
    driver.line = Babbler(clock)  # type: ignore[assignment]
    with pytest.raises(NoConnection, match="nobody answers within 200 ms"):
        driver.open()
    assert clock.now_s - 50.0 <= 1.2 * TIMEOUT_S


# On the wire a gap is far below the time-out and the whole far above it: a driver that waits for each byte anew would
# take the reply. A machine that stands still can only make the driver give up, which is what is asked for.

GAP_S = TIMEOUT_S / 8


class Bytewise:
    """Sends byte by byte until told that nobody listens."""

    def __init__(self) -> None:
        self.gone = threading.Event()
        self.sent = 0

    def dribble(self, send: Callable[[bytes], object], data: bytes) -> None:
        for byte in data:
            send(bytes((byte,)))
            self.sent += 1
            if self.gone.wait(GAP_S):
                return


@pytest.fixture
def bytewise() -> Iterator[Bytewise]:
    sender = Bytewise()
    yield sender
    sender.gone.set()


@pytest.mark.parametrize("table", [None, tls("daemon")], ids=["tcp", "tls"])
def test_a_device_that_dribbles_on_tcp_is_no_reply(
    table: Tls | None, bytewise: Bytewise, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = device_of(SlaveFile(), shipped_valve("seed"))
    guard = None if table is None else Guard(tls("device"), lambda _: Role.OPERATOR)
    server = RegisterServer(DeviceRegisters(device, Lockstep(device)), "127.0.0.1", 0, 1, guard)
    server.start()
    driver = ModbusTcpDriver(ModbusTcpDevice(port=server.port, reply_timeout_s=TIMEOUT_S, tls=table))

    honest, slow = ServerConnection.handle, list[bool]()

    class Line:
        def __init__(self, line: socket.socket) -> None:
            self._line = line

        def __getattr__(self, name: str) -> Any:
            return getattr(self._line, name)

        def sendall(self, data: bytes) -> None:
            if slow:
                bytewise.dribble(self._line.sendall, data)
            else:
                self._line.sendall(data)

    def handle(connection: ServerConnection) -> None:
        connection.request = Line(connection.request)  # type: ignore[assignment]
        honest(connection)

    monkeypatch.setattr(ServerConnection, "handle", handle)
    driver.open()
    slow.append(True)
    with pytest.raises(NoReply, match="no reply within 200 ms"):
        driver.exchange(PUSH_PA)
    assert bytewise.sent < 31
    bytewise.gone.set()
    server.stop()


def test_a_device_that_dribbles_on_a_serial_line_is_no_measurement(bytewise: Bytewise) -> None:
    with pseudo_line() as (end, other_end):
        device = ScriptedDevice(other_end)
        serial = SerialPort(path=end, baud=115200)
        driver = ModbusRtuDriver(ModbusRtuDevice(serial=serial, reply_timeout_s=TIMEOUT_S))
        driver.open()

        def slowly(_request: bytes, reply: bytes) -> bytes:
            bytewise.dribble(lambda byte: device.line.send(byte, 1.0), reply)
            return b""

        device.fault = slowly
        with pytest.raises(BadReply, match="noise, or a broken reply"):
            driver.exchange(PUSH_PA)
        assert bytewise.sent < len(framed(1, b"\x17\x16" + bytes(22)))
        bytewise.gone.set()
        device.close()
