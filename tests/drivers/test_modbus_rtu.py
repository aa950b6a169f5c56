"""Modbus RTU: the contract of every driver, and what becomes of late replies, noise, and broken frames.

The line is a pair of pseudo-terminals. The scripted device below answers honestly, from a simulated device, until it
is given a fault. A driver's time-out passes when that device has said all that it has to say (`decided_by`): whatever
the machine is busy with, a reply that was sent has come in time, and one that was not never comes.
"""

import os
import select
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from pymodbus.client import ModbusSerialClient

from config.device import ModbusRtuDevice
from config.modbus_map import SIMULATED_MAP
from config.serial_port import Baud, SerialPort
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers.boundary import BadReply, DriverError, NoConnection, NoNumber, NoReply, Refused
from drivers.modbus_rtu import ModbusRtuDriver
from fieldbus.modbus.rtu import framed
from fieldbus.modbus.serial_line import SerialLine
from positioner.cli.parts.pseudo_line import pseudo_line
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.rtu_server import RtuServer
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.drivers.test_driver_contract import FILE, WireBench, WireContract
from tests.recovery import taken_up
from tests.refusals import refusal_of

pytestmark = pytest.mark.real_time

BAUD: Baud = 115200
SLOW_BAUD: Baud = 1200
REPLY_TIMEOUT_S = 0.5
ARRIVES_WITHIN_S, PATIENCE_S = 0.2, 60.0
"""What was written to a pseudo-terminal comes out of its other end; a test that waits longer has failed."""
PUSH_PA = 80e3


def port(path: str) -> SerialPort:
    return SerialPort(path=path, baud=BAUD)


class TestModbusRtu(WireContract):
    @pytest.fixture
    def make(self) -> Iterator[Callable[[], WireBench]]:
        with ExitStack() as lines:

            def make() -> WireBench:
                end, other_end = lines.enter_context(pseudo_line())
                device = device_of(FILE, shipped_valve("seed"))
                config = ModbusRtuDevice(
                    serial=port(end),
                    reply_timeout_s=self.reply_timeout_s,
                    communication_timeout_s=1.5,
                    communication_action="vent",
                )
                bench = WireBench(device, ModbusRtuDriver(config), self.serve(device, other_end))
                lines.callback(lambda: bench.server.stop())  # noqa: PLW0108 - it may be another by then
                lines.callback(bench.driver.close)
                return bench

            yield make

    def serve(self, device: Device, address: str | None) -> RtuServer:
        assert address is not None
        server = RtuServer(DeviceRegisters(device, Lockstep(device)), port(address), 1)
        server.start()
        return server


Fault = Callable[[bytes, bytes], bytes]
"""From request and honest reply, both whole frames, to the bytes sent."""


def honest(_request: bytes, reply: bytes) -> bytes:
    return reply


class ScriptedDevice:
    """Answers at the other end of a line, after the fault has had its say."""

    def __init__(self, path: str, unit: int = 1) -> None:
        self._unit = unit
        self.device = device_of(SlaveFile(), shipped_valve("seed"))
        self._answers = RtuServer(DeviceRegisters(self.device, Lockstep(self.device)), port(path), 1)
        self.fault: Fault = honest
        self.heard: list[bytes] = []
        self.asked = self.answered = 0
        self.line = SerialLine(port(path))
        self.line.open()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.line.close()

    def _work(self) -> None:
        while not self._ended.is_set():
            request = self.line.receive(time.monotonic() + 0.05)
            while more := self.line.receive(time.monotonic() + port("-").silence_s):
                request += more
            if request:
                self.heard.append(request)
                pdu = request[1:-2]
                reply = pdu if pdu[0] == 8 else self._answers.answer(pdu, "driver")
                if said := self.fault(request, framed(self._unit, reply)):
                    self.line.send(said, PATIENCE_S)
                self.answered += 1


def decided_by(device: ScriptedDevice, driver: ModbusRtuDriver) -> ModbusRtuDriver:
    """Return the driver; its time-outs pass when the device has met each request, with an answer or without."""
    line = driver.line
    send, receive = line.send, line.receive

    def asking(frame: bytes, within_s: float) -> float:
        device.asked += 1
        return send(frame, PATIENCE_S)

    def receiving(until_s: float) -> bytes:
        end_s = time.monotonic() + PATIENCE_S
        while until_s > 0.0:
            met = device.answered >= device.asked
            data = receive(time.monotonic() + (ARRIVES_WITHIN_S if met else 0.01))
            if data or met:
                return data
            assert time.monotonic() < end_s
        return receive(0.0)

    line.send, line.receive = asking, receiving  # type: ignore[method-assign]
    return driver


