"""A simulated device that drops, freezes, jumps and restarts by its file, in lockstep: every sample is counted."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymodbus.constants import ExcCodes

from config.errors import InputError
from config.modbus_map import SIMULATED_MAP
from config.slave_file import load_slave
from fieldbus.modbus.function_codes import RegisterError
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.simulated_device import Device
from tests.slave.test_device import switched_on

PERIOD_S = 0.5


def faulty(**fault: Any) -> Device:
    device, _ = switched_on(clock={"period_s": PERIOD_S}, communication={"timeout_s": 9.0}, fault=[fault])
    return device


def over_ticks(device: Device, shown: Callable[[Device], Any], count: int = 6) -> list[Any]:
    """What is shown after each of the ticks, under commands of 1, 2, 3 kPa and so on."""
    seen = []
    for n in range(1, count + 1):
        device.tick(1e3 * n)
        seen.append(shown(device))
    return seen


def test_a_frozen_device_shows_an_old_sample_and_its_counter_stands_still() -> None:
    device = faulty(kind="freeze", at_s=1.0, over_s=1.0)
    shown = over_ticks(device, lambda each: (each.sample_counter, each.device_time_us, each.pressure_pa))
    assert [counter for counter, _, _ in shown] == [1, 1, 1, 4, 5, 6]
    assert [time_us for _, time_us, _ in shown] == [500_000] * 3 + [2_000_000, 2_500_000, 3_000_000]
    assert [pressure_pa for _, _, pressure_pa in shown] == [1e3, 1e3, 1e3, 4e3, 5e3, 6e3]


def test_a_jump_puts_the_position_off_and_back_and_nothing_else() -> None:
    device = faulty(kind="jump", at_s=1.0, over_s=1.0, by_m=0.01)
    shown = over_ticks(device, lambda each: (each.position_m, each.pressure_pa))
    off_m = [position_m - 1e-6 * pressure_pa for position_m, pressure_pa in shown]
    assert off_m == pytest.approx([0.0, 0.01, 0.01, 0.0, 0.0, 0.0], abs=1e-12)


def test_a_restart_begins_the_clock_and_the_settings_anew_but_not_the_valve() -> None:
    device = faulty(kind="restart", at_s=1.5)
    device.supervise(3.0, device.communication_action)
    shown = over_ticks(device, lambda each: (each.sample_counter, each.communication_timeout_s, each.command_pa))
    assert [counter for counter, _, _ in shown] == [1, 2, 0, 1, 2, 3]
    assert [timeout_s for _, timeout_s, _ in shown] == [3.0, 3.0, 9.0, 9.0, 9.0, 9.0]
    assert [command_pa for _, _, command_pa in shown] == [1e3, 2e3, 0.0, 4e3, 5e3, 6e3]
    assert device.pressure_pa == 6e3
    assert device.samples == 6


def test_a_device_that_drops_answers_nothing_obeys_nothing_and_comes_back() -> None:
    device = faulty(kind="drop", at_s=1.0, over_s=1.0)
    registers = DeviceRegisters(device, Lockstep(device))
    place = SIMULATED_MAP.places["command_pa"]
    answered: list[float | ExcCodes] = []
    for n in range(1, 7):
        words = place.format.encode(1e3 * n)
        try:
            registers.write(place.address, words, "test")
            registers.read("holding", place.address, place.format.words)
            answered.append(device.command_pa)
        except RegisterError as refusal:
            answered.append(refusal.code)
    assert answered == [1e3, ExcCodes.GATEWAY_NO_RESPONSE, ExcCodes.GATEWAY_NO_RESPONSE, 4e3, 5e3, 6e3]


def test_a_drift_grows_a_nan_is_no_number_and_a_fallen_supply_gives_no_more() -> None:
    shown = over_ticks(
        faulty(kind="drift", at_s=1.0, over_s=1.0, by_m=0.01), lambda each: each.position_m - 1e-6 * each.pressure_pa
    )
    assert shown == pytest.approx([0.0, 0.0, 0.005, 0.0, 0.0, 0.0], abs=1e-12)
    numbers = over_ticks(faulty(kind="nan", at_s=1.0, over_s=1.0), lambda each: math.isnan(each.position_m))
    assert numbers == [False, True, True, False, False, False]
    fallen = over_ticks(faulty(kind="supply", at_s=1.0, over_s=1.0, to_pa=1.5e3), lambda each: each.pressure_pa)
    assert fallen == [1e3, 2e3, 1.5e3, 1.5e3, 5e3, 6e3], "from the sample on at which it fell"


def test_several_faults_add_up_and_without_over_s_a_fault_stays() -> None:
    jumps = [{"kind": "jump", "at_s": 1.0, "by_m": 0.01}, {"kind": "jump", "at_s": 2.0, "by_m": 0.02}]
    device, _ = switched_on(clock={"period_s": PERIOD_S}, fault=jumps)
    off_m = over_ticks(device, lambda each: each.position_m - 1e-6 * each.pressure_pa)
    assert off_m == pytest.approx([0.0, 0.01, 0.01, 0.03, 0.03, 0.03])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[fault]]\nkind = 'jump'\nat_s = 1.0\n", "by_m, other than 0, belongs with kind 'jump' or 'drift'"),
        (
            "[[fault]]\nkind = 'freeze'\nat_s = 1.0\nby_m = 1.0\n",
            "belongs with kind 'jump' or 'drift' and with",
        ),
        ("[[fault]]\nkind = 'restart'\nat_s = 1.0\nover_s = 1.0\n", "a restart takes no time"),
        ("[[fault]]\nkind = 'melt'\nat_s = 1.0\n", "'drop', 'freeze', 'jump', 'drift', 'nan', 'supply' or 'restart'"),
        ("[bus]\nkind = 'canopen'\nnode = 5\n[[fault]]\nkind = 'drop'\nat_s = 1.0\n", "drop is for Modbus"),
    ],
)
def test_a_fault_that_cannot_be_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "slave.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said) as refusal:
        load_slave(tmp_path / "slave.toml")
    assert "\n" not in str(refusal.value)
