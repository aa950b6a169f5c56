"""A recording made ready for simulation: cut where it is broken, its bad samples marked, all of it told.

The clock set back, a gap, or rows that the daemon's recorder missed begin a new segment, simulated from rest on its
own. Samples that the daemon lost are a longer period: it wrote no command in the meantime. A position that is not a
number, or a spike, is left out of the error; a command that is not a number, or is none, as -9999 for a row, is the one
before, still in force. What begins in motion, at a velocity that its samples do not tell, or with a motion that no
command of it began, begins where the stem first rests, if that is in its first third. Nothing else is touched, and
`notes` has a sentence for each of these, samples counted from 1.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from config.drive import KINDS, VALVE, KindName
from config.errors import InputError
from config.recording import BEHIND_POSITIONER, REQUIRED, Column, Recording
from config.recording_oddities import in_each_others_place
from config.results.result import Brief
from config.valve_file import ValveParameters
from signals.moves import AT_ONCE, rests_first, slips
from signals.noise import frozen, held_back_m, quantum_m
from workbench.data.clock_difference import Doubt, early, unled
from workbench.data.noise_floor import UNKNOWN, noise_std_m, not_repeating_m, repeatability_m, said_noise_m
from workbench.data.pressure_lag import without_gaps_pa

TOLD = ("torn", "assumed")
"""What a recording's file says that belongs to every result: it was broken off, an end of a range is a guess."""
GAP_PERIOD_QUANTILES = 10.0
"""A gap is longer than this many times the 95 % quantile of the periods: unevenly logged data have none by that."""
UNEVEN = 0.05
"""Sampling is uneven if its periods spread by more than this part of their median."""
FEW_ROWS = 4
"""Samples of a segment worth simulating."""
LIKELY_SPIKE = 8.0
"""Times the least scatter that a spike stands off at least."""
UNSEEN = 1e-3
"""Of what the stem sweeps: where the noise is unknown, what differs by less counts as none."""
FINEST = 1e-5
"""Of what the stem sweeps: a free run is off by so much (`FINE`, 1 um), and nothing is judged more finely than that."""
LATEST_REST = 1.0 / 3.0
"""Of a segment that begins in motion: by then it must have come to rest, or is simulated from where it begins."""
MOST_WORK, SLIP_ROWS = 1_000_000, 20
"""Rows and slips that are fitted at most: a fit simulates them thousands of times, and a slip costs as many rows."""
ALLOWED = (
    f"allowed are {MOST_WORK} samples, a slip counting for {SLIP_ROWS}: cut out the stretch that matters, --from-s and "
    "--to-s"
)
STRETCH = "stretch"
"""The column that counts the stretches of a recording of which the rest was left out."""
WORD = 10.0
"""Times the other commands, from which on one of a single row is none."""
BELOW_ZERO = 0.05
"""Of the range of the commands: a pressure that is as far below zero for a single row is none."""
UNITS_PA = {"bar": 1e5, "psi": 6894.757, "kPa": 1e3, "mbar": 1e2}
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Record(Brief):
    """n samples ready for simulation; `segments` are half-open ranges of rows, the others are not simulated.

    It equals nothing but itself.
    """

    time_s: Column
    command_pa: Column
    """What was asked of it: a pressure, Pa; of a valve behind its positioner (`by_setpoint`) the set point, m."""
    position_m: Column
    pressure_pa: Column | None
    load_n: Column | None
    valid: Mask
    """Whether a sample's position counts in the error."""
    segments: tuple[tuple[int, int], ...]
    notes: tuple[str, ...]
    noise_m: float | None
    """Standard deviation of the sensor's noise, rounding included; None: unknown, and no verdict may rest on it."""
    repeatability_m: float | None
    """How well the valve repeats itself, None where the command does not."""
    by_setpoint: bool = False
    kind: KindName = "valve"
    """Whose it is."""
    commanded_from: tuple[int, ...] = ()
    """For each segment the row from which its command is known: what lies between was left out, being in motion."""
    pressure_known: Mask | None = None
    """Where the pressure was measured; elsewhere it is what the command makes of it (`pressure_lag`)."""
    early: Doubt | None = None
    """How much the stem moves before its command, or against it: no verdict may rest on it."""

    @property
    def measured_pa(self) -> Column | None:
        """The measured pressure, Pa, (n,), NaN where it was not measured; None: nowhere."""
        if self.pressure_pa is None or self.pressure_known is None:
            return self.pressure_pa
        return np.where(self.pressure_known, self.pressure_pa, np.nan)

    @property
    def floor_m(self) -> float | None:
        """The error that no model undercuts; None: unknown."""
        known = [each for each in (self.noise_m, self.repeatability_m) if each is not None]
        return max(known, default=None)

    @property
    def scale_m(self) -> float:
        """What tells motion from rest and residuals are weighed by: the noise; unknown, a part of what is swept."""
        if self.noise_m is not None:
            return self.noise_m
        return UNSEEN * float(np.ptp(self.position_m[self.valid]))

    @property
    def floor_or_scale_m(self) -> float:
        """The floor, or where it is unknown what stands for it; no verdict rests on that."""
        return self.scale_m if self.floor_m is None else self.floor_m

    @property
    def period_s(self) -> float:
        """Median period within the segments."""
        return float(np.median(np.concatenate([np.diff(self.time_s[a:b]) for a, b in self.segments])))

    def __len__(self) -> int:
        return len(self.time_s)


