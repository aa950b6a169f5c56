"""The map of a device: where the simulated one keeps its quantities, and which maps of real ones are refused."""

from typing import Any

import pytest
from pydantic import ValidationError

from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from config.errors import InputError
from config.loading import validate
from config.modbus_map import SIMULATED_MAP, ModbusMap, Place, StatusBits, without_holes
from config.quantities import QUANTITIES, WRITABLE, DeviceStatus


def refusal(tables: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        validate(ModbusTcpDevice, tables, "daemon.toml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_the_simulated_map_holds_every_quantity_one_after_another() -> None:
    places = SIMULATED_MAP.places
    assert list(places) == [quantity.name for quantity in QUANTITIES]
    address = 0
    for quantity in QUANTITIES:
        assert (places[quantity.name].address, places[quantity.name].type) == (address, quantity.type)
        address = places[quantity.name].end
    assert not set(SIMULATED_MAP.sampled) & WRITABLE


@pytest.mark.parametrize(
    ("place", "raw", "value"),
    [
        (Place(address=0, type="int16", scale=1e-5), 1234, 0.01234),
        (Place(address=0, type="uint16", scale=10.0, offset=-500.0), 60, 100.0),
        (Place(address=0), 0.25, 0.25),
    ],
)
def test_value_is_scale_times_raw_plus_offset(place: Place, raw: float, value: float) -> None:
    assert place.value(raw) == pytest.approx(value)
    assert place.raw(value) == raw


def test_raw_numbers_are_rounded_to_nearest_and_finite() -> None:
    assert Place(address=0, type="int16", scale=0.1).raw(0.26) == 3
    with pytest.raises(ValueError, match="finite"):
        Place(address=0).raw(float("nan"))


FLOAT = {"address": 0}
BARE: dict[str, Any] = {"position_m": FLOAT, "command_pa": {"address": 4}}
WITH_STATUS = BARE | {"status": {"address": 8, "type": "uint16"}}
WITH_ACTION = BARE | {"communication_action": {"address": 8, "type": "uint16"}}


@pytest.mark.parametrize(
    ("registers", "said"),
    [
        ({"position_m": FLOAT}, "map.command_pa: is required"),
        ({"position_m": FLOAT, "command_pa": {"address": 1}}, "position_m and command_pa share register 1"),
        ({"position_m": {"address": 65535}, "command_pa": {"address": 4}}, "past register 65535"),
        ({"position_m": FLOAT, "command_pa": {"address": 4, "table": "input"}}, "command_pa is written"),
        (WITH_STATUS | {"status_bits": {}}, "status_bits: names no bit"),
        ({**BARE, "status_bits": {"ready": 1}}, "status_bits goes with status, which the device has not"),
        (
            {**BARE, "communication_action_codes": {"hold": 1}},
            "codes goes with communication_action",
        ),
        (WITH_ACTION | {"communication_action_codes": {"hold": 1, "vent": 1}}, "need a number each"),
        (
            WITH_ACTION | {"communication_action_codes": {"vent": 1}},
            "hold has no number in map",
        ),
        ({"position_m": {"address": 0, "scale": 0}, "command_pa": {"address": 4}}, "scale must not be 0"),
    ],
)
def test_a_map_that_cannot_work_is_refused(registers: dict[str, Any], said: str) -> None:
    assert said in refusal({"map": registers})


def test_a_timeout_that_the_registers_would_round_to_never_is_refused() -> None:
    registers = {
        "position_m": FLOAT,
        "command_pa": {"address": 2},
        "communication_timeout_s": {"address": 4, "type": "uint16"},
    }
    assert "0.4 s becomes 0 s" in refusal({"map": registers, "communication_timeout_s": 0.4})
    assert ModbusTcpDevice.model_validate({"map": registers, "communication_timeout_s": 1.0})


def test_a_host_that_is_none_is_refused() -> None:
    assert "host" in refusal({"host": "not a host"})


def test_a_map_without_the_rest_is_enough() -> None:
    small = ModbusMap(position_m=Place(address=10, table="input"), command_pa=Place(address=10))
    assert list(small.sampled) == ["position_m"]


def test_a_command_is_what_its_register_can_say() -> None:
    whole_mbar = {"address": 2, "type": "uint16", "scale": 100.0, "offset": -20.0}
    device = ModbusTcpDevice.model_validate({"map": {"position_m": FLOAT, "command_pa": whole_mbar}})
    assert (device.delivered_pa(43_219.0), device.command_step_pa) == (43_180.0, 100.0)
    assert device.delivered_pa(device.delivered_pa(43_219.0)) == 43_180.0
    any_pressure = ModbusTcpDevice()
    assert (any_pressure.delivered_pa(43_219.5), any_pressure.command_step_pa) == (43_219.5, 0.0)


def test_a_time_out_within_a_cycle_is_refused_and_a_stall_is_known_by_the_shorter_of_two() -> None:
    def file(timeout_s: float) -> DaemonFile:
        device = {"bus": "modbus", "communication_timeout_s": timeout_s, "reply_timeout_s": 0.05}
        return DaemonFile.model_validate({"valve": {"stroke_m": 0.1}, "device": device, "cycle": {"period_s": 0.02}})

    assert file(0.12).longest_unattended_s == 0.12
    assert file(1.0).longest_unattended_s == file(0.0).longest_unattended_s == pytest.approx(0.15)
    with pytest.raises(ValidationError, match=r"communication_timeout_s must be more than cycle.period_s \(0.02 s\)"):
        file(0.02)


@pytest.mark.parametrize(
    ("more", "runs", "without"),
    [
        ({"pressure_pa": {"address": 2}}, [["position_m", "pressure_pa"]], [["position_m", "pressure_pa"]]),
        ({"pressure_pa": {"address": 6}}, [["position_m", "pressure_pa"]], [["position_m"], ["pressure_pa"]]),
        ({"pressure_pa": {"address": 123}}, [["position_m", "pressure_pa"]], [["position_m"], ["pressure_pa"]]),
        ({"pressure_pa": {"address": 124}}, [["position_m"], ["pressure_pa"]], [["position_m"], ["pressure_pa"]]),
        (
            {"pressure_pa": {"address": 0, "table": "input"}},
            [["position_m"], ["pressure_pa"]],
            [["position_m"], ["pressure_pa"]],
        ),
    ],
)
def test_a_sample_is_read_in_as_few_runs_as_there_can_be(
    more: dict[str, Any], runs: list[list[str]], without: list[list[str]]
) -> None:
    registers = ModbusMap.model_validate(BARE | {"command_pa": {"address": 200}} | more)
    assert [list(each) for each in registers.runs] == runs
    assert [list(part) for each in registers.runs for part in without_holes(each)] == without


@pytest.mark.parametrize(
    ("raw", "status"),
    [
        (0b0001, DeviceStatus(0)),
        (0b0000, DeviceStatus.NOT_READY),
        (0b0101, DeviceStatus.SENSOR_FAULT),
        (0b1001, DeviceStatus.SENSOR_FAULT),
        (0b10001, DeviceStatus.NOT_READY),
        (0b100101, DeviceStatus.SENSOR_FAULT | DeviceStatus.COMMUNICATION_LOST),
    ],
)
def test_a_status_of_other_bits_and_an_inverted_one(raw: int, status: DeviceStatus) -> None:
    bits = StatusBits(ready=0b1, sensor_fault=0b1100, not_ready=0b10000, communication_lost=0b100000)
    assert bits.status(raw) == status
