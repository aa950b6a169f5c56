"""The Modbus driver before a device that is not ours and knows little: modbus-tk, and functions 3, 4 and 6 alone."""

import struct
from collections.abc import Iterator
from contextlib import suppress

import pytest
from modbus_tk import defines
from modbus_tk.modbus import Slave
from modbus_tk.modbus_tcp import TcpServer

from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from config.modbus_map import ModbusMap, Place
from drivers import driver_for
from positioner.control.settings import Settings
from positioner.daemon.link import Link
from positioner.daemon.pacing import RealTimePace
from tests.other_device import _free_port

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.filterwarnings("ignore:isSet:DeprecationWarning", "ignore:setDaemon:DeprecationWarning"),
]

UNIT, COUNTER, POSITION, COMMAND = 2, 9, 10, 60
KNOWN = (defines.READ_HOLDING_REGISTERS, defines.READ_INPUT_REGISTERS, defines.WRITE_SINGLE_REGISTER)


class PlainDevice:
    """Whole numbers: the position in tenths of a millimetre, the command in kPa, a counter of samples that wraps."""

    def __init__(self) -> None:
        self.port = _free_port()
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
        device.server.stop()


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


def test_a_set_point_of_coarse_digits_is_no_restart(device: PlainDevice) -> None:
    """The device may round to its own digits what it is told."""
    file = DaemonFile.model_validate({"valve": {"stroke_m": 0.03}, "device": device.described(None).model_dump()})
    assert Settings.of(file).limits.restart_tolerance_pa == 1000.0
