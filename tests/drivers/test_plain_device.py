"""The Modbus driver before a device that is not ours and knows little: modbus-tk, and functions 3, 4 and 6 alone."""

import struct
from collections.abc import Iterator
from contextlib import suppress

import pytest
from modbus_tk import defines
from modbus_tk.modbus import Slave
from modbus_tk.modbus_tcp import TcpServer

from config.codes import Quality
from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from config.modbus_map import ActionCodes, ModbusMap, Place, StatusBits
from config.quantities import DeviceStatus
from drivers import driver_for
from fieldbus.modbus import client as modbus_client
from positioner.cli.parts.sampling_order import when_shown
from positioner.control.settings import Settings
from positioner.daemon.link import SETTINGS_EVERY, Link, LinkSettings
from positioner.daemon.pacing import RealTimePace
from tests.other_device import await_listening, free_port, stop_server

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.filterwarnings("ignore:isSet:DeprecationWarning", "ignore:setDaemon:DeprecationWarning"),
]

UNIT, COUNTER, POSITION, COMMAND = 2, 9, 10, 60
KNOWN = (defines.READ_HOLDING_REGISTERS, defines.READ_INPUT_REGISTERS, defines.WRITE_SINGLE_REGISTER)


class PlainDevice:
    """Whole numbers: the position in tenths of a millimetre, the command in kPa, a counter of samples that wraps."""

    def __init__(self) -> None:
        self.port = free_port()
        self.server = TcpServer(self.port, "127.0.0.1")
        self.slave: Slave = self.server.add_slave(UNIT)
        self.slave.add_block("registers", defines.HOLDING_REGISTERS, 0, 64)
        self.functions: list[int] = []
        answers = self.slave.handle_request

        def handle_request(request: bytes, broadcast: bool = False) -> bytes:
            self.functions.append(request[0])
            if request[0] not in KNOWN:
                return struct.pack(">BB", request[0] | 0x80, defines.ILLEGAL_FUNCTION)
            reply: bytes = answers(request, broadcast)
            return reply

        self.slave.handle_request = handle_request
        self.show(POSITION, 150)
        self.show(COMMAND, 40)
        self.server.start()
        await_listening(self.port)

    def show(self, address: int, word: int) -> None:
        self.slave.set_values("registers", address, [word])

    @property
    def command(self) -> int:
        (word,) = self.slave.get_values("registers", COMMAND, 1)
        return int(word)

    def described(self, bits: int | None) -> ModbusTcpDevice:
        registers = ModbusMap(
            position_m=Place(address=POSITION, type="uint16", scale=1e-4),
            sample_counter=Place(address=COUNTER, type="uint16"),
            sample_counter_bits=bits,
            command_pa=Place(address=COMMAND, type="uint16", scale=1000.0),
        )
        return ModbusTcpDevice(port=self.port, unit=UNIT, reply_timeout_s=2.0, map=registers)


@pytest.fixture
def device() -> Iterator[PlainDevice]:
    device = PlainDevice()
    yield device
    with suppress(Exception):
        stop_server(device.server, device.port)


@pytest.mark.parametrize(("bits", "last"), [(None, 65535), (8, 255)])
def test_a_device_of_function_6_and_a_short_counter_is_driven_and_loses_nothing(
    device: PlainDevice, bits: int | None, last: int
) -> None:
    driver = driver_for(device.described(bits))
    link = Link(driver, RealTimePace(0.01))
    device.show(COUNTER, last - 1)
    assert link.open()[0] == 40e3
    for counter, command_pa in ((last, 50e3), (0, 51e3), (1, 52e3)):
        device.show(COUNTER, counter)
        assert link.exchange(command_pa).position_m == pytest.approx(0.015)
        assert device.command == command_pa / 1000
    assert link.counts.lost_samples == 0
    assert device.functions[-2:] == [6, 3], "and the functions it does not know are not tried again"
    link.release()


