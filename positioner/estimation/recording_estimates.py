"""What a recording says of a, b, c, k and their ratios, by the daemon's own estimators: `positioner estimate`.

Where a pressure was measured in most rows it is used; else the command, a row's being in force until the next row.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Recording
from config.recording_oddities import odd_sizes
from config.registers import ESTIMATED
from config.results.block import Block, Table
from config.results.result import Result
from positioner.estimation.array import Array
from positioner.estimation.batch import BatchResult, BatchSettings, identify
from positioner.estimation.estimates import Estimate, Estimates, refusals_said
from positioner.estimation.landings.recording_landings import recording_landings
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.static_law import StaticLaw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEVIATIONS = 2.0
"""Standard deviations drawn on either side of an estimate."""
MEASURED = 0.5
"""Share of the rows with a pressure from which on it counts as measured."""


@dataclass(frozen=True, slots=True, repr=False)
class RecordingEstimates(Result):
    """The estimates of a recording of `samples` rows, and how they came about."""

    found: BatchResult
    samples: int
    statics: StaticIdentification
    notes: tuple[str, ...] = ()
    """What was left out of the recording."""

    @property
    def estimates(self) -> Estimates:
        """a, b, c, k, b/c, k/c and the break-away pressure, each with its standard deviation or why it is refused.

        They are tested on the landings: friction that lands elsewhere than the stem did is refused.
        """
        return self.statics.tested(self.found.estimates)

    @property
    def static_law(self) -> StaticLaw:
        """k_s/A, and friction with preload up and down, from where slides ended in rest."""
        return self.statics.law

    @property
    def law_ready(self) -> bool:
        """Whether the numbers of a control law are valid, from motion or from landings."""
        return self.estimates.law_ready or self.static_law.valid

    @property
    def by_name(self) -> Mapping[str, tuple[Estimate, str]]:
        """Each estimate with its unit: of motion, the break-away pressure F_s / A, and of landings."""
        named = {name: (getattr(self.estimates, name), unit) for name, unit in ESTIMATED.items()}
        law = self.static_law
        return named | {
            "F_s/A": (self.estimates.breakaway, "Pa"),
            "slope": (law.slope, "Pa/m"),
            "up": (law.up, "Pa"),
            "down": (law.down, "Pa"),
            "offset": (law.offset, "Pa"),
        }

    def blocks(self) -> list[Block]:
        """Say what was fitted, and each estimate or why it is refused."""
        found = self.found
        noise = "unknown" if found.noise_std_m is None else f"{found.noise_std_m:.3g} m"
        stamps = "; time stamps jitter: samples taken as even" if found.evened else ""
        rows = [
            (name, f"{each.value:.6g}", f"{each.std:.3g}", unit)
            for name, (each, unit) in self.by_name.items()
            if each.valid
        ]
        quality = (
            []
            if found.fit is None
            else [f"residuals {found.fit.residual_std_m:.3g} m; condition of the information {found.condition:.3g}"]
        )
        return [
            f"{self.samples} samples, {found.segments} motions fitted, {found.left_out} left out",
            f"noise {noise}; pressure taken as {found.pressure} between samples{stamps}",
            *([Table(("", "value", "std", "unit"), rows)] if rows else []),
            *refusals_said({name: each.reason for name, (each, _) in self.by_name.items()}),
            *quality,
            f"{self.static_law.landings} landings"
            + (f"; they lie {self.static_law.residual_m:.3g} m off the static law" if self.static_law.valid else ""),
            *(f"recording: {note}" for note in self.notes),
        ]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row an estimate: name, unit, value, standard deviation, valid or why not."""
        named = [(name, unit, each) for name, (each, unit) in self.by_name.items()]
        return {
            "name": [name for name, _, _ in named],
            "unit": [unit for _, unit, _ in named],
            "value": [each.value for _, _, each in named],
            "std": [each.std for _, _, each in named],
            "valid": [each.valid for _, _, each in named],
            "reason": ["" if each.valid else each.reason.text for _, _, each in named],
        }

    def plot(self) -> "Figure":
        """Draw how well each is known: one and a half per cent is an interval from 98.5 to 101.5."""
        from config.results.drawing import BETTER, FAINT, Interval, intervals

        known = {name: each for name, (each, _) in self.by_name.items() if np.isfinite(each.std / each.value)}
        shown = [
            Interval(
                name if each.valid else f"{name}, refused",
                100.0,
                100.0 * (1.0 - DEVIATIONS * abs(each.std / each.value)),
                100.0 * (1.0 + DEVIATIONS * abs(each.std / each.value)),
                BETTER if each.valid else FAINT,
            )
            for name, each in known.items()
        ]
        return intervals(shown, "two standard deviations about the estimate, %")[0]


@kinds_held
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
    notes = tuple(_notes(recording, pressure_pa))
    return RecordingEstimates(found, len(recording), recording_landings(recording), notes)


def _notes(recording: Recording, pressure_pa: Array) -> Iterator[str]:
    """Yield what is not as it should be in a recording, and what is left out of it."""
    yield from odd_sizes(recording)
    for key, said in recording.metadata.items():
        if key == "torn" or key.startswith("not "):
            yield f"{key}: {said}"
    missing = ~(np.isfinite(recording.position_m) & np.isfinite(pressure_pa))
    if missing.any():
        count, first = int(missing.sum()), int(missing.argmax()) + 1
        which = f"sample {first}" if count == 1 else f"{count} samples, the first {first}"
        yield f"position or pressure is missing in {which}: left out"


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
