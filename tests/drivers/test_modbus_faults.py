"""What the Modbus driver makes of a device that answers wrongly, late, in part or not at all.

The scripted device below answers honestly, from a simulated device, until it is given a fault.
"""

import re
import socket
import struct
import threading
from collections.abc import Callable, Iterator

import pytest

from config.device import ModbusTcpDevice
from config.modbus_map import SIMULATED_MAP
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers.boundary import BadReply, DoubleReply, DriverError, NoConnection, NoNumber, NoReply, Refused
from drivers.modbus_tcp import ModbusTcpDriver
from fieldbus.modbus.server import RegisterServer
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.slave import device_of
from tests.recovery import taken_up
from tests.refusals import refusal_of

pytestmark = pytest.mark.real_time

REPLY_TIMEOUT_S = 0.5
PUSH_PA = 80e3

Fault = Callable[[int, bytes, bytes], bytes | None]
"""From transaction, request and honest reply (both without frame) to the bytes sent; None hangs up."""


def frame(transaction: int, pdu: bytes, unit: int = 1, protocol: int = 0, length: int | None = None) -> bytes:
    return struct.pack(">HHHB", transaction, protocol, len(pdu) + 1 if length is None else length, unit) + pdu


def honest(transaction: int, _request: bytes, reply: bytes) -> bytes:
    return frame(transaction, reply)


class ScriptedDevice:
    """Listens on a free port; one connection after another, each in a thread."""

    def __init__(self) -> None:
        self.device = device_of(SlaveFile(), shipped_valve("seed"))
        self._answers = RegisterServer(DeviceRegisters(self.device, Lockstep(self.device)), "", 0, 1)
        self.fault: Fault = honest
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._lines: list[socket.socket] = []
        self.port = self._socket.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        for line in self._lines:
            line.close()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._socket.accept()
            except OSError:
                return
            self._lines.append(line)
            threading.Thread(target=self._serve, args=(line,), daemon=True).start()

    def _serve(self, line: socket.socket) -> None:
        try:
            while len(header := line.recv(7, socket.MSG_WAITALL)) == 7:
                transaction, _, length, _ = struct.unpack(">HHHB", header)
                request = line.recv(length - 1, socket.MSG_WAITALL)
                reply = self.fault(transaction, request, self._answers.answer(request, "driver"))
                if reply is None:
                    break
                line.sendall(reply)
            line.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # the driver hung up first


@pytest.fixture
def scripted() -> Iterator[ScriptedDevice]:
    device = ScriptedDevice()
    yield device
    device.close()


@pytest.fixture
def driver(scripted: ScriptedDevice) -> Iterator[ModbusTcpDriver]:
    driver = ModbusTcpDriver(ModbusTcpDevice(port=scripted.port, reply_timeout_s=REPLY_TIMEOUT_S))
    driver.open()
    assert driver.exchange(PUSH_PA).sample_counter == 1
    yield driver
    driver.close()


def refused_as(kind: type[DriverError], act: Callable[[], object]) -> str:
    """Return what the error says: one line that names the device."""
    return refusal_of(kind, act, names="127.0.0.1:", within_s=5 * REPLY_TIMEOUT_S)


