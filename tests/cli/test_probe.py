"""What `probe` and `doctor` say of a reading that the daemon would not take."""

import re
from pathlib import Path

import pytest

from config.daemon_file import load_daemon
from drivers.boundary import Reading
from positioner.cli.probe import not_plausible
from positioner.control.settings import Settings

LIMITS = Settings.of(load_daemon(Path(__file__).parents[2] / "config" / "profiles" / "daemon.toml")).limits


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        (Reading(0.05), ""),
        (Reading(0.05, status=64), ""),
        (Reading(0.5), "the position is outside the travel"),
        (Reading(float("nan")), "the position is outside the travel"),
        (
            Reading(0.05, status=1),
            "the device says communication lost, which is a fault, by its status 1; .*status_bits",
        ),
        (Reading(0.05, status=66), "the device says sensor fault, which is a fault, by its status 66"),
    ],
)
def test_why_a_reading_is_not_plausible_is_said(reading: Reading, said: str) -> None:
    """`doctor` called a device ok whose status is a fault as soon as `run` sees it; `probe` printed its number."""
    assert re.fullmatch(f"{said}.*" if said else "", not_plausible(reading, LIMITS))