def test_a_device_that_gives_few_registers_at_once_is_asked_for_each_quantity(
    device: PlainDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = device.slave.handle_request

    def few(request: bytes, broadcast: bool = False) -> bytes:
        reads = request[0] == defines.READ_HOLDING_REGISTERS
        if reads and struct.unpack(">H", request[3:5])[0] > 1:
            return struct.pack(">BB", request[0] | 0x80, defines.ILLEGAL_DATA_VALUE)
        reply: bytes = answers(request, broadcast)
        return reply

    monkeypatch.setattr(device.slave, "handle_request", few)
    device.show(COUNTER, 7)
    link = Link(driver_for(device.described(None)), RealTimePace(0.01))
    link.open()
    assert link.exchange(50e3).position_m == pytest.approx(0.015)
    link.release()
    assert device.command == 50


def test_a_device_that_was_silent_behind_its_gateway_is_looked_at_before_it_is_commanded(
    device: PlainDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may have been restarted meanwhile: its gateway keeps the connection, and answers for it."""
    link = Link(driver_for(device.described(None)), RealTimePace(0.01))
    link.open()
    link.exchange(50e3)
    answers = device.slave.handle_request

    def power_fails(request: bytes, _broadcast: bool = False) -> bytes:
        device.show(COMMAND, 0)
        monkeypatch.setattr(device.slave, "handle_request", answers)
        return struct.pack(">BB", request[0] | 0x80, 11)

    monkeypatch.setattr(device.slave, "handle_request", power_fails)
    held_pa = [link.exchange(50e3).held_pa for _ in range(2)]
    link.release()
    assert (held_pa, device.command) == ([None, 0.0], 0)


def test_a_gateway_that_is_an_answer_behind_is_not_believed(
    device: PlainDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What its line says too late it gives for the next question: the position, 150, for the command, in kPa."""
    registers = ModbusMap(
        position_m=Place(address=POSITION, type="uint16", scale=1e-4),
        command_pa=Place(address=COMMAND, type="uint16", scale=1000.0),
    )
    link = Link(driver_for(ModbusTcpDevice(port=device.port, unit=UNIT, map=registers)), RealTimePace(0.01))
    link.open()
    link.exchange(50e3)
    answers, behind = device.slave.handle_request, list[bytes]()

    def one_behind(request: bytes, broadcast: bool = False) -> bytes:
        behind.append(answers(request, broadcast))
        if len(behind) > 1:
            return behind.pop(0)
        return struct.pack(">BB", request[0] | 0x80, 11) if request[0] == 3 else behind.pop()

    monkeypatch.setattr(device.slave, "handle_request", one_behind)
    samples = [link.exchange(50e3) for _ in range(3)]
    assert {(each.quality, each.held_pa) for each in samples} == {(Quality.LOST, None)}
    assert behind, "it was behind all the while"
    monkeypatch.setattr(device.slave, "handle_request", answers)
    while (back := link.exchange(50e3)).quality is Quality.LOST:
        pass
    assert (back.held_pa, device.command) == (50e3, 50)
    assert back.position_m == pytest.approx(0.015)
    link.release()


def test_a_set_point_of_coarse_digits_is_no_restart(device: PlainDevice) -> None:
    """The device may round to its own digits what it is told."""
    file = DaemonFile.model_validate({"valve": {"stroke_m": 0.03}, "device": device.described(None).model_dump()})
    assert Settings.of(file).limits.restart_tolerance_pa == 1000.0


def test_a_coarse_pressure_register_is_known_to_round() -> None:
    places = {"position_m": {"address": 0}, "command_pa": {"address": 4}}
    for pressure, said_pa, noise_pa in (
        ({"address": 8, "type": "uint16", "scale": 100.0}, 0.0, 100.0 / 12**0.5),
        ({"address": 8, "type": "uint16", "scale": 100.0}, 50.0, 50.0),
        ({"address": 8}, 0.0, 0.0),
    ):
        described = {
            "valve": {"stroke_m": 0.03},
            "device": {"map": {**places, "pressure_pa": pressure}},
            "identification": {"pressure_noise_std_pa": said_pa},
        }
        settings = Settings.of(DaemonFile.model_validate(described))
        assert settings.identification.pressure_noise_std_pa == pytest.approx(noise_pa)


IN_INPUT, BEHIND_HOLE, STATUS, ACTION = 3, 40, 41, 61
HEALTHY, SENSOR_BAD = 0b1, 0b101


def scattered(device: PlainDevice) -> ModbusTcpDevice:
    """Its position is an input register, and its pressure lies behind registers that it has not."""
    device.slave.remove_block("registers")
    device.slave.add_block("registers", defines.HOLDING_REGISTERS, BEHIND_HOLE, 2)
    device.slave.add_block("counter", defines.HOLDING_REGISTERS, COUNTER, 1)
    device.slave.add_block("commands", defines.HOLDING_REGISTERS, COMMAND, 2)
    device.slave.add_block("inputs", defines.ANALOG_INPUTS, IN_INPUT, 1)
    device.slave.set_values("inputs", IN_INPUT, [150])
    device.slave.set_values("registers", BEHIND_HOLE, [41, HEALTHY])
    device.slave.set_values("commands", COMMAND, [40, 0])
    registers = ModbusMap(
        position_m=Place(table="input", address=IN_INPUT, type="uint16", scale=1e-4),
        pressure_pa=Place(address=BEHIND_HOLE, type="uint16", scale=1000.0),
        status=Place(address=STATUS, type="uint16"),
        sample_counter=Place(address=COUNTER, type="uint16"),
        command_pa=Place(address=COMMAND, type="uint16", scale=1000.0),
        communication_action=Place(address=ACTION, type="uint16"),
        status_bits=StatusBits(ready=1, sensor_fault=4),
        communication_action_codes=ActionCodes(hold=7, vent=3),
    )
    return ModbusTcpDevice(port=device.port, unit=UNIT, reply_timeout_s=2.0, map=registers)


def test_what_lies_in_two_tables_and_behind_a_hole_is_read_in_parts(device: PlainDevice) -> None:
    driver = driver_for(scattered(device))
    assert driver.open() == 40e3
    assert device.slave.get_values("commands", ACTION, 1) == (7,), "the device's own number for hold"
    for bits, status in ((HEALTHY, 0), (SENSOR_BAD, DeviceStatus.SENSOR_FAULT), (0, DeviceStatus.NOT_READY)):
        device.slave.set_values("registers", STATUS, [bits])
        device.functions.clear()
        reading = driver.exchange(50e3)
        assert reading.position_m == pytest.approx(0.015)
        assert (reading.pressure_pa, reading.status) == (41e3, status)
    assert device.functions == [6, 3, 3, 4], "and the hole is not tried again"
    driver.close()


def test_a_second_master_that_writes_the_set_point_is_seen_by_reading_it_back(device: PlainDevice) -> None:
    link = Link(driver_for(device.described(None)), RealTimePace(0.01), LinkSettings(read_back_s=1e-9))
    link.open()
    for counter in (1, 2):
        device.show(COUNTER, counter)
        assert not link.exchange(50e3).overwritten
    device.show(COMMAND, 70)
    device.show(COUNTER, 3)
    sample = link.exchange(50e3)
    assert (sample.overwritten, sample.held_pa, sample.quality) == (True, 70e3, Quality.GOOD)
    assert device.command == 70, "nothing was commanded"
    device.show(COUNTER, 4)
    assert not link.exchange(70e3).overwritten, "what it holds is what it is told from now on"
    link.release()


def test_a_device_that_was_restarted_between_two_commands_is_known_by_its_settings(device: PlainDevice) -> None:
    """It has its command again by then; its time-out nobody would give it back."""
    timeout, action = 20, 21
    described = device.described(None)
    places = {
        "communication_timeout_s": Place(address=timeout, type="uint16", scale=0.1),
        "communication_action": Place(address=action, type="uint16"),
    }
    told = {"map": described.map.model_copy(update=places), "communication_timeout_s": 2.0}
    settings = LinkSettings(read_back_s=1e-9)
    link = Link(driver_for(described.model_copy(update=told)), RealTimePace(0.01), settings)
    link.open()
    samples = []
    for counter in range(3 * SETTINGS_EVERY):
        device.show(COUNTER, counter)
        samples.append(link.exchange(50e3))
        if counter == SETTINGS_EVERY:  # both were asked for once, and nothing was found
            device.show(timeout, 0)
    link.release()
    (found,) = (each for each in samples if each.restarted)
    assert found.held_pa == 50e3, "it was looked at, and not commanded"
    assert {each.quality for each in samples} == {Quality.GOOD}
    assert device.slave.get_values("registers", timeout, 1) == (20,), "it was told again"


@pytest.mark.parametrize("sampling", ["before", "after"])
def test_when_a_device_samples_is_seen_by_a_change_of_the_command(device: PlainDevice, sampling: str) -> None:
    """One latches its pressure before it takes a command, the other makes it when it is asked."""
    pressure = 12
    device.show(pressure, 40)
    answers = device.slave.handle_request

    def handle_request(request: bytes, broadcast: bool = False) -> bytes:
        if request[0] == defines.WRITE_SINGLE_REGISTER:
            (commanded,) = struct.unpack(">H", request[3:5])
            device.show(pressure, device.command if sampling == "before" else commanded)
        reply: bytes = answers(request, broadcast)
        return reply

    device.slave.handle_request = handle_request
    described = device.described(None)
    places = described.map.model_copy(update={"pressure_pa": Place(address=pressure, type="uint16", scale=1000.0)})
    driver = driver_for(described.model_copy(update={"map": places}))
    shown = when_shown(driver, driver.open(), 2e3)
    assert (shown.sampling, device.command) == (sampling, 40), "and the command is put back"
    driver.close()


def test_neither_an_exception_nor_a_number_that_is_none_ends_a_good_connection(
    device: PlainDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.slave.remove_block("registers")
    device.slave.add_block("registers", defines.HOLDING_REGISTERS, 0, 64)
    registers = ModbusMap(
        position_m=Place(address=POSITION), command_pa=Place(address=COMMAND, type="uint16", scale=1000.0)
    )
    driver = driver_for(ModbusTcpDevice(port=device.port, unit=UNIT, reply_timeout_s=2.0, map=registers))
    link = Link(driver, RealTimePace(0.01))
    number, none = struct.unpack(">HH", struct.pack(">f", 0.015)), (0x7FC0, 0)
    device.slave.set_values("registers", POSITION, number)
    link.open()
    busy = [False]
    answers = device.slave.handle_request

    def handle_request(request: bytes, broadcast: bool = False) -> bytes:
        if busy[0]:
            return struct.pack(">BB", request[0] | 0x80, defines.SLAVE_DEVICE_BUSY)
        reply: bytes = answers(request, broadcast)
        return reply

    device.slave.handle_request = handle_request
    monkeypatch.setattr(modbus_client, "connected", lambda *_: pytest.fail("connected anew"))
    qualities = []
    for words, is_busy in ((number, False), (none, False), (number, False), (number, True), (number, False)):
        device.slave.set_values("registers", POSITION, words)
        busy[0] = is_busy
        qualities.append(link.exchange(50e3).quality)
    assert qualities == [Quality.GOOD, Quality.NO_NUMBER, Quality.GOOD, Quality.LOST, Quality.GOOD]
    link.release()


def test_in_shadow_a_device_is_read_and_never_written_to(device: PlainDevice) -> None:
    described = device.described(None)
    link = Link(driver_for(described.read_only()), RealTimePace(0.01), LinkSettings(shadow=True))
    link.open()
    device.show(COUNTER, 1)
    assert link.exchange(90e3).quality is Quality.GOOD
    link.leave(0.0)
    link.release()
    assert device.command == 40
    assert set(device.functions) <= {3, 4}