@pytest.fixture
def scripted() -> Iterator[ScriptedDevice]:
    with pseudo_line() as (end, other_end):
        device = ScriptedDevice(other_end)
        device.driver_end = end  # type: ignore[attr-defined]
        yield device
        device.close()


@pytest.fixture
def driver(scripted: ScriptedDevice) -> Iterator[ModbusRtuDriver]:
    end = scripted.driver_end  # type: ignore[attr-defined]
    driver = decided_by(scripted, ModbusRtuDriver(ModbusRtuDevice(serial=port(end), reply_timeout_s=REPLY_TIMEOUT_S)))
    driver.open()
    assert driver.exchange(PUSH_PA).sample_counter == 1
    yield driver
    driver.close()


@pytest.fixture
def slow_driver(scripted: ScriptedDevice) -> Iterator[ModbusRtuDriver]:
    """Where silence is so long that a busy machine leaves none in a babble."""
    end = scripted.driver_end  # type: ignore[attr-defined]
    driver = ModbusRtuDriver(ModbusRtuDevice(serial=SerialPort(path=end, baud=SLOW_BAUD), reply_timeout_s=2.0))
    driver.open()
    yield driver
    driver.close()


def refused_as(kind: type[DriverError], act: Callable[[], object]) -> str:
    """Return what the error says: one line that names the device."""
    return refusal_of(kind, act, names="/dev/pts/", within_s=PATIENCE_S)