def ready(recording: Recording) -> Record:
    """Make a recording ready.

    Raises:
        InputError: a column is missing or of another length, the time is in disorder, no command or no position is a
            number, or no stretch is long enough.
    """
    columns = recording.columns
    _require_columns(columns)
    notes = [f"{key}: {value}" for key, value in recording.metadata.items() if key in TOLD or key.startswith("not ")]
    asked = "reference_m" if recording.by_setpoint else "command_pa"
    command_pa = _held(_without_words(columns[asked], asked, recording.kind is VALVE, notes), asked, notes)
    position_m = recording.position_m
    quantum, unit = quantum_m(position_m), recording.kind.travel.si
    valid = _valid(position_m, quantum, notes)
    segments = tuple(_segments(columns, notes))
    if not segments:
        raise InputError("recording", f"no stretch of at least {FEW_ROWS} samples without a gap or a step of the clock")
    time_s = columns["time_s"]
    seen_m = np.where(valid, position_m, np.nan)
    longest = slice(*max(segments, key=lambda each: each[1] - each[0]))
    repeated_m = repeatability_m(command_pa[longest], seen_m[longest]) if _is_even(time_s[longest]) else None
    finest_m = FINEST * float(np.ptp(position_m[valid]))
    noise_m = said_noise_m(recording)
    if noise_m is None:
        noise_m = not_repeating_m(noise_std_m(seen_m[longest], command_pa[longest]), repeated_m, quantum)
    if noise_m is not None and noise_m < finest_m:
        notes.append(
            f"position_m hardly has noise: it is judged to {finest_m:.2g} {unit}, as finely as a model is simulated; "
            "if something holds small changes back, a dead band or a historian's compression, say how much, --noise-m M"
        )
        noise_m = finest_m
    if quantum > finest_m:
        notes.append(f"position_m is rounded to {quantum:.3g} {unit}")
    if noise_m is None and held_back_m(position_m, quantum):
        notes.append(
            "position_m hardly ever changes by little, one or two of its roundings: if something holds small changes "
            "back, a dead band or a historian's compression, say how much, --noise-m M"
        )
    if noise_m is None and repeated_m is None:
        notes.append(UNKNOWN)
    _tell_sampling(time_s, segments, notes)
    record = Record(
        time_s,
        command_pa,
        position_m,
        _pressure_pa(columns, command_pa, segments, by_setpoint=recording.by_setpoint, notes=notes),
        _whole(columns.get("load_n"), "load_n", notes),
        valid,
        segments,
        (),
        noise_m,
        repeated_m,
        recording.by_setpoint,
        recording.kind.name,
    )
    at_rest = tuple(_from_rest(record, notes))
    before: Doubt | None = early(time_s, command_pa, seen_m, record.scale_m, segments)
    before = before or unled(command_pa, seen_m, record.scale_m, at_rest)
    if before:
        notes.append(before.sentence)
    begun, measured_pa = tuple(first for first, _ in segments), columns.get("pressure_pa")
    return replace(
        record,
        segments=at_rest,
        notes=tuple(map(recording.kind.text, notes)),
        commanded_from=begun,
        pressure_known=None if measured_pa is None else np.isfinite(measured_pa),
        early=before,
    )


def _from_rest(record: Record, notes: list[str]) -> Iterator[tuple[int, int]]:
    """Let the segments that begin in motion begin at rest, each where it was in their order."""
    for first, end in record.segments:
        position_m = np.where(record.valid, record.position_m, np.nan)[first:end]
        measured = record.pressure_pa is not None or record.load_n is not None
        rest = rests_first(position_m, record.scale_m, 0 if measured else _count_unchanged(record, first, end))
        if rest:
            # What creeps within the noise looks like rest: the later, the less is left of it.
            latest = rest + _count_unchanged(record, first + rest, end) - AT_ONCE
            rest = latest if rest < latest <= LATEST_REST * (end - first) else rest
        if rest is None or rest > LATEST_REST * (end - first) or end - first - rest < FEW_ROWS:
            yield first, end
            continue
        if rest:
            notes.append(
                f"the stem is in motion at sample {first + 1}, or about to move: simulated and judged from sample "
                f"{first + rest + 1} on, where it rests"
            )
        yield first + rest, end


