"""What is odd about a recording is said, and nothing is said about a sound one."""

import numpy as np
import pytest

from config.exports.plausibility import oddities
from config.recording import Column, Recording

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
        ({"position_m": 0.04 - answered(COMMAND)}, "more pressure, less position: air closes this valve"),
        ({"position_m": np.full(T.size, 0.01)}, "the position is 0.01 m throughout"),
        ({"command_pa": np.full(T.size, 5e4)}, "the command is 50000 Pa throughout"),
        ({"command_pa": 1e-5 * COMMAND}, "are they in bar, kPa or %"),
        ({"command_pa": 100.0 * COMMAND}, "commands go to .* bar: is the unit right"),
        ({"position_m": answered(COMMAND, late=0)}, "the stem had moved by the row of the command's change: snapshots"),
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
