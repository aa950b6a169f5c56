"""Forces under a position that a rig imposes, and static curves: what is read, and how a row of it is made ready.

    time_s, pressure_pa, position_m, load_n      a bench that moves the stem and measures the force on it, no command
    branch, pressure_pa, position_m              readings of a static curve, branch `rising` or `falling`; no time

Signs are the recording's: the position and the load positive in the opening direction. Where friction comes out
negative, the position was counted the other way: it is turned, and told.

    v    from local parabolas over nine samples
    d    direction of motion, +1 opening, -1 closing (`signals.moves.legs`); it stays while the stem rests

Rows before the first motion, and readings within 5 % of the curve's ends, where a seat or a stop begins to carry, are
left out. A stroke is what lies between two reversals; errors hang together within it.
"""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.arguments import kinds_held
from config.errors import InputError
from config.recording import Column, Recording, lines_of, read_table
from config.results.result import Brief
from config.valve_file import ValveParameters
from signals.moves import legs
from signals.noise import position_noise_m
from workbench.data.motion import PARABOLA_ROWS, acceleration_m_per_s2
from workbench.data.record import UNITS_PA, UNSEEN

FORCES = ("time_s", "pressure_pa", "position_m", "load_n")
CURVE = ("branch", "pressure_pa", "position_m")
BRANCHES = {"rising": 1.0, "falling": -1.0}
TURNED = 6.0
"""Standard deviations of what is smoothed by which a stroke turns back;"""
SMOOTHED = (59.0 / 231.0) ** 0.5
"""of noise of 1, after smoothing by parabolas over nine samples."""
NEAR_ENDS = 0.05  # of the travel
BALANCE_ROWS = 12
"""Rows that a balance needs."""


@dataclass(frozen=True, slots=True, repr=False)
class Rows(Brief):
    """n rows of the balance; `load_n` is None where no force is measured, time and velocity in a static curve."""

    position_m: Column
    pressure_pa: Column
    direction: Column
    load_n: Column | None
    time_s: Column | None
    velocity_m_per_s: Column | None
    stroke: NDArray[np.int64]
    """Number of the stroke, or of the reading."""
    recording: NDArray[np.int64]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return self.position_m.size

    def turned(self) -> "Rows":
        """Return the same n rows with the position counted the other way."""
        velocity = None if self.velocity_m_per_s is None else -self.velocity_m_per_s
        return replace(
            self,
            position_m=-self.position_m,
            direction=-self.direction,
            velocity_m_per_s=velocity,
            notes=(*self.notes, "position_m counts against load_n, so that friction would drive the stem: turned"),
        )


def is_imposed(path: Path) -> bool:
    """Whether a file is a bench's: its header names no command, but a load or a branch.

    A file that cannot be read is not: whoever reads it says why.
    """
    if path.suffix == ".parquet":
        try:
            return "command_pa" not in read_table(path, FORCES)[0]
        except InputError:
            return False
    try:
        with path.open(encoding="utf-8") as file:
            header = next((line for line in lines_of(path, file) if not line.startswith("#")), "")
    except (OSError, UnicodeDecodeError, InputError):
        return False
    names = {name.strip() for name in header.split(",")}
    return "command_pa" not in names and bool(names & {"load_n", "branch"})


@kinds_held
def read_imposed(path: Path | str) -> Recording:
    """Read a bench's recording, or a static curve, whose `branch` becomes +1 rising and -1 falling.

    Raises:
        InputError: names file, column or line, value and what is allowed.
    """
    path = Path(path)
    if path.suffix == ".parquet":
        return Recording(*read_table(path, FORCES))
    try:
        with path.open(newline="", encoding="utf-8") as file:
            lines = [line for line in lines_of(path, file) if not line.startswith("#")]
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(str(path), "is not a CSV file: it is not UTF-8 text") from None
    names = [name.strip() for name in (lines[0] if lines else "").split(",")]
    if "branch" not in names:
        return Recording(*read_table(path, FORCES))
    for name in CURVE:
        if name not in names:
            raise InputError(str(path), f"column {name} is missing; the header names: {', '.join(names)}")
    rows = list(csv.DictReader(lines, fieldnames=names))[1:]
    return Recording({name: np.array([_cell(path, row, name, i) for i, row in enumerate(rows, 1)]) for name in CURVE})


def _cell(path: Path, row: dict[str, str | None], name: str, number: int) -> float:
    text = (row[name] or "").strip()
    if name == "branch":
        if text not in BRANCHES:
            raise InputError(str(path), f"reading {number}: branch {text!r}; allowed: {', '.join(BRANCHES)}")
        return BRANCHES[text]
    try:
        return float(text)
    except ValueError:
        raise InputError(str(path), f"reading {number}: {name} {text!r} is not a number") from None


def rows_of(recordings: list[Recording], valve: ValveParameters) -> Rows:
    """Return the rows of bench recordings, or of static curves, one after another.

    Raises:
        InputError: a column is missing, other units than SI, or too few rows, or rows of one direction only.
    """
    if not recordings:
        raise InputError("recording", "none is given")
    parts = [_curve(each) if "branch" in each.columns else _from_first_motion(each, valve) for each in recordings]
    if len({part.load_n is None for part in parts}) > 1:
        raise InputError("recording", "bench recordings and static curves cannot be balanced together")
    rows = parts[0] if len(parts) == 1 else _join(parts)
    if len(rows) < BALANCE_ROWS:
        raise InputError("recording", f"{len(rows)} rows with a known direction, at least {BALANCE_ROWS} are needed")
    if np.unique(rows.direction).size < 2:
        way = "opens" if rows.direction[0] > 0 else "closes"
        problem = f"the stem only {way}: friction and spring cannot be told apart without both ways"
        raise InputError("recording", problem)
    _require_units(rows, valve)
    return rows