def _count_unchanged(record: Record, first: int, end: int) -> int:
    """Return for how many samples the command stays what it is at the first."""
    changed = np.flatnonzero(record.command_pa[first:end] != record.command_pa[first])
    return int(changed[0]) if changed.size else end - first


def require_few_samples(recording: Recording) -> None:
    """Refuse, before anything is made ready, what would take hours to fit however little the stem moves.

    Raises:
        InputError: too many samples; says how many are allowed.
    """
    _require_columns(recording.columns)
    if len(recording) > MOST_WORK:
        raise InputError("recording", f"{len(recording)} samples would take hours to fit; {ALLOWED}")


def require_fittable(record: Record) -> None:
    """Refuse what would take hours to fit.

    Raises:
        InputError: too many samples and slips; says how many are allowed.
    """
    count = sum(
        len(slips(np.where(record.valid, record.position_m, np.nan)[first:end], record.scale_m))
        for first, end in record.segments
    )
    if len(record) + SLIP_ROWS * count > MOST_WORK:
        raise InputError("recording", f"{len(record)} samples with {count} slips would take hours to fit; {ALLOWED}")


def require_units(record: Record, valve: ValveParameters) -> None:
    """Recognise a position in per cent, mm or shares of the stroke, and a pressure in bar, psi, kPa or mbar.

    Raises:
        InputError: the numbers are those of another unit; says which and how to import it.
    """
    position_m = record.position_m[record.valid]
    reached = float(np.max(np.abs(position_m)))
    if record.kind != valve.kind:
        ours, theirs = (
            f"{kind.own('command_pa')} and {kind.own('position_m')}" for kind in (KINDS[record.kind], valve.own)
        )
        raise InputError("recording", f"has {ours}, and the valve file is of a {valve.kind}, which has {theirs}")
    if valve.kind != "valve":
        _require_drives_units(reached, valve)
        return
    if not record.by_setpoint and in_each_others_place(position_m, record.command_pa):
        raise InputError(
            "recording",
            f"position_m reaches {reached:.4g} where the stroke is {valve.stroke_m:g} m, and command_pa "
            f"{np.max(np.abs(record.command_pa)):.4g}: they stand in each other's place; change their names",
        )
    if reached > 20.0 * valve.stroke_m:
        is_mm = valve.stroke_m < 0.06 < reached < 1.5e3 * valve.stroke_m < 90
        unit, word = ("mm", "mm") if is_mm else ("per cent (%) or mm", "%, or NAME:mm")
        raise InputError(
            "recording",
            f"position_m reaches {reached:.4g} where the stroke is {valve.stroke_m:g} m: it looks like {unit}; "
            f"import it, --column position_m=NAME:{word}",
        )
    if reached > 3.0 * valve.stroke_m and 0.3 < reached < 1.5:
        raise InputError(
            "recording",
            f"position_m reaches {reached:.4g} where the stroke is {valve.stroke_m:g} m: it looks like a share of the "
            "stroke, 0 to 1; give it in m",
        )
    if not record.by_setpoint:
        _require_command_unit(record, valve, position_m)
        _require_pressure_unit(record)


def _require_drives_units(reached: float, valve: ValveParameters) -> None:
    name, travel, unit = valve.own.own("position_m"), valve.own.own("stroke_m"), "deg" if valve.own.turns else "mm"
    if reached > 20.0 * valve.stroke_m:
        raise InputError(
            "recording",
            f"{name} reaches {reached:.4g} where {travel} is {valve.stroke_m:g}: it looks like {unit}; import it, "
            f"--column {name}=NAME:{unit}",
        )


def _require_command_unit(record: Record, valve: ValveParameters, position_m: Column) -> None:
    needed_pa = (valve.spring_n_per_m * float(np.ptp(position_m)) + 2.0 * valve.coulomb_n) / valve.diaphragm_area_m2
    span_pa = float(np.ptp(record.command_pa))
    if span_pa == 0.0 or span_pa > 0.03 * needed_pa:
        return
    unit = min(UNITS_PA, key=lambda each: abs(np.log(span_pa * UNITS_PA[each] / needed_pa)))
    if 0.2 < span_pa * UNITS_PA[unit] / needed_pa < 5.0:
        raise InputError(
            "recording",
            f"command_pa spans {span_pa:.4g} where the motion takes some {needed_pa:.3g} Pa: it looks like "
            f"{'kPa or per cent (%)' if unit == 'kPa' else unit}; import it, --column command_pa=NAME:{unit}",
        )


