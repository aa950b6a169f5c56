"""All figures of a recording: its steps, and what they show together.

Steps are looked for in `reference_m`; where that column is not there, never steps, or merely follows the stem (as the
daemon's does outside automatic), in `command_pa`. The recording is cut where its clock is set back and where the daemon
excites the valve (state 3), and rows without a position are left out; each is noted.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from config.arguments import kinds_held
from config.drive import Scale
from config.recording import Column, Recording
from config.recording_oddities import odd_sizes
from positioner.response.figure import Figure, no_value
from positioner.response.measured_dead_band import dead_band_and_resolution
from positioner.response.response_result import ResponseFigures
from positioner.response.step_detection import StepChange, find_steps
from positioner.response.step_figures import FIGURES, StepFigures, figures_of
from signals.noise import quantum_m

EXCITED = 3
"""The state column's number for S3."""


@dataclass(frozen=True, slots=True)
class _InputSegment:
    """Rows without a break of the clock, (n,) each, s, m and the unit of the input; positions and input finite."""

    time_s: Column
    position_m: Column
    input: Column


@kinds_held
def respond(recording: Recording) -> ResponseFigures:
    """Return the response figures of a recording; without steps it has none, and says so.

    Numbers that look like those of other units are noted, for without a valve file nobody knows the stroke.
    """
    notes = odd_sizes(recording)
    whole = _usable(recording, notes)
    for name in ("reference_m", "command_pa"):
        if name not in recording.columns:
            continue
        segments = list(_input_segments(recording, name, whole))
        found = [(segment, _steps(segment, follows=name == "reference_m")) for segment in segments]
        if any(steps for _, steps in found):
            return _response(name, found, notes, recording.kind.length)
        notes.append(f"{name} does not step from one held value to another")
    nothing = no_value("the recording holds no step")
    return ResponseFigures("none", (), None, nothing, nothing, nothing, tuple(notes))


def _usable(recording: Recording, notes: list[str]) -> NDArray[np.bool_]:
    """Return which rows are used, and note those that are not."""
    finite = np.isfinite(recording.position_m)
    if missing := int((~finite).sum()):
        notes.append(f"{missing} of {len(finite)} rows have no position and were left out")
    state = recording.columns.get("state")
    excited = np.zeros(len(finite), dtype=np.bool_) if state is None else state == EXCITED
    if excited.any():
        notes.append(f"{int(excited.sum())} rows of the daemon's own excitation (state S3) were left out")
    if backward := int((np.diff(recording.time_s) <= 0).sum()):
        notes.append(f"the clock was set back {backward} times; the recording is cut there")
    usable: NDArray[np.bool_] = finite & ~excited
    return usable


def _input_segments(recording: Recording, name: str, whole: NDArray[np.bool_]) -> Iterator[_InputSegment]:
    held = recording.columns[name]
    rows = np.flatnonzero(whole & np.isfinite(held))
    state = recording.columns.get("state", np.zeros(len(held)))
    excitations = np.cumsum(state == EXCITED)
    breaks = (np.diff(recording.time_s[rows]) <= 0) | (np.diff(excitations[rows]) > 0)
    for part in np.split(rows, np.flatnonzero(breaks) + 1):
        if part.size:
            yield _InputSegment(recording.time_s[part], recording.position_m[part], held[part])


def _steps(segment: _InputSegment, *, follows: bool) -> list[StepChange]:
    """Return the steps; a reference that is the very position when it changes only follows the stem."""
    steps = find_steps(segment.time_s, segment.input)
    same = segment.input == segment.position_m
    return [step for step in steps if not (follows and same[step.first])]


def _response(
    name: str, found: list[tuple[_InputSegment, list[StepChange]]], notes: list[str], read: Scale
) -> ResponseFigures:
    is_reference = name == "reference_m"
    rounding_m = quantum_m(np.concatenate([segment.position_m for segment, _ in found]))
    if rounding_m:
        notes.append(f"positions are whole multiples of {read.said(rounding_m)}")
    steps = tuple(
        figures_of(segment.time_s, segment.position_m, step, rounding_m, is_reference=is_reference)
        for segment, steps in found
        for step in steps
    )
    noises = [each.noise_m for each in steps if each.noise_m is not None]
    gain = _static_gain(steps)
    dead_band, resolution = (
        dead_band_and_resolution(steps, gain.value, "m" if is_reference else "Pa")
        if gain.value
        else (
            no_value("the stem did not respond to any step"),
            no_value("the stem did not respond to any step"),
        )
    )
    return ResponseFigures(name, steps, median(noises) if noises else None, gain, dead_band, resolution, tuple(notes))


def _static_gain(steps: tuple[StepFigures, ...]) -> Figure:
    """Return position over input between the outermost levels stepped to; of a single level, the step's own."""
    determined = [each for each in steps if each.level_m is not None and each.travel_m.value is not None]
    if not determined:
        return no_value("no step has enough samples")
    points = [(each.input_to, each.level_m or 0.0) for each in determined]
    low, high = min(points), max(points)
    if low[0] == high[0]:
        return determined[0].static_gain
    error = max(each.travel_m.plus_minus or 0.0 for each in determined)
    return Figure((high[1] - low[1]) / (high[0] - low[0]), error / (high[0] - low[0]))


def as_json(response: ResponseFigures) -> Mapping[str, object]:
    """Return everything as plain values, None for what cannot be determined."""
    steps = [asdict(each) for each in response.steps]
    summaries = {name: response.over_steps(name) for name in FIGURES}
    return {
        "input": response.input,
        "noise_m": response.noise_m,
        "steps": steps,
        "summary": {name: None if each is None else asdict(each) for name, each in summaries.items()},
        "static_gain": asdict(response.static_gain),
        "dead_band": asdict(response.dead_band),
        "resolution": asdict(response.resolution),
        "notes": list(response.notes),
    }
