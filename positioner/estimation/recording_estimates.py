"""What a recording says of a, b, c, k and their ratios, by the daemon's own estimators: `positioner estimate`.

Where a pressure was measured in most rows it is used; else the command, a row's being in force until the next row.
"""

from dataclasses import dataclass

import numpy as np

from config.errors import InputError
from config.recording import Recording
from positioner.estimation.array import Array
from positioner.estimation.batch import BatchResult, BatchSettings, identify
from positioner.estimation.estimates import Estimates

MEASURED = 0.5
"""Share of the rows with a pressure from which on it counts as measured."""


@dataclass(frozen=True, slots=True)
class RecordingEstimates:
    """The estimates of a recording of `samples` rows, and how they came about."""

    found: BatchResult
    samples: int

    @property
    def estimates(self) -> Estimates:
        """a, b, c, k, b/c, k/c and the break-away pressure, each with its standard deviation or why it is refused."""
        return self.found.estimates


def estimate(
    recording: Recording, *, noise_std_m: float | None = None, pressure_held: bool | None = None
) -> RecordingEstimates:
    """Identify a valve from a recording.

    Args:
        recording: `time_s`, `position_m` and `pressure_pa`, or else `command_pa`; (n,) each, SI units.
        noise_std_m: standard deviation of the position's noise, m; by default measured.
        pressure_held: whether the pressure is held between samples or goes straight; by default the likelier, a command
            held.

    Raises:
        InputError: a noise that is not positive.
    """
    if noise_std_m is not None and not noise_std_m > 0:
        raise InputError("noise_std_m", f"must be positive, it is {noise_std_m:g}")
    pressure_pa, settings = _pressure(recording, noise_std_m, pressure_held)
    found = identify(recording.time_s, recording.position_m, pressure_pa, settings)
    return RecordingEstimates(found, len(recording))


def _pressure(
    recording: Recording, noise_std_m: float | None, pressure_held: bool | None
) -> tuple[Array, BatchSettings]:
    """Return the measured pressure, or else the command, as of the interval before each row."""
    measured = recording.columns.get("pressure_pa")
    if measured is not None and np.isfinite(measured).mean() > MEASURED:
        return measured, BatchSettings(noise_std_m=noise_std_m, pressure_held=pressure_held)
    command = recording.command_pa
    ahead = np.append(command[:1], command[:-1])
    held = True if pressure_held is None else pressure_held
    return ahead, BatchSettings(noise_std_m=noise_std_m, pressure_held=held)