def _require_pressure_unit(record: Record) -> None:
    """Hold the measured pressure against the command: both are the same quantity, but for a lag."""
    if record.pressure_pa is None:
        return
    shown = record.pressure_pa[record.pressure_known]
    command_pa, measured = float(np.max(np.abs(record.command_pa))), float(np.max(np.abs(shown)))
    for unit, factor in UNITS_PA.items():
        if 0.0 < measured < 0.03 * command_pa and 0.3 < measured * factor / command_pa < 3.0:
            raise InputError(
                "recording",
                f"pressure_pa reaches {measured:.4g} where command_pa reaches {command_pa:.4g} Pa: it looks like "
                f"{unit}; import it, --column pressure_pa=NAME:{unit}",
            )


def _require_columns(columns: Mapping[str, Column]) -> None:
    there = ", ".join(columns) or "none"
    by_setpoint = "reference_m" in columns and "command_pa" not in columns
    for name in BEHIND_POSITIONER if by_setpoint else REQUIRED:
        if name not in columns:
            imposed = "pressure_pa" in columns and "load_n" in columns
            hint = "; where a rig imposes the position: workbench.diagnose_forces" if imposed else ""
            raise InputError("recording", f"column {name} is missing; there are: {there}{hint}")
    count = len(columns["time_s"])
    if not count:
        raise InputError("recording", "holds no samples")


def _without_words(command: Column, name: str, of_valve: bool, notes: list[str]) -> Column:
    """Return the commands with NaN for those of a single row that stand for a word, as -9999 does for "bad".

    They are ten times as large as the others; or of a pressure below zero, where the others are above it. A pulse that
    was commanded for a row is neither.
    """
    known = command[np.isfinite(command)]
    if not known.size:
        return command
    low, high = np.quantile(known, [0.01, 0.99]).tolist()
    wide = high - low
    strange = np.abs(command) > WORD * max(abs(low), abs(high)) if wide else np.zeros(command.size, dtype=np.bool_)
    if of_valve and name == "command_pa" and low >= 0.0:
        strange |= command < -BELOW_ZERO * wide
    alone = strange & ~np.append(strange[1:], False) & ~np.append(False, strange[:-1])
    if not alone.any():
        return command
    first = float(command[int(alone.argmax())])
    notes.append(f"{name} is {first:g} in {_samples(alone)}, alone among others unlike it: no command")
    return np.where(alone, np.nan, command)


def _held(command_pa: Column, name: str, notes: list[str]) -> Column:
    finite = np.isfinite(command_pa)
    if not finite.any():
        raise InputError("recording", f"{name}: no sample is a number")
    if finite.all():
        return command_pa
    notes.append(f"{name} is not a number in {_samples(~finite)}: the command before is held")
    last = np.maximum.accumulate(np.where(finite, np.arange(finite.size), 0))
    last[: finite.argmax()] = finite.argmax()
    return command_pa[last]


def _valid(position_m: Column, quantum: float, notes: list[str]) -> Mask:
    finite = np.isfinite(position_m)
    if not finite.any():
        raise InputError("recording", "position_m: no sample is a number")
    if not finite.all():
        notes.append(f"position_m is not a number in {_samples(~finite)}: left out of the error")
    spikes = _spikes(position_m)
    if spikes.any():
        notes.append(f"position_m has a spike in {_samples(spikes)}: left out of the error")
    still = frozen(position_m, quantum)
    if still.any():
        notes.append(
            f"position_m stands still to the last digit in {_samples(still)}, where it scatters elsewhere: a value "
            "that was repeated, left out of the error"
        )
    return finite & ~spikes & ~still


def _spikes(position_m: Column) -> Mask:
    """Mark single samples that stand far off both neighbours, which agree with each other."""
    before, here, after = position_m[:-2], position_m[1:-1], position_m[2:]
    spikes = np.zeros(position_m.size, dtype=np.bool_)
    if here.size:
        middle_half = np.nanquantile(position_m, 0.99) - np.nanquantile(position_m, 0.01)
        off = np.minimum(np.abs(here - before), np.abs(here - after))
        least_m = max(0.1 * middle_half, LIKELY_SPIKE * _typical_scatter_m(position_m))
        spikes[1:-1] = (off > least_m) & (off > 20.0 * np.abs(after - before)) & (off > 0.0)
        if middle_half == 0.0:
            spikes[:] = False
    return spikes