def recovers(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    """Whatever happened: no call works until `open`, and then the newest measurement comes."""
    refused_as(NoConnection, driver.read)
    refused_as(NoConnection, lambda: driver.write(PUSH_PA))
    scripted.fault = honest
    reading = taken_up(driver, PUSH_PA)
    assert reading.sample_counter == scripted.device.sample_counter
    assert reading.position_m == pytest.approx(scripted.device.position_m, rel=1e-6)


MISFITS: dict[str, tuple[Fault, str]] = {
    "a wrong check sum": (lambda _, reply: reply[:-1] + bytes((reply[-1] ^ 1,)), "noise, or a broken reply"),
    "a bit turned over": (lambda _, reply: reply[:5] + bytes((reply[5] ^ 4,)) + reply[6:], "noise, or a broken reply"),
    "noise before it": (lambda _, reply: b"\x00\xff" + reply, "noise, or a broken reply"),
    "noise behind it": (lambda _, reply: reply + b"\xfe", "noise, or a broken reply"),
    "a zero behind it": (lambda _, reply: reply + b"\0", "the reply does not fit"),
    "nothing but noise": (lambda *_: bytes(range(60, 130)), "noise, or a broken reply"),
    "half of it": (lambda _, reply: reply[:9], "noise, or a broken reply"),
    "one byte": (lambda _, reply: reply[:1], "noise, or a broken reply"),
    "another unit": (lambda _, reply: framed(2, reply[1:-2]), "a reply of unit 2"),
    "another function": (lambda _, reply: framed(1, b"\3" + reply[2:-2]), "the reply does not fit"),
    "another function's exception": (lambda *_: framed(1, b"\x83\2"), "the reply does not fit"),
    "another unit's exception": (lambda *_: framed(2, b"\x97\2"), "a reply of unit 2"),
    "too few registers": (
        lambda _, reply: framed(1, bytes((23, reply[2] - 2)) + reply[3:-4]),
        "the reply does not fit",
    ),
    "too many registers": (
        lambda _, reply: framed(1, bytes((23, reply[2] + 2)) + reply[3:-2] + b"\0\0"),
        "the reply does not fit",
    ),
    "the request come back": (lambda request, _: request, "the reply does not fit"),
}


@pytest.mark.parametrize(("fault", "said"), MISFITS.values(), ids=MISFITS.keys())
def test_what_is_not_the_reply_is_a_named_event_and_the_driver_recovers(
    driver: ModbusRtuDriver, scripted: ScriptedDevice, fault: Fault, said: str
) -> None:
    scripted.fault = fault
    text = refused_as(BadReply, lambda: driver.exchange(PUSH_PA))
    assert f"function 23, write 2 at 11, read 11 at 0: {said}: " in text
    recovers(driver, scripted)


def test_silence_is_no_reply(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    scripted.fault = lambda *_: b""
    assert "no reply within 500 ms" in refused_as(NoReply, lambda: driver.exchange(PUSH_PA))
    recovers(driver, scripted)


def test_a_reply_in_pieces_is_one_reply(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    def in_pieces(_request: bytes, reply: bytes) -> bytes:
        scripted.line.send(reply[:1], 1.0)
        scripted.line.send(reply[1:7], 1.0)
        return reply[7:]

    scripted.fault = in_pieces
    assert driver.exchange(PUSH_PA).sample_counter == 2


@pytest.mark.parametrize("code", [2, 3, 4, 6, 99])
def test_an_exception_is_a_refusal_and_the_line_stays(
    driver: ModbusRtuDriver, scripted: ScriptedDevice, code: int
) -> None:
    scripted.fault = lambda request, _: framed(1, bytes((request[1] | 0x80, code)))
    for act in (lambda: driver.exchange(PUSH_PA), lambda: driver.write(PUSH_PA), driver.read):
        assert f"exception {code}, " in refused_as(Refused, act)
    scripted.fault = honest
    assert driver.exchange(PUSH_PA).sample_counter == scripted.device.sample_counter


def test_a_number_that_is_none_is_no_measurement_but_the_line_stays(
    driver: ModbusRtuDriver, scripted: ScriptedDevice
) -> None:
    scripted.fault = lambda _, reply: framed(1, reply[1:3] + struct.pack(">f", float("nan")) + reply[7:-2])
    assert "position_m nan" in refused_as(NoNumber, lambda: driver.exchange(PUSH_PA))
    scripted.fault = honest
    assert driver.exchange(PUSH_PA).sample_counter == 3


def test_noise_on_the_idle_line_is_thrown_away(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    fd = os.open(driver.line.port.path, os.O_RDONLY | os.O_NOCTTY)
    for noise in (b"\0", b"\xff\xff", framed(1, b"\x10\0\x0b\0\2")):
        scripted.line.send(noise, 1.0)
        assert select.select((fd,), (), (), 5) == ([fd], [], []), "it has arrived"
        assert driver.exchange(PUSH_PA).sample_counter == scripted.device.sample_counter
    os.close(fd)


def test_a_line_that_is_never_silent_is_no_connection(slow_driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    stop = threading.Event()

    def babble() -> None:
        fd = os.open(scripted.line.port.path, os.O_WRONLY | os.O_NOCTTY)
        while not stop.wait(1e-3):
            os.write(fd, b"\x55")
        os.close(fd)

    thread = threading.Thread(target=babble)
    thread.start()
    heard: list[str] = []
    end_s = time.monotonic() + 60
    try:
        while not any("the line is never silent" in each for each in heard):
            assert time.monotonic() < end_s, heard
            try:  # its gaps may let a request through; then the babble is noise
                slow_driver.open()
                slow_driver.exchange(PUSH_PA)
            except DriverError as error:
                heard.append(str(error))
    finally:
        stop.set()
        thread.join()
    recovers(slow_driver, scripted)


# A reply on a serial line carries nothing that says which request it answers.


def one_behind(*replies: bytes) -> Fault:
    """Answer each request with the reply to the one before it."""
    waiting = list(replies)

    def late(_request: bytes, reply: bytes) -> bytes:
        waiting.append(reply)
        return waiting.pop(0) if len(waiting) > 1 else b""

    return late


def test_a_bare_client_takes_every_late_reply_for_an_answer(scripted: ScriptedDevice) -> None:
    """The hazard itself, so that the tests below are known to show something."""
    client = ModbusSerialClient(scripted.driver_end, baudrate=BAUD, timeout=PATIENCE_S, retries=0)  # type: ignore[attr-defined]
    right = {SIMULATED_MAP.command_pa.address: 0x479C, 10: 0}
    scripted.device.tick(PUSH_PA)
    with client:
        for address, word in right.items():
            assert client.read_holding_registers(address, count=1).registers == [word]
        scripted.fault = one_behind(framed(1, b"\3\2" + right[11].to_bytes(2)))
        for address, other in ((10, 11), (11, 10), (10, 11), (11, 10)):
            assert client.read_holding_registers(address, count=1).registers == [right[other]], "4 of 4 are wrong"


def test_a_device_that_stays_one_reply_behind_is_never_believed(
    driver: ModbusRtuDriver, scripted: ScriptedDevice
) -> None:
    scripted.fault = one_behind()
    refused_as(NoReply, driver.read)
    for _ in range(2):
        refused_as(NoConnection, driver.open)
        refused_as(NoConnection, driver.read)
    scripted.fault = honest
    driver.open()
    assert driver.exchange(PUSH_PA).sample_counter == scripted.device.sample_counter


@pytest.mark.parametrize("behind", ["the echo asked for", "nothing"])
def test_a_reply_delayed_past_its_timeout_never_becomes_another_requests_answer(
    driver: ModbusRtuDriver, scripted: ScriptedDevice, behind: str
) -> None:
    """It comes when the driver has asked anew, and is whole and of the right unit: only its being late is wrong."""
    late: list[bytes] = []

    def keep(_request: bytes, reply: bytes) -> bytes:
        late.append(reply)
        return b""

    def late_then_honest(_request: bytes, reply: bytes) -> bytes:
        scripted.fault = honest
        scripted.line.send(late.pop(), 1.0)
        return reply if behind == "the echo asked for" else b""

    scripted.fault = keep
    refused_as(NoReply, lambda: driver.exchange(30e3))
    scripted.fault = late_then_honest
    if behind == "nothing":
        assert "nobody answers within 500 ms (but " in refused_as(NoConnection, driver.open)
    assert driver.open() == 30e3
    for _ in range(20):
        reading = driver.exchange(PUSH_PA)
        assert (reading.sample_counter, reading.pressure_pa) == (scripted.device.sample_counter, PUSH_PA)


def test_a_device_that_works_off_a_backlog_is_heard_out_first(
    driver: ModbusRtuDriver, scripted: ScriptedDevice
) -> None:
    """It was held up for several requests and answers all of them, in order, when it goes on."""
    backlog: list[bytes] = []

    def keep(_request: bytes, reply: bytes) -> bytes:
        backlog.append(reply)
        return b""

    def work_off(_request: bytes, reply: bytes) -> bytes:
        scripted.fault = honest
        for each in backlog:
            scripted.line.send(each, 1.0)
        return reply

    scripted.fault = keep
    refused_as(NoReply, lambda: driver.exchange(30e3))
    refused_as(NoConnection, driver.open)
    refused_as(NoConnection, driver.open)
    scripted.fault = work_off
    driver.open()
    assert len(backlog) == 3
    for _ in range(5):
        reading = driver.exchange(PUSH_PA)
        assert (reading.sample_counter, reading.pressure_pa) == (scripted.device.sample_counter, PUSH_PA)


def test_a_device_without_echo_refuses_it_and_that_will_do(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    scripted.fault = lambda request, reply: framed(1, b"\x88\1") if request[1] == 8 else reply
    assert driver.open() == PUSH_PA
    assert driver.exchange(PUSH_PA).sample_counter == 2


def test_a_device_that_passes_over_the_echo_is_reached_by_reads_and_no_late_reply_is_taken(
    scripted: ScriptedDevice,
) -> None:
    """As the slaves of libmodbus do."""
    scripted.fault = lambda request, reply: b"" if request[1] == 8 else reply
    end = scripted.driver_end  # type: ignore[attr-defined]
    driver = decided_by(scripted, ModbusRtuDriver(ModbusRtuDevice(serial=port(end), reply_timeout_s=REPLY_TIMEOUT_S)))
    assert driver.open() == scripted.device.command_pa
    assert {request[1] for request in scripted.heard[1:]} <= {3, 16}, "after the echo only reads, and its time-out"
    assert driver.exchange(PUSH_PA).sample_counter == 1
    late = one_behind()
    scripted.fault = lambda request, reply: b"" if request[1] == 8 else late(request, reply)
    refused_as(NoReply, driver.read)
    for _ in range(3):
        refused_as(NoConnection, driver.open)
    scripted.fault = lambda request, reply: b"" if request[1] == 8 else reply
    driver.open()
    assert driver.exchange(PUSH_PA).sample_counter == scripted.device.sample_counter
    driver.close()


def test_requests_keep_the_silence_between_frames(driver: ModbusRtuDriver, scripted: ScriptedDevice) -> None:
    """Of 1.75 ms above 19200 baud, after the last character of the reply; the device keeps as much before it."""
    start_s = time.monotonic()
    for _ in range(50):
        driver.exchange(PUSH_PA)
    assert time.monotonic() - start_s >= 50 * 2 * 1.75e-3


# The line itself.


def refusal_to_open(path: str) -> str:
    driver = ModbusRtuDriver(ModbusRtuDevice(serial=port(path), reply_timeout_s=0.05))
    with pytest.raises(NoConnection) as caught:
        driver.open()
    return str(caught.value)


def test_a_line_that_is_not_there_or_is_none_is_no_connection(tmp_path: os.PathLike[str]) -> None:
    assert refusal_to_open("/dev/ttyNONE") == "/dev/ttyNONE unit 1: No such file or directory"
    assert refusal_to_open("/dev/null") == "/dev/null unit 1: is not a serial line"
    assert refusal_to_open(os.fspath(tmp_path)).endswith("unit 1: Is a directory")


def test_a_line_of_another_process_is_no_connection() -> None:
    import fcntl

    with pseudo_line() as (end, _):
        fd = os.open(end, os.O_RDWR | os.O_NOCTTY)
        fcntl.flock(fd, fcntl.LOCK_EX)  # as another process would have it: another open file
        assert refusal_to_open(end) == f"{end} unit 1: is used by another process"
        os.close(fd)


def test_a_line_that_vanishes_is_no_connection_until_it_is_back(tmp_path: os.PathLike[str]) -> None:
    """As a USB adapter does: its device file is a link here."""
    link = os.path.join(tmp_path, "ttyVALVE")
    device = device_of(SlaveFile(), shipped_valve("seed"))

    def serve(path: str) -> RtuServer:
        server = RtuServer(DeviceRegisters(device, Lockstep(device)), port(path), 1)
        server.start()
        return server

    driver = ModbusRtuDriver(ModbusRtuDevice(serial=port(link), reply_timeout_s=PATIENCE_S))
    with pseudo_line() as (end, other_end):
        os.symlink(end, link)
        server = serve(other_end)
        driver.open()
        assert driver.exchange(PUSH_PA).sample_counter == 1
        server.stop()
    os.unlink(link)
    with pytest.raises(NoConnection):
        driver.exchange(PUSH_PA)
    with pytest.raises(NoConnection, match="No such file"):
        driver.open()
    with pseudo_line() as (end, other_end):
        os.symlink(end, link)
        server = serve(other_end)
        driver.open()
        assert driver.exchange(PUSH_PA).sample_counter == 2
        driver.close()
        server.stop()


def test_two_devices_on_one_line_take_turns() -> None:
    """And the one that is dead costs the other nothing but its turn."""
    with pseudo_line() as (end, other_end):
        device = ScriptedDevice(other_end, unit=7)
        device.fault = lambda request, reply: reply if request[0] == 7 else b""
        dead, alive = (
            decided_by(device, ModbusRtuDriver(ModbusRtuDevice(serial=port(end), unit=unit, reply_timeout_s=0.5)))
            for unit in (6, 7)
        )
        alive.open()
        for sample in range(1, 4):
            with pytest.raises(NoConnection, match="nobody answers within 500 ms"):
                dead.open()
            assert alive.exchange(PUSH_PA).sample_counter == sample
        alive.close()
        device.close()


# The simulated slave, by bytes.


@pytest.fixture
def slave_line() -> Iterator[tuple[SerialLine, Device]]:
    with pseudo_line() as (end, other_end):
        device = device_of(SlaveFile(), shipped_valve("seed"))
        server = RtuServer(DeviceRegisters(device, Lockstep(device)), port(other_end), 5)
        server.start()
        line = SerialLine(port(end))
        line.open()
        yield line, device
        line.close()
        server.stop()


def said(line: SerialLine, frame: bytes, wait_s: float = 1.0) -> bytes:
    reply, until_s = b"", line.send(frame, 1.0) + wait_s
    while data := line.receive(min(until_s, time.monotonic() + (0.02 if reply else wait_s))):
        reply += data
    return reply


def answer(line: SerialLine, frame: bytes) -> bytes:
    """Return the answer. On a busy machine the slave may see a frame joined to the one before, and pass over both."""
    return next((reply for _ in range(10) if (reply := said(line, frame))), b"")


COMMAND = struct.pack(">BHHBf", 16, SIMULATED_MAP.command_pa.address, 2, 4, PUSH_PA)


def test_the_slave_answers_its_unit_and_obeys_but_does_not_answer_all(slave_line: tuple[SerialLine, Device]) -> None:
    line, device = slave_line
    assert answer(line, framed(5, b"\x08\0\0\xab\xcd")) == framed(5, b"\x08\0\0\xab\xcd")
    assert answer(line, framed(5, COMMAND)) == framed(5, COMMAND[:5])
    assert said(line, framed(6, COMMAND), 0.1) == b""
    assert device.samples == 1
    for _ in range(20):
        assert said(line, framed(0, COMMAND), 0.1) == b""
        if device.samples > 1:
            break
    assert device.samples > 1
    assert answer(line, framed(5, b"\x08\0\1\0\0")) == framed(5, b"\x88\1")
    for unknown in (b"\x2b\x0e\1\0", b"\x41", b"\x64\0\0"):
        assert answer(line, framed(5, unknown)) == framed(5, bytes((unknown[0] | 0x80, 1)))


@pytest.mark.parametrize(
    "noise",
    [b"\5", b"\5\3\0\0", framed(5, COMMAND)[:-1] + b"\0", framed(5, COMMAND) + b"\1", 40 * b"\xff", 3000 * b"\5"],
    ids=["one byte", "short", "wrong check sum", "a byte too many", "ones", "longer than a frame"],
)
def test_the_slave_passes_over_noise_and_answers_the_next_frame(
    slave_line: tuple[SerialLine, Device], noise: bytes
) -> None:
    line, device = slave_line
    assert said(line, noise, 0.1) == b""
    assert device.samples == 0
    assert answer(line, framed(5, COMMAND)) == framed(5, COMMAND[:5])


def test_a_zero_behind_a_frame_which_the_check_sum_does_not_see_changes_nothing(
    slave_line: tuple[SerialLine, Device],
) -> None:
    line, device = slave_line
    assert answer(line, framed(5, COMMAND) + b"\0") == framed(5, b"\x90\3")
    assert device.samples == 0


def echoed(request: bytes, reply: bytes) -> bytes:
    """What a two-wire adapter hands over: the request itself, and what comes after it."""
    return request + reply


def echo_alone(request: bytes, _reply: bytes) -> bytes:
    return request


def on_two_wires(scripted: ScriptedDevice, *, local_echo: bool) -> ModbusRtuDriver:
    end = scripted.driver_end  # type: ignore[attr-defined]
    serial = SerialPort(path=end, baud=BAUD, local_echo=local_echo)
    return decided_by(scripted, ModbusRtuDriver(ModbusRtuDevice(serial=serial, reply_timeout_s=REPLY_TIMEOUT_S)))


def test_a_line_that_echoes_is_driven_if_it_is_said_to(scripted: ScriptedDevice) -> None:
    scripted.fault = echoed
    driver = on_two_wires(scripted, local_echo=True)
    driver.open()
    assert [driver.exchange(PUSH_PA).sample_counter for _ in range(3)] == [1, 2, 3]
    driver.close()


def test_an_echo_is_nobodys_answer(scripted: ScriptedDevice) -> None:
    scripted.fault = echo_alone
    driver = on_two_wires(scripted, local_echo=True)
    assert "nobody answers" in refused_as(NoConnection, driver.open)


def test_an_echo_that_nobody_spoke_of_is_named(scripted: ScriptedDevice) -> None:
    scripted.fault = echoed
    driver = on_two_wires(scripted, local_echo=False)
    assert "the line hands back what is sent: serial.local_echo = true" in refused_as(BadReply, driver.open)


def test_a_line_that_does_not_echo_as_said_is_named(scripted: ScriptedDevice) -> None:
    driver = on_two_wires(scripted, local_echo=True)
    assert "serial.local_echo = false" in refused_as(NoConnection, driver.open)


def test_a_device_that_needs_time_between_requests_gets_it_on_a_line_too() -> None:
    """Without it, it never starts; the error names the key."""
    with pseudo_line() as (end, other_end):
        device = ScriptedDevice(other_end)
        answered_s, needs_s = [-1.0], [PATIENCE_S]

        def hasty(_request: bytes, reply: bytes) -> bytes:
            now_s = time.monotonic()
            if answered_s[0] > 0.0 and now_s - answered_s[0] < needs_s[0]:
                return b""
            answered_s[0] = now_s
            return reply

        device.fault = hasty
        try:
            rushing = decided_by(device, ModbusRtuDriver(ModbusRtuDevice(serial=port(end), reply_timeout_s=0.3)))
            with pytest.raises(NoReply, match=r"one that needs time between requests: device\.pause_s"):
                rushing.open()
            needs_s[0] = 0.1
            time.sleep(0.1)
            config = ModbusRtuDevice(serial=port(end), reply_timeout_s=0.5, pause_s=0.15)
            patient = decided_by(device, ModbusRtuDriver(config))
            patient.open()
            assert patient.exchange(PUSH_PA).pressure_pa == pytest.approx(PUSH_PA)
            patient.close()
        finally:
            device.close()
