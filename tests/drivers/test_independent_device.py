"""Our drivers against devices that are not ours: servers of modbus-tk, on TCP and on a serial line.

With the product's library at both ends, a misreading of it would agree with itself.
"""

import socket
import struct
from collections.abc import Iterator

import pytest
import serial
from modbus_tk import defines
from modbus_tk.modbus import Slave
from modbus_tk.modbus_rtu import RtuServer
from modbus_tk.modbus_tcp import TcpServer

from config.device import ModbusRtuDevice, ModbusTcpDevice
from config.modbus_map import SIMULATED_MAP
from config.serial_port import SerialPort
from drivers.boundary import Refused
from drivers.modbus_device import ModbusDriver
from drivers.modbus_rtu import ModbusRtuDriver
from drivers.modbus_tcp import ModbusTcpDriver
from positioner.cli.parts.pseudo_line import pseudo_line
from tests.other_device import stop_server

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.filterwarnings("ignore:isSet:DeprecationWarning", "ignore:setDaemon:DeprecationWarning"),
]

UNIT = 9
TIMEOUT_S = 10.0
COMMAND = SIMULATED_MAP.command_pa.address
SAMPLE = struct.pack(">ffIQH", 0.0321, 54321.0, 70_000, 1 << 40, 2)
HELD_PA, PUSH_PA = 17e3, 80e3


def words(data: bytes) -> list[int]:
    return list(struct.unpack(f">{len(data) // 2}H", data))


def device_on(server: TcpServer | RtuServer) -> Slave:
    """Give the server a device that holds a sample and a command; let it answer."""
    slave = server.add_slave(UNIT)
    slave.add_block("registers", defines.HOLDING_REGISTERS, 0, 16)
    slave.set_values("registers", 0, words(SAMPLE + struct.pack(">ffH", HELD_PA, 0.0, 0)))
    server.start()
    return slave


@pytest.fixture
def on_tcp() -> Iterator[tuple[ModbusDriver, Slave]]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    server = TcpServer(port, "127.0.0.1")
    slave = device_on(server)
    driver = ModbusTcpDriver(
        ModbusTcpDevice(port=port, unit=UNIT, reply_timeout_s=TIMEOUT_S, communication_timeout_s=2.5)
    )
    while not listens(port):
        pass
    yield driver, slave
    driver.close()
    stop_server(server, port)


def listens(port: int) -> bool:
    with socket.socket() as line:
        return line.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def on_rtu() -> Iterator[tuple[ModbusDriver, Slave]]:
    with pseudo_line() as (end, other_end), serial.Serial(other_end, 115200) as line:
        server = RtuServer(line)
        slave = device_on(server)
        port = SerialPort(path=end, baud=115200)
        driver = ModbusRtuDriver(
            ModbusRtuDevice(serial=port, unit=UNIT, reply_timeout_s=TIMEOUT_S, communication_timeout_s=2.5)
        )
        yield driver, slave
        driver.close()
        server.stop()


@pytest.fixture(params=["on_tcp", "on_rtu"])
def bench(request: pytest.FixtureRequest) -> tuple[ModbusDriver, Slave]:
    both: tuple[ModbusDriver, Slave] = request.getfixturevalue(request.param)
    return both


def test_it_is_opened_commanded_and_read(bench: tuple[ModbusDriver, Slave]) -> None:
    driver, slave = bench
    assert driver.open() == HELD_PA
    assert slave.get_values("registers", COMMAND, 5) == tuple(words(struct.pack(">ffH", HELD_PA, 2.5, 0)))
    for reading in (driver.exchange(PUSH_PA), driver.read()):
        assert reading.position_m == pytest.approx(0.0321, rel=1e-6)
        assert (reading.pressure_pa, reading.sample_counter, reading.status) == (54321.0, 70_000, 2)
        assert reading.device_time_s == (1 << 40) / 1e6
    assert slave.get_values("registers", COMMAND, 2) == tuple(words(struct.pack(">f", PUSH_PA)))
    assert driver.capabilities.one_transaction
    driver.write(30e3)
    assert slave.get_values("registers", COMMAND, 2) == tuple(words(struct.pack(">f", 30e3)))


def test_its_exception_is_a_refusal(bench: tuple[ModbusDriver, Slave]) -> None:
    driver, slave = bench
    driver.open()
    slave.remove_block("registers")
    slave.add_block("few", defines.HOLDING_REGISTERS, 0, 4)
    with pytest.raises(Refused, match="exception 2, illegal data address"):
        driver.read()
