"""The device's own logic, judged by what it tells its valve: grid, commands, silence, changes."""

import math
from typing import Any

import pytest

from config.quantities import CommunicationAction, DeviceStatus
from config.slave_file import SlaveFile
from sim.slave.simulated_device import Device

FRICTION = {"coulomb_n": 1000.0, "static_n": 1200.0}


class Witness:
    """A valve that follows its command at once and keeps what it was told."""

    def __init__(self) -> None:
        self.pressure_pa = 0.0
        self.position_m = self.indicated_m = 0.0
        self.told: list[tuple[float, float]] = []
        self.changes: list[tuple[int, dict[str, float]]] = []

    def advance(self, command_pa: float, duration_s: float) -> None:
        self.told.append((command_pa, duration_s))
        self.pressure_pa = command_pa
        self.indicated_m = 1e-6 * command_pa

    def change(self, **parameters: float) -> None:
        self.changes.append((len(self.told), parameters))


def switched_on(**tables: Any) -> tuple[Device, Witness]:
    valve = Witness()
    return Device(valve, SlaveFile.model_validate(tables), FRICTION), valve


def test_a_tick_is_one_period_under_the_command() -> None:
    device, valve = switched_on(clock={"period_s": 2e-3})
    device.tick(30e3)
    device.tick(40e3)
    assert valve.told == [(30e3, 2e-3), (40e3, 2e-3)]
    assert (device.sample_counter, device.device_time_us) == (2, 4000)
    assert (device.position_m, device.pressure_pa, device.command_pa) == (0.04, 40e3, 40e3)


@pytest.mark.parametrize("command_pa", [math.nan, math.inf, -1.0, 420_001.0])
def test_a_command_that_cannot_be_delivered_changes_nothing(command_pa: float) -> None:
    device, valve = switched_on()
    device.tick(10e3)
    with pytest.raises(ValueError, match="not within 0 to 420000 Pa"):
        device.tick(command_pa)
    with pytest.raises(ValueError, match="not within"):
        device.command(command_pa)
    assert (len(valve.told), device.sample_counter, device.command_pa) == (1, 1, 10e3)


def test_the_maximum_is_allowed_as_a_float32_says_it() -> None:
    device, _ = switched_on(supply={"maximum_pa": 413_685.41})  # as float32 413 685.40625: below; 0.1: above
    device.command(413_685.40625)
    device, _ = switched_on(supply={"maximum_pa": 0.1})
    device.command(0.10000000149011612)


def test_the_counter_wraps_at_32_bits_and_the_clock_does_not() -> None:
    device, _ = switched_on(clock={"period_s": 1e-6})
    device.stall((1 << 32) - 1)
    device.tick(0.0)
    assert (device.sample_counter, device.device_time_us) == (0, 1 << 32)


@pytest.mark.parametrize(
    ("action", "then_pa"),
    [("hold", 50e3), ("vent", 0.0), ("fill", 420e3)],
)
def test_silence_for_the_timeout_makes_the_device_act(action: str, then_pa: float) -> None:
    device, valve = switched_on(communication={"timeout_s": 0.01, "action": action})
    device.advance(3)
    device.command(50e3)
    device.advance(9)
    assert device.status == 0
    device.advance(5)
    assert device.status == DeviceStatus.COMMUNICATION_LOST
    assert device.command_pa == then_pa
    obeyed = [(command_pa, round(duration_s / 1e-3)) for command_pa, duration_s in valve.told]
    assert obeyed == [(0.0, 3), (50e3, 9), (50e3, 1), (then_pa, 4)], "to the period"
    assert device.pressure_pa == then_pa


def test_the_next_command_ends_the_loss() -> None:
    device, _ = switched_on(communication={"timeout_s": 0.01, "action": "vent"})
    device.advance(100)
    device.command(20e3)
    assert device.status == 0
    device.advance(9)
    assert (device.status, device.command_pa) == (0, 20e3)
    device.advance(1)
    assert (device.status, device.command_pa) == (1, 0.0)


def test_without_a_timeout_silence_means_nothing() -> None:
    device, _ = switched_on(communication={"timeout_s": 0.0, "action": "vent"})
    device.command(20e3)
    device.advance(10_000_000)
    assert (device.status, device.command_pa) == (0, 20e3)


def test_lockstep_is_never_silent_however_short_the_timeout() -> None:
    device, _ = switched_on(communication={"timeout_s": 1e-4, "action": "vent"})
    for _ in range(5):
        device.tick(20e3)
    assert (device.status, device.command_pa) == (0, 20e3)


def test_setting_a_timeout_after_a_long_silence_moves_nothing() -> None:
    device, _ = switched_on()
    device.command(20e3)
    device.advance(1000)
    device.supervise(0.01, CommunicationAction.VENT)
    device.advance(9)
    assert (device.status, device.command_pa) == (0, 20e3)
    device.advance(1)
    assert (device.status, device.command_pa) == (1, 0.0)


@pytest.mark.parametrize("timeout_s", [math.nan, math.inf, -0.1])
def test_a_timeout_that_is_none_changes_nothing(timeout_s: float) -> None:
    device, _ = switched_on(communication={"timeout_s": 0.5, "action": "fill"})
    with pytest.raises(ValueError, match="time-out"):
        device.supervise(timeout_s, CommunicationAction.HOLD)
    assert (device.communication_timeout_s, device.communication_action) == (0.5, CommunicationAction.FILL)


def test_parameters_change_at_their_time_on_the_device_clock_in_one_stretch_or_many() -> None:
    change = [{"at_s": 0.0, "static_n": 2000.0}, {"at_s": 0.005, "over_s": 0.004, "coulomb_n": 1400.0}]
    ticked, witness_ticked = switched_on(change=change)
    for _ in range(20):
        ticked.tick(10e3)
    advanced, witness_advanced = switched_on(change=change)
    advanced.command(10e3)
    advanced.advance(20)

    def history(witness: Witness) -> dict[int, float]:
        """Coulomb friction by the period from which it holds."""
        period_of_call = [0]
        for _, duration_s in witness.told:
            period_of_call.append(period_of_call[-1] + round(duration_s / 1e-3))
        return {period_of_call[calls]: told["coulomb_n"] for calls, told in witness.changes}

    drift = {0: 1000.0, 5: 1000.0, 6: 1100.0, 7: 1200.0, 8: 1300.0, 9: 1400.0}
    assert history(witness_ticked) == pytest.approx(drift)
    assert history(witness_advanced) == pytest.approx(drift)
    assert all(told["static_n"] == 2000.0 for _, told in witness_ticked.changes)
