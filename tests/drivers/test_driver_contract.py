"""The contract that every driver keeps, against the simulated slave in lockstep; a class per driver.

The device itself (its counter, its held command, what it measures) judges what the driver says of it.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import pytest
from pymodbus.constants import ExcCodes

from config.device import ModbusTcpDevice
from config.modbus_map import SIMULATED_MAP, ModbusMap, Place
from config.quantities import CommunicationAction
from config.slave_file import SlaveFile
from config.tls_table import Tls
from config.valve_file import shipped_valve
from drivers.boundary import Driver, NoConnection, NoReply, Reading, Refused
from drivers.in_memory import MemoryDriver
from drivers.modbus_tcp import ModbusTcpDriver
from fieldbus.modbus.server import RegisterServer
from fieldbus.modbus.tls import Guard
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.recovery import opened

pytestmark = pytest.mark.real_time

FILE = SlaveFile.model_validate(
    {
        "clock": {"mode": "lockstep", "period_s": 2e-3},
        "sensor": {"noise_std_m": 1e-5, "seed": 5},
        "initial": {"position_m": 0.02, "pressure_pa": 17e3},
    }
)
HELD_PA = 17e3
PUSH_PA = 80e3


@dataclass
class Bench:
    """A device and the driver to it."""

    device: Device
    driver: Driver


class Server(Protocol):
    """What puts a device on a wire."""

    @property
    def lock(self) -> AbstractContextManager[object]:
        """Held, it keeps the device from answering."""
        ...

    @property
    def address(self) -> str:
        """Where it is."""
        ...

    def stop(self) -> None: ...


@dataclass
class WireBench(Bench):
    """The server between them, too."""

    server: Server


class DriverContract:
    """What holds for every driver."""

    resolution_m = 1e-8
    """How finely the position comes through."""
    one_transaction = True

    @pytest.fixture
    def make(self) -> Callable[[], Bench]:
        """Give new benches, each just switched on."""
        raise NotImplementedError

    @pytest.fixture
    def bench(self, make: Callable[[], Bench]) -> Bench:
        return make()

    def reading_is_of(self, device: Device, reading: Reading) -> bool:
        assert reading.position_m == pytest.approx(device.position_m, abs=self.resolution_m)
        assert reading.pressure_pa is not None
        assert reading.pressure_pa == pytest.approx(device.pressure_pa, rel=1e-4)
        assert reading.device_time_s is not None
        assert reading.device_time_s == pytest.approx(device.device_time_us / 1e6, abs=1e-12)
        assert (reading.sample_counter, reading.status) == (device.sample_counter, device.status)
        return True

    def test_open_moves_nothing_and_returns_the_held_command(self, bench: Bench) -> None:
        assert bench.driver.open() == HELD_PA
        assert (bench.device.samples, bench.device.command_pa) == (0, HELD_PA)

    def test_an_exchange_returns_a_measurement_newer_than_the_command(self, bench: Bench) -> None:
        bench.driver.open()
        for sample in range(1, 41):
            reading = bench.driver.exchange(PUSH_PA)
            assert reading.sample_counter == sample
            assert self.reading_is_of(bench.device, reading)
        assert bench.device.position_m > 0.03, "it moved"

    def test_counter_and_time_advance_together(self, bench: Bench) -> None:
        bench.driver.open()
        readings = [bench.driver.exchange(PUSH_PA) for _ in range(20)]
        assert [each.sample_counter for each in readings] == list(range(1, 21))
        assert [each.device_time_s for each in readings] == pytest.approx([0.002 * n for n in range(1, 21)])

    def test_a_reading_alone_moves_nothing(self, bench: Bench) -> None:
        bench.driver.open()
        bench.driver.exchange(PUSH_PA)
        assert bench.driver.read() == bench.driver.read()
        assert self.reading_is_of(bench.device, bench.driver.read())
        assert bench.device.samples == 1

    def test_a_command_alone_is_obeyed(self, bench: Bench) -> None:
        bench.driver.open()
        bench.driver.write(PUSH_PA)
        assert (bench.device.command_pa, bench.device.samples) == (PUSH_PA, 1)

    def test_what_it_can_do_is_known(self, bench: Bench) -> None:
        bench.driver.open()
        bench.driver.exchange(PUSH_PA)
        can = bench.driver.capabilities
        assert (can.one_transaction, can.device_time, can.sample_counter) == (self.one_transaction, True, True)

    @pytest.mark.parametrize("command_pa", [math.nan, math.inf, -math.inf, -10.0, 1e6])
    def test_a_bad_command_is_refused_and_nothing_changes(self, bench: Bench, command_pa: float) -> None:
        bench.driver.open()
        bench.driver.exchange(PUSH_PA)
        for act in (bench.driver.write, bench.driver.exchange):
            with pytest.raises(Refused) as caught:
                act(command_pa)
            assert caught.value.code == ExcCodes.ILLEGAL_VALUE
            assert "\n" not in str(caught.value)
        assert (bench.device.command_pa, bench.device.samples) == (PUSH_PA, 1)
        assert bench.driver.exchange(PUSH_PA).sample_counter == 2, "and the driver goes on"

    def test_a_driver_not_open_raises_and_does_nothing(self, bench: Bench) -> None:
        def every_call_raises() -> None:
            for act in (
                lambda: bench.driver.exchange(PUSH_PA),
                lambda: bench.driver.write(PUSH_PA),
                bench.driver.read,
            ):
                with pytest.raises(NoConnection):
                    act()

        every_call_raises()
        bench.driver.open()
        bench.driver.close()
        every_call_raises()
        bench.driver.close()
        assert bench.device.samples == 0

    def test_it_can_be_opened_again(self, bench: Bench) -> None:
        bench.driver.open()
        bench.driver.exchange(PUSH_PA)
        bench.driver.close()
        assert bench.driver.open() == PUSH_PA
        assert bench.driver.open() == PUSH_PA, "also without closing"
        assert bench.driver.exchange(PUSH_PA).sample_counter == 2

    def test_two_runs_are_alike_to_the_bit(self, make: Callable[[], Bench]) -> None:
        def run() -> list[Reading]:
            driver = make().driver
            driver.open()
            return [driver.exchange(20e3 + 500.0 * n) for n in range(100)]

        assert run() == run()


class WireContract(DriverContract):
    """What holds for every driver to another process."""

    reply_timeout_s = 1.0

    @pytest.fixture
    def bench(self, make: Callable[[], Bench]) -> WireBench:
        bench = make()
        assert isinstance(bench, WireBench)
        return bench

    def serve(self, device: Device, address: str | None) -> Server:
        """Put a device on the wire; where it was before, if that is given."""
        raise NotImplementedError

    def test_a_device_that_is_gone_is_reported_at_once_and_nothing_stale_comes_after_its_return(
        self, bench: WireBench
    ) -> None:
        bench.driver.open()
        bench.driver.exchange(PUSH_PA)
        address = bench.server.address
        bench.server.stop()
        for _ in range(3):
            with pytest.raises((NoConnection, NoReply)):
                bench.driver.exchange(PUSH_PA)
        with pytest.raises(NoConnection):
            bench.driver.open()
        bench.device.tick(60e3)
        bench.server = self.serve(bench.device, address)
        assert bench.driver.open() == 60e3
        reading = bench.driver.exchange(PUSH_PA)
        assert reading.sample_counter == 3
        assert self.reading_is_of(bench.device, reading)

    def test_a_device_that_hangs_is_reported_and_its_late_answer_never_taken(self, bench: WireBench) -> None:
        bench.driver.open()
        with bench.server.lock, pytest.raises(NoReply):  # its registers are held: no answer
            bench.driver.exchange(PUSH_PA)
        with pytest.raises(NoConnection):
            bench.driver.exchange(PUSH_PA)
        late_until_s = time.monotonic() + 60
        while bench.device.samples == 0 and time.monotonic() < late_until_s:  # it obeys after all
            time.sleep(1e-3)
        assert opened(bench.driver) == PUSH_PA
        reading = bench.driver.exchange(60e3)
        assert reading.sample_counter == 2
        assert self.reading_is_of(bench.device, reading)

    def test_the_device_is_told_what_to_do_in_silence(self, bench: WireBench) -> None:
        bench.driver.open()
        assert bench.device.communication_timeout_s == 1.5
        assert bench.device.communication_action is CommunicationAction.VENT


class TestMemory(DriverContract):
    @pytest.fixture
    def make(self) -> Callable[[], Bench]:
        def make() -> Bench:
            device = device_of(FILE, shipped_valve("seed"))
            return Bench(device, MemoryDriver(device))

        return make


class Without23(RegisterServer):
    """A server that does not know function 23."""

    def answer(self, pdu: bytes, peer: str) -> bytes:
        return b"\x97\1" if pdu[0] == 23 else super().answer(pdu, peer)


class TestModbusTcp(WireContract):
    registers: ModbusMap = SIMULATED_MAP
    server_type: type[RegisterServer] = RegisterServer
    driver_tls: Tls | None = None
    guard: Guard | None = None

    @pytest.fixture
    def make(self) -> Iterator[Callable[[], Bench]]:
        benches: list[WireBench] = []

        def make() -> WireBench:
            device = device_of(FILE, shipped_valve("seed"))
            server = self.serve(device, None)
            config = ModbusTcpDevice(
                port=server.port,
                map=self.registers,
                reply_timeout_s=self.reply_timeout_s,
                communication_timeout_s=1.5,
                communication_action="vent",
                tls=self.driver_tls,
            )
            benches.append(WireBench(device, ModbusTcpDriver(config), server))
            return benches[-1]

        yield make
        for bench in benches:
            bench.driver.close()
            bench.server.stop()

    def serve(self, device: Device, address: str | None) -> RegisterServer:
        registers = DeviceRegisters(device, Lockstep(device), self.registers)
        port = int(address.rpartition(":")[2]) if address else 0
        server = self.server_type(registers, "127.0.0.1", port, 1, self.guard)
        server.start()
        return server


class TestModbusTcpWithoutFunction23(TestModbusTcp):
    server_type = Without23
    one_transaction = False


class TestModbusTcpInputRegisters(TestModbusTcp):
    """The measurements lie where function 23 cannot read."""

    registers = SIMULATED_MAP.model_copy(
        update={name: place.model_copy(update={"table": "input"}) for name, place in SIMULATED_MAP.sampled.items()}
    )
    one_transaction = False


class TestModbusTcpForeignMap(TestModbusTcp):
    """A device of another make: scaled integers, words the other way round, gaps, its own order."""

    resolution_m = 0.5e-5 + 1e-9
    registers = ModbusMap(
        device_time_us=Place(address=100, type="uint32", word_order="little", scale=1000.0),
        status=Place(address=103, type="uint16"),
        position_m=Place(address=104, type="int16", scale=1e-5, offset=0.05),
        pressure_pa=Place(address=106, type="float64", word_order="little", scale=1e5),
        sample_counter=Place(address=112, type="uint32", word_order="little"),
        command_pa=Place(address=20, type="uint16", scale=10.0),
        communication_timeout_s=Place(address=30, type="uint16", scale=0.1),
        communication_action=Place(address=40, type="int16"),
    )