def _typical_scatter_m(position_m: Column) -> float:
    """Return what second differences typically are, in standard deviations of noise alone, m: motion may be in them."""
    second = np.abs(np.diff(position_m[np.isfinite(position_m)], 2))
    return float(np.median(second)) / (0.6745 * 6.0**0.5) if second.size else 0.0


def _segments(columns: Mapping[str, Column], notes: list[str]) -> Iterator[tuple[int, int]]:
    time_s = columns["time_s"]
    steps = np.diff(time_s)
    longest_s = _longest_step_s(steps)
    breaks: dict[int, str] = {}
    for row in np.flatnonzero(steps <= 0).tolist():
        breaks[row + 1] = f"another recording begins, or the clock is set back by {-steps[row]:.6g} s"
    for row in np.flatnonzero(steps > longest_s).tolist():
        breaks[row + 1] = f"a gap of {steps[row]:.6g} s"
    chosen = _rises(columns.get(STRETCH))
    for row, rise in _rises(columns.get("unrecorded")).items():
        told = f"unrecorded rises by {rise:g}"
        breaks[row] = f"{breaks[row]}, {told}" if row in breaks else told
    lost = _rises(columns.get("lost_samples"))
    if lost:
        notes.append(
            f"lost_samples rises by {sum(lost.values()):g} in {len(lost)} places, the first before sample "
            f"{min(lost) + 1}: the command before is held"
        )
    for row in sorted(breaks.keys() - chosen.keys()):
        notes.append(f"before sample {row + 1} {breaks[row]}: simulated anew from there")
    edges = [0, *sorted(breaks.keys() | chosen.keys()), time_s.size]
    for first, end in pairwise(edges):
        if end - first >= FEW_ROWS:
            yield first, end
        else:
            notes.append(f"samples {first + 1} to {end} stand alone: not simulated")


def _rises(counted: Column | None) -> dict[int, float]:
    """Return the rows at which a counter has risen, and by how much."""
    if counted is None:
        return {}
    rises = np.diff(counted)
    return {row + 1: float(rises[row]) for row in np.flatnonzero(rises > 0.0).tolist()}


def _longest_step_s(steps: Column) -> float:
    """Return the longest step of time that is no gap."""
    forward = steps[steps > 0.0]
    return GAP_PERIOD_QUANTILES * float(np.quantile(forward, 0.95)) if forward.size else np.inf


def _tell_sampling(time_s: Column, segments: tuple[tuple[int, int], ...], notes: list[str]) -> None:
    steps = np.concatenate([np.diff(time_s[first:end]) for first, end in segments])
    median_s = float(np.median(steps))
    if np.quantile(steps, 0.99) - np.quantile(steps, 0.01) > UNEVEN * median_s:
        notes.append(f"sampling is uneven: {steps.min():.4g} to {steps.max():.4g} s, median {median_s:.4g} s")


def _whole(column: Column | None, name: str, notes: list[str]) -> Column | None:
    """Interpolate what is not a number; a column without any number is none."""
    if column is None or not np.isfinite(column).any():
        return None
    finite = np.isfinite(column)
    if finite.all():
        return column
    notes.append(f"{name} is not a number in {_samples(~finite)}: interpolated")
    rows = np.arange(column.size)
    return np.interp(rows, rows[finite], column[finite])


def _pressure_pa(
    columns: Mapping[str, Column],
    command_pa: Column,
    segments: tuple[tuple[int, int], ...],
    *,
    by_setpoint: bool,
    notes: list[str],
) -> Column | None:
    """Return the measured pressure; where it is not a number what the command, if that is a pressure, makes of it."""
    measured_pa = columns.get("pressure_pa")
    if measured_pa is None or by_setpoint or not np.isfinite(measured_pa).any():
        return _whole(measured_pa, "pressure_pa", notes)
    known = np.isfinite(measured_pa)
    if known.all():
        return measured_pa
    notes.append(f"pressure_pa is not a number in {_samples(~known)}: what the command makes of it there")
    return without_gaps_pa(columns["time_s"], command_pa, measured_pa, segments, known)


def _is_even(time_s: Column) -> bool:
    """Return whether the samples of an unbroken stretch are evenly apart."""
    steps = np.diff(time_s)
    return bool(np.ptp(steps) <= UNEVEN * float(np.median(steps)))


def _samples(mask: Mask) -> str:
    """Say which samples: their number and the first."""
    first = int(mask.argmax()) + 1
    count = int(mask.sum())
    return f"sample {first}" if count == 1 else f"{count} samples, the first {first}"
