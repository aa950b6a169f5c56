"""The simulated device as registers: what can be read, what can be written, and that the rest changes nothing."""

import struct
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from config.modbus_map import SIMULATED_MAP, ModbusMap, Place
from config.register_format import Format
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.server import RegisterServer
from sim.slave.clocks import Lockstep, RealTime
from sim.slave.device_registers import DeviceRegisters
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.independent import independent_client

pytestmark = pytest.mark.real_time

PLACES = SIMULATED_MAP.places
COMMAND = PLACES["command_pa"].address
TIMEOUT = PLACES["communication_timeout_s"].address
ACTION = PLACES["communication_action"].address
END = PLACES["communication_action"].end
SAMPLE = PLACES["command_pa"].address
NOTHING = {"command_pa": 0.0, "communication_timeout_s": 0.0, "communication_action": 0, "sample_counter": 0}


class Bench:
    def __init__(self, registers: ModbusMap = SIMULATED_MAP, **tables: Any) -> None:
        self.device = device_of(SlaveFile.model_validate(tables), shipped_valve("seed"))
        self.server = RegisterServer(DeviceRegisters(self.device, Lockstep(self.device), registers), "127.0.0.1", 0, 1)

    def ask(self, pdu: bytes) -> bytes:
        return self.server.answer(pdu, "test")

    def write(self, address: int, data: bytes) -> bytes:
        return self.ask(struct.pack(">BHHB", 16, address, len(data) // 2, len(data)) + data)

    def read(self, name: str, table: int = 3) -> float:
        place = PLACES[name]
        reply = self.ask(struct.pack(">BHH", table, place.address, place.format.words))
        return place.format.decode(struct.unpack(f">{place.format.words}H", reply[2:]))


@pytest.fixture
def bench() -> Bench:
    return Bench(clock={"mode": "lockstep"})


def f32(value: float) -> bytes:
    return struct.pack(">f", value)


COARSE = ModbusMap(
    position_m=Place(address=0, type="int16", scale=1e-7),
    pressure_pa=Place(address=1, type="uint16"),
    sample_counter=Place(address=2, type="uint16"),
    device_time_us=Place(address=3, type="uint16", scale=1000.0),
    command_pa=Place(address=10, type="uint16", scale=100.0),
)


def test_what_registers_cannot_hold_saturates_and_what_counts_begins_again() -> None:
    """It was a traceback and exception 4 a request, for ever."""
    bench = Bench(COARSE, clock={"mode": "lockstep"}, initial={"position_m": 0.03, "pressure_pa": 90e3})
    for samples, counter, time_ms in ((0, 0, 0), (65_535, 65_535, 65_535), (2, 1, 1)):
        bench.device.advance(samples)
        reply = bench.ask(struct.pack(">BHH", 3, 0, 4))
        assert struct.unpack(">hHHH", reply[2:]) == (32_767, 65_535, counter, time_ms)
    assert Format("int16").limits == (-32_768, 32_767)
    assert Format("uint32").limits == (0, 2**32 - 1)
    assert Format("float32").encode(Format("float32").limits[1]) == [0x7F7F, 0xFFFF]


@pytest.mark.parametrize("table", [3, 4])
def test_a_command_passes_one_period_and_every_quantity_reads_back(bench: Bench, table: int) -> None:
    assert bench.write(COMMAND, f32(60e3)) == struct.pack(">BHH", 16, COMMAND, 2)
    device: Device = bench.device
    for _ in range(29):
        bench.write(COMMAND, f32(60e3))
    assert bench.read("position_m", table) == pytest.approx(device.position_m, rel=1e-6)
    assert bench.read("position_m", table) > 1e-3
    assert bench.read("pressure_pa", table) == 60e3
    assert bench.read("sample_counter", table) == 30
    assert bench.read("device_time_us", table) == 30_000
    assert bench.read("command_pa", table) == 60e3


def test_timeout_action_and_command_are_written_at_once_or_each_alone(bench: Bench) -> None:
    bench.write(COMMAND, f32(10e3) + f32(2.5) + b"\0\1")
    assert [bench.read(name) for name in NOTHING] == [10e3, 2.5, 1, 1]
    assert bench.ask(struct.pack(">BHH", 6, ACTION, 2)) == struct.pack(">BHH", 6, ACTION, 2)
    bench.write(TIMEOUT, f32(0.5))
    assert [bench.read(name) for name in NOTHING] == [10e3, 0.5, 2, 1], "no period passed"


@pytest.mark.parametrize(
    ("address", "data", "exception"),
    [
        (COMMAND, f32(float("nan")), 3),
        (COMMAND, f32(float("inf")), 3),
        (COMMAND, f32(-1.0), 3),
        (COMMAND, f32(420_001.0), 3),
        (TIMEOUT, f32(-1.0), 3),
        (TIMEOUT, f32(float("nan")), 3),
        (ACTION, b"\0\3", 3),
        (COMMAND, f32(10e3) + f32(1.0) + b"\0\7", 3),
        (COMMAND, f32(-1.0) + f32(1.0) + b"\0\1", 3),
        (COMMAND, f32(10e3) + f32(-1.0) + b"\0\1", 3),
        (0, f32(0.01), 2),
        (PLACES["status"].address, b"\0\0", 2),
        (COMMAND - 1, b"\0\0" + f32(10e3), 2),
        (COMMAND, f32(10e3)[:2], 2),
        (COMMAND + 1, f32(10e3)[2:], 2),
        (COMMAND, f32(10e3) + f32(1.0)[:2], 2),
        (ACTION, b"\0\1\0\0", 2),
        (END, b"\0\0", 2),
        (60_000, f32(1.0), 2),
    ],
)
def test_a_bad_write_gets_its_exception_and_nothing_changes(
    bench: Bench, address: int, data: bytes, exception: int
) -> None:
    assert bench.write(address, data) == bytes((0x90, exception))
    assert {name: bench.read(name) for name in NOTHING} == NOTHING


@pytest.mark.parametrize("address", [COMMAND, COMMAND + 1, TIMEOUT, TIMEOUT + 1, 0])
def test_half_a_value_or_a_read_only_one_cannot_be_written_with_function_6(bench: Bench, address: int) -> None:
    assert bench.ask(struct.pack(">BHH", 6, address, 0)) == b"\x86\2"
    assert {name: bench.read(name) for name in NOTHING} == NOTHING


def test_function_23_with_a_bad_read_range_obeys_nothing(bench: Bench) -> None:
    for start, count in ((END - 1, 2), (END, 1), (60_000, 4)):
        request = struct.pack(">BHHHHB", 23, start, count, COMMAND, 2, 4) + f32(10e3)
        assert bench.ask(request) == b"\x97\2"
    assert {name: bench.read(name) for name in NOTHING} == NOTHING


def test_function_23_reads_what_the_command_led_to(bench: Bench) -> None:
    request = struct.pack(">BHHHHB", 23, 0, SAMPLE, COMMAND, 2, 4) + f32(60e3)
    reply = bench.ask(request)
    position_m, pressure_pa, counter, time_us, status = struct.unpack(">ffIQH", reply[2:])
    assert (pressure_pa, counter, time_us, status) == (60e3, 1, 1000, 0)
    assert position_m == pytest.approx(bench.device.position_m, rel=1e-6)


def test_registers_between_the_quantities_of_a_foreign_map_read_zero() -> None:
    registers = ModbusMap(position_m=Place(address=100), command_pa=Place(address=110, type="uint16", scale=10.0))
    bench = Bench(registers, clock={"mode": "lockstep"})
    assert bench.ask(struct.pack(">BHH", 6, 110, 5000)) == struct.pack(">BHH", 6, 110, 5000)
    assert bench.device.command_pa == 50e3
    assert bench.ask(struct.pack(">BHH", 3, 102, 9)) == bytes((3, 18)) + 16 * b"\0" + struct.pack(">H", 5000)
    assert bench.ask(struct.pack(">BHH", 3, 99, 2)) == b"\x83\2"


def test_in_real_time_a_read_is_brought_up_to_date() -> None:
    now_ns = 0
    device = device_of(SlaveFile(), shipped_valve("seed"))
    server = RegisterServer(DeviceRegisters(device, RealTime(device, 1000, lambda: now_ns)), "127.0.0.1", 0, 1)
    now_ns = 7_500_000
    place = PLACES["sample_counter"]
    assert server.answer(struct.pack(">BHH", 4, place.address, 2), "test") == struct.pack(">BBI", 4, 4, 7)


@pytest.fixture
def served() -> Iterator[Bench]:
    bench = Bench(clock={"mode": "lockstep", "period_s": 1e-3}, supply={"maximum_pa": 400e3})
    bench.server.start()
    yield bench
    bench.server.stop()


# Two floats whose words, mixed, make two others: 0x47000080 and 0x47800000.
TWO_PA = (32768.5, 65536.0)


def test_a_float_is_never_torn_between_writers_and_readers(served: Bench) -> None:
    """Two clients write two pressures in turn, one reads: it never sees a mixture, nor a sample of two moments."""
    writing = threading.Event()
    writing.set()

    def write(pressure_pa: float) -> None:
        words = PLACES["command_pa"].format.encode(pressure_pa)
        client = ModbusClient("127.0.0.1", served.server.port, 1, 20.0)
        client.open()
        while writing.is_set():
            client.write_registers(COMMAND, words)
        client.close()

    writers = [threading.Thread(target=write, args=(each,)) for each in TWO_PA]
    for writer in writers:
        writer.start()
    seen = set()
    with independent_client(served.server.port) as client:
        for _ in range(1500):
            words = client.read_holding(0, COMMAND + 2)
            _, pressure_pa, counter, time_us, _, command_pa = struct.unpack(
                ">ffIQHf", struct.pack(f">{COMMAND + 2}H", *words)
            )
            assert command_pa in (0.0, *TWO_PA)
            assert pressure_pa == command_pa, "pressure and command of one moment"
            assert time_us == 1000 * counter
            seen.add(command_pa)
    writing.clear()
    for writer in writers:
        writer.join()
    assert seen >= set(TWO_PA), "the test saw both"


def run_over_tcp(commands_pa: list[float], seed: int) -> list[bytes]:
    bench = Bench(clock={"mode": "lockstep"}, sensor={"noise_std_m": 1e-5, "seed": seed})
    bench.server.start()
    replies = []
    with independent_client(bench.server.port) as client:
        for command_pa in commands_pa:
            words = PLACES["command_pa"].format.encode(command_pa)
            reply = client.write_and_read(COMMAND, words, 0, SAMPLE)
            replies.append(struct.pack(f">{SAMPLE}H", *reply))
    bench.server.stop()
    return replies


def test_two_runs_in_lockstep_are_alike_to_the_bit() -> None:
    commands_pa = [30e3 + 400.0 * n for n in range(150)]
    first = run_over_tcp(commands_pa, seed=3)
    assert run_over_tcp(commands_pa, seed=3) == first
    assert run_over_tcp(commands_pa, seed=4) != first
    assert len(set(first)) == len(first)