def _require_units(rows: Rows, valve: ValveParameters) -> None:
    reached = float(np.ptp(rows.position_m))
    if reached > 20.0 * valve.stroke_m:
        raise InputError(
            "recording",
            f"position_m spans {reached:.4g} where the stroke is {valve.stroke_m:g} m: it looks like per cent (%) or "
            "mm; give it in m",
        )
    force_n = valve.spring_n_per_m * reached if rows.load_n is None else float(np.max(np.abs(rows.load_n)))
    needed_pa = force_n / valve.diaphragm_area_m2
    reached_pa = float(np.max(np.abs(rows.pressure_pa)))
    if not 0.0 < reached_pa < 0.03 * needed_pa:
        return
    unit = min(UNITS_PA, key=lambda each: abs(np.log(reached_pa * UNITS_PA[each] / needed_pa)))
    if 0.2 < reached_pa * UNITS_PA[unit] / needed_pa < 5.0:
        raise InputError(
            "recording",
            f"pressure_pa reaches {reached_pa:.4g} where the forces take some {needed_pa:.3g} Pa: it looks like "
            f"{unit}; give it in Pa",
        )


def _curve(recording: Recording) -> Rows:
    columns = recording.columns
    _require_columns(recording, CURVE)
    position_m = columns["position_m"]
    span_m = float(np.ptp(position_m)) if position_m.size else 0.0
    inside = (position_m > position_m.min(initial=0.0) + NEAR_ENDS * span_m) & (
        position_m < position_m.max(initial=0.0) - NEAR_ENDS * span_m
    )
    count = int(inside.sum())
    left_out = int((~inside).sum())
    note = f"{left_out} readings within {100 * NEAR_ENDS:.0f} % of the travel's ends are left out"
    kept = {name: columns[name][inside] for name in CURVE}
    return Rows(
        kept["position_m"],
        kept["pressure_pa"],
        kept["branch"],
        None,
        None,
        None,
        np.arange(count),
        np.zeros(count, np.int64),
        (note,) if left_out else (),
    )


def _from_first_motion(recording: Recording, valve: ValveParameters) -> Rows:
    """Return the rows from the first motion on."""
    from scipy.signal import savgol_filter  # takes as long to load as all else together

    _require_columns(recording, FORCES)
    finite = np.all([np.isfinite(recording.columns[name]) for name in FORCES], axis=0)
    time_s, pressure_pa, position_m, load_n = (recording.columns[name][finite] for name in FORCES)
    notes = [] if finite.all() else [f"{int((~finite).sum())} samples hold what is not a number: left out"]
    if time_s.size < max(BALANCE_ROWS, PARABOLA_ROWS):
        raise InputError("recording", f"{time_s.size} samples, at least {max(BALANCE_ROWS, PARABOLA_ROWS)} are needed")
    if not np.all(np.diff(time_s) > 0.0):
        raise InputError("recording", "time_s must increase strictly")
    # A rig that never rests shows no noise: then what it sweeps says what motion is.
    noise_m = position_noise_m(position_m) or UNSEEN * float(np.ptp(position_m))
    smooth_m = savgol_filter(position_m, PARABOLA_ROWS, 2)
    velocity = np.gradient(smooth_m, time_s)
    period_s = float(np.median(np.diff(time_s)))
    inertia_n = valve.mass_kg * acceleration_m_per_s2(position_m, period_s)
    strokes = legs(smooth_m, TURNED * SMOOTHED * noise_m)
    if not strokes or np.ptp(position_m) <= 1e-6 * valve.stroke_m:
        raise InputError("recording", "the stem does not move: there is no friction to balance")
    first, begins = strokes[0][0] + 1, [begin for begin, _, _ in strokes[1:]]
    stroke = np.searchsorted(begins, np.arange(first, position_m.size))
    return Rows(
        smooth_m[first:],
        pressure_pa[first:],
        np.array([way for _, _, way in strokes], dtype=np.float64)[stroke],
        (load_n - inertia_n)[first:],
        time_s[first:] - time_s[first],
        velocity[first:],
        stroke,
        np.zeros(stroke.size, np.int64),
        tuple(notes),
    )


def _require_columns(recording: Recording, names: tuple[str, ...]) -> None:
    for name in names:
        if name not in recording.columns:
            there = ", ".join(recording.columns)
            raise InputError("recording", f"column {name} is missing; a balance of forces needs it; there are: {there}")


def _join(parts: list[Rows]) -> Rows:
    def all_of(name: str) -> Column | None:
        columns = [getattr(part, name) for part in parts]
        return None if columns[0] is None else np.concatenate(columns)

    strokes, begun = [], 0
    for part in parts:
        strokes.append(part.stroke + begun)
        begun += int(part.stroke.max(initial=-1)) + 1
    return Rows(
        np.concatenate([part.position_m for part in parts]),
        np.concatenate([part.pressure_pa for part in parts]),
        np.concatenate([part.direction for part in parts]),
        all_of("load_n"),
        all_of("time_s"),
        all_of("velocity_m_per_s"),
        np.concatenate(strokes),
        np.concatenate([np.full(len(part), i) for i, part in enumerate(parts)]),
        tuple(dict.fromkeys(note for part in parts for note in part.notes)),
    )