def recovers(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    """Whatever happened: no call works until `open`, and then the newest measurement comes."""
    refused_as(NoConnection, driver.read)
    refused_as(NoConnection, lambda: driver.write(PUSH_PA))
    scripted.fault = honest
    reading = taken_up(driver, PUSH_PA)
    assert reading.sample_counter == scripted.device.sample_counter
    assert reading.position_m == pytest.approx(scripted.device.position_m, rel=1e-6)


MISFITS: dict[str, Fault] = {
    "another transaction": lambda t, _, reply: frame(t + 2, reply),
    "another unit": lambda t, _, reply: frame(t, reply, unit=2),
    "another protocol": lambda t, _, reply: frame(t, reply, protocol=1),
    "another function": lambda t, _, reply: frame(t, b"\3" + reply[1:]),
    "another function's exception": lambda t, _, __: frame(t, b"\x83\2"),
    "an exception with more behind it": lambda t, _, __: frame(t, b"\x97\2\0"),
    "an exception longer than its length": lambda t, _, __: frame(t, b"\x97\2", length=2),
    "an exception without code": lambda t, _, __: frame(t, b"\x97"),
    "too few registers": lambda t, _, reply: frame(t, bytes((23, reply[1] - 2)) + reply[2:-2]),
    "too many registers": lambda t, _, reply: frame(t, bytes((23, reply[1] + 2)) + reply[2:] + b"\0\0"),
    "a count that lies": lambda t, _, reply: frame(t, reply[:-2]),
    "an odd count": lambda t, _, reply: frame(t, bytes((23, reply[1] - 1)) + reply[2:-1]),
    "more than it counts": lambda t, _, reply: frame(t, reply + b"\0\0"),
    "an empty frame": lambda t, _, __: frame(t, b""),
    "a length of nothing": lambda t, _, reply: frame(t, reply, length=0),
    "an echo of a write": lambda t, _, __: frame(t, struct.pack(">BHH", 16, 11, 2)),
    "text": lambda *_: b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n",
}


@pytest.mark.parametrize("fault", MISFITS.values(), ids=MISFITS.keys())
def test_a_reply_that_does_not_fit_ends_the_connection(
    driver: ModbusTcpDriver, scripted: ScriptedDevice, fault: Fault
) -> None:
    scripted.fault = fault
    text = refused_as(BadReply, lambda: driver.exchange(PUSH_PA))
    assert "function 23, write 2 at 11, read 11 at 0: the reply does not fit: " in text
    recovers(driver, scripted)


@pytest.mark.parametrize("echo", [struct.pack(">BHH", 16, 10, 2), struct.pack(">BHH", 16, 11, 1), b"\x10\0\x0b\0\2\0"])
def test_a_wrong_echo_of_a_write_is_no_success(driver: ModbusTcpDriver, scripted: ScriptedDevice, echo: bytes) -> None:
    scripted.fault = lambda transaction, *_: frame(transaction, echo)
    refused_as(BadReply, lambda: driver.write(PUSH_PA))
    recovers(driver, scripted)


def test_a_wrong_count_of_a_read_is_no_measurement(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    scripted.fault = lambda transaction, _, reply: frame(transaction, reply[:-2])
    refused_as(BadReply, driver.read)
    recovers(driver, scripted)


BROKEN_OFF: dict[str, tuple[Fault, type[DriverError]]] = {
    "no answer": (lambda *_: b"", NoReply),
    "half a header": (lambda t, _, reply: frame(t, reply)[:5], NoReply),
    "half a frame": (lambda t, _, reply: frame(t, reply)[:20], NoReply),
    "a length too long": (lambda t, _, reply: frame(t, reply, length=200), NoReply),
    "hung up": (lambda *_: None, NoConnection),
}


@pytest.mark.parametrize(("fault", "kind"), BROKEN_OFF.values(), ids=BROKEN_OFF.keys())
def test_an_answer_that_does_not_come_whole_is_none(
    driver: ModbusTcpDriver, scripted: ScriptedDevice, fault: Fault, kind: type[DriverError]
) -> None:
    scripted.fault = fault
    refused_as(kind, lambda: driver.exchange(PUSH_PA))
    recovers(driver, scripted)


def test_a_late_answer_is_never_taken_for_the_next(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    gone_on = threading.Event()

    def late(transaction: int, _request: bytes, reply: bytes) -> bytes:
        gone_on.wait(5)
        return frame(transaction, reply)

    scripted.fault = late
    assert "no reply within 500 ms" in refused_as(NoReply, lambda: driver.exchange(30e3))
    scripted.fault = honest
    driver.open()
    gone_on.set()
    for _ in range(20):
        reading = driver.exchange(PUSH_PA)
        assert (reading.sample_counter, reading.pressure_pa) == (scripted.device.sample_counter, PUSH_PA)


def test_an_answer_sent_twice_is_taken_once(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    scripted.fault = lambda transaction, _, reply: 2 * frame(transaction, reply)
    assert driver.exchange(PUSH_PA).sample_counter == 2
    text = refused_as(DoubleReply, lambda: driver.exchange(PUSH_PA))
    assert re.search(r"the reply to the request before came twice", text)
    recovers(driver, scripted)


@pytest.mark.parametrize(("name", "number"), [("position_m", "nan"), ("position_m", "inf"), ("pressure_pa", "-inf")])
def test_a_number_that_is_none_is_no_measurement_but_the_connection_holds(
    driver: ModbusTcpDriver, scripted: ScriptedDevice, name: str, number: str
) -> None:
    at = 2 + 2 * SIMULATED_MAP.places[name].address

    def no_number(transaction: int, _request: bytes, reply: bytes) -> bytes:
        return frame(transaction, reply[:at] + struct.pack(">f", float(number)) + reply[at + 4 :])

    scripted.fault = no_number
    text = refused_as(NoNumber, lambda: driver.exchange(PUSH_PA))
    assert f"{name} {number}" in text
    refused_as(NoNumber, driver.read)
    scripted.fault = honest
    assert driver.exchange(PUSH_PA).sample_counter == 3


@pytest.mark.parametrize(
    ("code", "kind"),
    [(2, Refused), (3, Refused), (4, Refused), (6, Refused), (10, NoReply), (11, NoReply), (99, Refused)],
)
def test_an_exception_is_a_refusal_or_of_a_gateway_a_lost_reply_and_the_connection_holds(
    driver: ModbusTcpDriver, scripted: ScriptedDevice, code: int, kind: type[DriverError]
) -> None:
    scripted.fault = lambda transaction, request, _: frame(transaction, bytes((request[0] | 0x80, code)))
    for act in (lambda: driver.exchange(PUSH_PA), lambda: driver.write(PUSH_PA), driver.read):
        assert f"exception {code}, " in refused_as(kind, act)
    with pytest.raises(DriverError) as caught:
        driver.read()
    assert (caught.value.kind == "device busy") == (code in (5, 6))
    scripted.fault = honest
    before = scripted.device.sample_counter
    assert driver.exchange(PUSH_PA).sample_counter == before + 1
    assert driver.capabilities.one_transaction


def test_only_an_unknown_function_makes_it_use_two_transactions_for_good(
    driver: ModbusTcpDriver, scripted: ScriptedDevice
) -> None:
    asked: list[int] = []

    def without_23(transaction: int, request: bytes, reply: bytes) -> bytes:
        asked.append(request[0])
        return frame(transaction, b"\x97\1" if request[0] == 23 else reply)

    scripted.fault = without_23
    for _ in range(3):
        driver.exchange(PUSH_PA)
    assert asked == [23, 16, 3, 16, 3, 16, 3]
    assert not driver.capabilities.one_transaction


def test_open_refuses_a_held_command_that_is_no_number(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    no_number = b"\3\4" + struct.pack(">f", float("nan"))
    of_command = struct.pack(">BH", 3, SIMULATED_MAP.command_pa.address)
    scripted.fault = lambda transaction, request, reply: frame(
        transaction, no_number if request.startswith(of_command) else reply
    )
    assert "the command it holds is nan" in refused_as(BadReply, driver.open)
    recovers(driver, scripted)


def test_open_fails_whole_when_the_timeout_cannot_be_set(driver: ModbusTcpDriver, scripted: ScriptedDevice) -> None:
    def read_only(transaction: int, request: bytes, reply: bytes) -> bytes:
        return frame(transaction, b"\x90\2" if request[0] == 16 else reply)

    scripted.fault = read_only
    assert "function 16, write 1 at 15: exception 2" in refused_as(Refused, driver.open)
    recovers(driver, scripted)


def test_a_host_name_nobody_knows_is_no_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with pytest.raises(NoConnection, match="valve-7:5020 unit 1: Name or service not known"):
        ModbusTcpDriver(ModbusTcpDevice(host="valve-7")).open()


def test_a_host_that_does_not_accept_is_no_connection_within_the_timeout() -> None:
    with socket.create_server(("127.0.0.1", 0), backlog=0) as full:
        port = full.getsockname()[1]
        waiting = [socket.socket() for _ in range(4)]
        for line in waiting:  # they fill its queue; it never accepts
            line.setblocking(False)
            line.connect_ex(("127.0.0.1", port))
        driver = ModbusTcpDriver(ModbusTcpDevice(port=port, reply_timeout_s=REPLY_TIMEOUT_S))
        text = refused_as(NoConnection, driver.open)
        for line in waiting:
            line.close()
    assert "nobody accepts a connection within 500 ms" in text
