"""What is odd about a recording is said, and nothing is said about a sound one."""

import numpy as np
import pytest

from config.drive import KINDS
from config.recording import KIND, Column, Recording
from config.recording_oddities import oddities

T = np.arange(0.0, 60.0, 0.05)
RNG = np.random.default_rng(1)
COMMAND = np.repeat(RNG.uniform(3e4, 9e4, 30), 40)


def answered(command_pa: Column, share: float = 0.15, late: int = 1) -> Column:
    """Return the position, m, of a stem that goes a share of its way each sample, from `late` samples on."""
    wanted = 0.04 * (command_pa - 2e4) / 8e4
    found = np.empty_like(wanted)
    found[0] = wanted[0]
    for i in range(1, wanted.size):
        found[i] = found[i - 1] + share * (wanted[max(i - late, 0)] - found[i - 1])
    return found + RNG.normal(0.0, 2e-6, wanted.size)


def recording(**columns: Column) -> Recording:
    return Recording({"time_s": T, "command_pa": COMMAND, "position_m": answered(COMMAND)} | columns)


def test_a_sound_recording_is_left_alone() -> None:
    assert oddities(recording(), 0.04) == []


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"position_m": 1e3 * answered(COMMAND)}, "positions go to 3.*: are they in mm, or in %"),
        (
            {"position_m": COMMAND, "command_pa": answered(COMMAND)},
            "positions go to .* m and commands to 0.0.* Pa: do their columns stand in each other's place",
        ),
        ({"position_m": 2.0 * answered(COMMAND)}, "of a stroke of 40 mm"),
        ({"position_m": 0.01 * answered(COMMAND)}, "positions never pass .* are they shares of 1"),
        ({"position_m": 0.04 - answered(COMMAND)}, "the position falls as the pressure rises: air closes this valve"),
        ({"position_m": np.full(T.size, 0.01)}, "the position is 0.01 m throughout"),
        ({"command_pa": np.full(T.size, 5e4)}, "the command is 50000 Pa throughout"),
        ({"command_pa": 1e-5 * COMMAND}, "are they in bar, kPa or %"),
        ({"command_pa": 100.0 * COMMAND}, "commands go to .* bar: is the unit right"),
        ({"position_m": answered(COMMAND, late=0)}, "the rows are snapshots"),
        ({"position_m": answered(COMMAND, share=0.999)}, "most moves are over within two samples, 0.05 s apart"),
        ({"position_m": np.interp(T, T[::13], answered(COMMAND)[::13])}, "lie on straight lines"),
        ({"position_m": np.where(RNG.random(T.size) < 0.3, np.nan, answered(COMMAND))}, "% of position_m is missing"),
        ({"time_s": T + 3600.0 * (T > 30.0)}, "the longest gap is 3600 s, .* a clock change in spring"),
    ],
)
def test_it_is_said(columns: dict[str, Column], said: str) -> None:
    import re

    found = oddities(recording(**columns), 0.04)
    assert any(re.search(said, each) for each in found), found


def test_a_command_that_is_kept_with_its_changes_alone_did_not_change_between_samples() -> None:
    """Of the rows with a command alone every one shows a stem that has moved meanwhile."""
    kept = np.where(np.diff(COMMAND, prepend=0.0) != 0.0, COMMAND, np.nan)
    position_m = answered(COMMAND)
    assert oddities(recording(command_pa=kept, position_m=position_m), 0.04) == ["98 % of command_pa is missing"]


SETPOINT = 0.04 * np.repeat(RNG.uniform(0.1, 0.9, 30), 40)
TRAVEL = answered(2e4 + 2e6 * SETPOINT)


def behind_a_positioner(**columns: Column) -> Recording:
    return Recording({"time_s": T, "reference_m": SETPOINT, "position_m": TRAVEL} | columns)


def test_a_sound_record_of_set_point_and_travel_is_left_alone() -> None:
    assert oddities(behind_a_positioner(), 0.04) == []


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"reference_m": np.full(T.size, 0.02)}, "the set point is 0.02 m throughout"),
        ({"position_m": 0.04 - TRAVEL}, "the position falls as the set point rises"),
        ({"position_m": SETPOINT}, "set point and position are equal to the last digit"),
        (
            {"position_m": SETPOINT, "reference_m": TRAVEL},
            "the set point changes in 100 % of the rows, .* are the two columns swapped",
        ),
        ({"position_m": 0.01 * TRAVEL}, "are both in the same unit, a share of 1, % or mm"),
        ({"position_m": np.interp(T, T[::13], TRAVEL[::13])}, "lie on straight lines"),
        ({"position_m": np.roll(TRAVEL, -6)}, "changes of the set point the stem had gone most of its way before"),
        ({"position_m": np.repeat(TRAVEL[::5], 5)}, "the position changes only every 5 rows: it is read every 0.25 s"),
    ],
)
def test_what_is_odd_of_set_point_and_travel_is_said(columns: dict[str, Column], said: str) -> None:
    import re

    found = oddities(behind_a_positioner(**columns))
    assert any(re.search(said, each) for each in found), found


def test_the_stem_before_its_command_is_said_too() -> None:
    found = oddities(recording(position_m=np.roll(answered(COMMAND), -6)), 0.04)
    assert any("changes of the command the stem had gone most of its way before" in each for each in found), found


def test_a_register_read_without_its_sign_is_said() -> None:
    counts = np.round(3e4 * np.sin(T / 3.0))
    found = oddities(recording(position_m=1e-6 * np.where(counts < 0, counts + 65536, counts)))
    assert any("a register of 16 bits read without its sign" in each for each in found), found
    assert not any("register" in each for each in oddities(recording(position_m=1e-6 * counts)))


def test_a_drive_that_is_never_driven_is_said() -> None:
    told = {KIND: next(each for each in KINDS if each != "valve")}
    still = Recording({"time_s": T, "command_pa": np.zeros(T.size), "position_m": TRAVEL}, told)
    assert any("throughout: nothing drives the stem" in each for each in oddities(still))


def test_a_coarse_sensor_of_a_stem_that_steps_as_it_is_asked_is_no_slow_reading() -> None:
    stepped = np.round(np.roll(SETPOINT, 1), 4)
    assert not any("it is read every" in each for each in oddities(behind_a_positioner(position_m=stepped)))
