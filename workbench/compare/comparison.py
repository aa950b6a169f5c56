"""Compare: the model in free run against the measured position, and where it fails.

The model is adequate if its rms error is at most 1.5 times the floor (sensor noise, or repeatability where the
command repeats itself), the residual does not depend on the input, and no slip is missed or spurious. Where the
floor is unknown nothing is called adequate.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from config.arguments import kinds_held
from config.drive import KINDS, Kind, KindName, Scale
from config.recording import Column, Recording
from config.results.block import Block, Table
from config.results.result import Result
from config.valve_file import ValveFile
from signals.moves import Slip, slips
from sim.composition import Composition
from workbench.compare.comparison_sentences import Findings, Stretch, judge_findings, shorten_notes
from workbench.compare.friction_balance import Forces, FrictionBalance, balance, forces, join_forces
from workbench.compare.measures import fit_in_words, fit_percent, rms, robust, valid_rows
from workbench.compare.phases import PHASES, phases
from workbench.compare.residuals import (
    Correlation,
    Profile,
    Spectrum,
    autocorrelation,
    cross_correlation,
    profile,
    spectrum,
)
from workbench.compare.slip_matching import SlipEvents, match_slips
from workbench.data.motion import velocity_m_per_s
from workbench.data.noise_floor import say_m
from workbench.data.record import Record, ready, require_units
from workbench.model.free_run import FreeRun, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ADEQUATE = 1.5
NUMERICAL = 1e-6
"""Part of the stroke below which an error is none, whatever the noise."""
DEPENDENCE_BANDS = 1.3
"""Times its 99 % band that a correlation with the input must reach at some lag to count as dependence."""


@dataclass(frozen=True, slots=True)
class Phase:
    """Error in one phase; `mean_m` along the opening direction, `share` of the squared error."""

    name: str
    count: int
    rms_m: float
    mean_m: float
    share: float


@dataclass(frozen=True, slots=True)
class PressureSide:
    """The error split where pressure is measured: the model's pressure path, and the rest run from the measurement."""

    pressure_rms_pa: float
    stem_rms_m: float
    stem_fit_percent: float


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(Result):
    """Everything a report draws; arrays of n rows as the recording, NaN where it is not valid."""

    adequate: bool
    sentences: tuple[str, ...]
    stretches: tuple[tuple[Stretch, ...], ...]
    """Where each of the sentences shows."""
    notes: tuple[str, ...]
    fit_percent: float
    rms_m: float
    robust_m: float
    """Median of the rms over blocks of 1 s: no single missed slip carries it."""
    noise_m: float | None
    """None: unknown."""
    repeatability_m: float | None
    floor_m: float | None
    """None: unknown; then `adequate` says nothing of the model."""
    phases: tuple[Phase, ...]
    slips: SlipEvents
    pressure_side: PressureSide | None
    time_s: Column
    command_pa: Column
    """What was asked of it: a pressure, Pa; behind a positioner (`by_setpoint`) the set point, m."""
    measured_m: Column
    simulated_m: Column
    residual_m: Column
    phase: NDArray[np.int64]
    """Index into `phases`."""
    over_time: Profile
    over_position: Profile
    over_velocity: Profile
    over_direction: Profile
    """Last direction of motion, -1 closing, +1 opening."""
    over_pressure: Profile
    autocorrelation: Correlation
    input_correlation: Correlation
    spectrum: Spectrum
    friction: FrictionBalance
    by_setpoint: bool = False
    kind: KindName = "valve"
    """Whose it is: in which names and units it is read."""

    @property
    def own(self) -> Kind:
        """Its names and units."""
        return KINDS[self.kind]

    @property
    def valid_samples(self) -> int:
        """Number of samples whose error counts."""
        return int(np.isfinite(self.residual_m).sum())

    @property
    def structured_m(self) -> float:
        """The part of the error, rms, that goes on from sample to sample (`residuals.Correlation.structured_share`)."""
        return self.rms_m * float(np.sqrt(self.autocorrelation.structured_share))

    def blocks(self) -> list[Block]:
        """Say where the model fails, the gravest first, and by how much in each phase."""
        length = self.own.length
        return [
            f"{self._judgement}: fit {fit_in_words(self.fit_percent, 2)}, error {length.said(self.rms_m, '.4g')} rms, "
            f"{length.said(self.robust_m, '.4g')} robust, noise {say_m(self.noise_m, length)}"
            + ("" if self.repeatability_m is None else f", repeatability {length.said(self.repeatability_m, '.4g')}"),
            *(f"  {sentence}" for sentence in self.sentences),
            _phase_table(self.phases, length),
            *self._slips_and_residual(),
            *(f"recording: {note}" for note in shorten_notes(self.notes)),
        ]

    @property
    def _judgement(self) -> str:
        if self.floor_m is None:
            return "not judged"
        return "adequate" if self.adequate else "not adequate"

    def _slips_and_residual(self) -> list[str]:
        slips, side = self.slips, self.pressure_side
        lines = [
            f"slips: {len(slips.matched)} matched, {len(slips.missed_s)} missed, {len(slips.spurious_s)} spurious",
            f"residual: {self.autocorrelation.outside} of {len(self.autocorrelation.lag) - 1} lags outside the "
            f"99 % band; with the command: {self.input_correlation.outside} of {len(self.input_correlation.lag)}",
        ]
        if side is not None:
            pressure, unit = self.own.command.word, self.own.command.si
            lines.append(
                f"measured {pressure}: the model's is off by {side.pressure_rms_pa:.4g} {unit} rms; run from the "
                f"measured one, the error is {self.own.length.said(side.stem_rms_m, '.4g')} rms"
            )
        return lines

    def frame_columns(self) -> dict[str, object]:
        """Return a row a sample: time, command, position measured and simulated, residual, and the phase's name."""
        return {
            "time_s": self.time_s,
            "reference_m" if self.by_setpoint else "command_pa": self.command_pa,
            "measured_m": self.measured_m,
            "simulated_m": self.simulated_m,
            "residual_m": self.residual_m,
            "phase": np.array(PHASES)[self.phase],
        }

    def plot(self) -> "Figure":
        """Draw the position measured and simulated, and below it the error, over time."""
        from config.results.drawing import MEASURED, MODEL, legend, line, panels

        time_s, length = self.time_s - self.time_s[0], self.own.length
        heights = {f"{self.own.travel.word}, {length.unit}": 3.2, f"error, {length.unit}": 1.6}
        figure, (above, below) = panels(heights, "time, s")
        line(above, time_s, length.factor * self.measured_m, MEASURED, "measured")
        label = f"model, error {length.said(self.rms_m, '.4g')} rms"
        line(above, time_s, length.factor * self.simulated_m, MODEL, label)
        line(below, time_s, length.factor * self.residual_m, MODEL)
        legend(above)
        return figure


@kinds_held
def compare(recording: Recording, valve: ValveFile) -> Comparison:
    """Hold a valve against a recording.

    Raises:
        InputError: an unknown effect, other units than SI, or a recording that cannot be simulated.
    """
    return compare_record(ready(recording), valve)


def compare_record(record: Record, valve: ValveFile) -> Comparison:
    """Hold a valve against a record that was made ready before.

    Raises:
        InputError: an unknown effect, or other units than SI.
    """
    require_units(record, valve.valve)
    composition = Composition.from_file(valve)
    free = FreeRun(composition, record)
    run = free.run(composition.theta)
    free.require_answer(run.indicated_m)
    rows = valid_rows(record, run.indicated_m) & (free.by.held | free.judged)
    residual_m = np.where(rows, run.indicated_m - record.position_m, np.nan)
    segments = [_segment_findings(valve, record, run, first, end) for first, end in record.segments]
    phase, direction = _spread(record, segments)
    events = _join_events([each.events for each in segments])
    velocity = np.concatenate([each.velocity_m_per_s for each in segments])
    even, period_s = _evenly(record, residual_m)
    autocorrelated = autocorrelation(even[1], period_s)
    with_input = cross_correlation(even[0], even[1], period_s)
    error_m = rms(residual_m[rows])
    found = Findings(
        time_s=record.time_s[rows] - record.time_s[0],
        residual_m=residual_m[rows],
        position_m=record.position_m[rows],
        phase=phase[rows],
        direction=direction[rows],
        floor_m=record.floor_m,
        scale_m=record.scale_m,
        rms_m=error_m,
        events=events,
        measured_slips=tuple(slip for each in segments for slip in each.measured),
        depends_on_input=bool(np.max(np.abs(with_input.value)) > DEPENDENCE_BANDS * with_input.band),
        length=valve.valve.own.length,
        close=record.floor_m is not None
        and error_m <= max(ADEQUATE * record.floor_m, NUMERICAL * valve.valve.stroke_m),
    )
    said = judge_findings(found)
    simulated_rows = np.concatenate([np.arange(first, end) for first, end in record.segments])
    valid = rows[simulated_rows]
    return Comparison(
        adequate=found.adequate,
        sentences=tuple(each.text for each in said),
        stretches=tuple(each.stretches for each in said),
        notes=(*record.notes, *([free.by.sentence] if free.by.sentence else [])),
        fit_percent=fit_percent(record, np.where(rows, run.indicated_m, np.nan)),
        rms_m=error_m,
        robust_m=robust(record.time_s[rows], residual_m[rows]),
        noise_m=record.noise_m,
        repeatability_m=record.repeatability_m,
        floor_m=record.floor_m,
        phases=_phases(residual_m[rows], phase[rows]),
        slips=events,
        pressure_side=_pressure_side(composition, record, run),
        time_s=record.time_s,
        command_pa=record.command_pa,
        measured_m=np.where(rows, record.position_m, np.nan),
        simulated_m=run.indicated_m,
        residual_m=residual_m,
        phase=phase,
        over_time=profile(record.time_s[rows], residual_m[rows]),
        over_position=profile(record.position_m[rows], residual_m[rows]),
        over_velocity=profile(velocity[valid], residual_m[simulated_rows][valid]),
        over_direction=profile(direction[rows][direction[rows] != 0], residual_m[rows][direction[rows] != 0], 2),
        over_pressure=profile(_pressure(record, run)[rows], residual_m[rows]),
        autocorrelation=autocorrelated,
        input_correlation=with_input,
        spectrum=spectrum(even[1], period_s),
        friction=balance(
            join_forces([each.measured_forces for each in segments]),
            join_forces([each.model_forces for each in segments]),
        ),
        by_setpoint=record.by_setpoint,
        kind=valve.valve.kind,
    )


def _phase_table(found: Sequence[Phase], length: Scale) -> Table:
    rows = [
        (
            each.name,
            f"{each.count}",
            *(length.number(value, ".4f") for value in (each.rms_m, each.mean_m)),
            f"{each.share:.0%}",
        )
        for each in found
        if each.count
    ]
    return Table(("phase", "samples", f"rms {length.unit}", f"mean {length.unit}", "share"), rows)


@dataclass(frozen=True, slots=True)
class _SegmentFindings:
    """What is found in one segment."""

    measured: tuple[Slip, ...]
    events: SlipEvents
    phase: NDArray[np.int64]
    direction: Column
    velocity_m_per_s: Column
    measured_forces: Forces
    model_forces: Forces


def _segment_findings(valve: ValveFile, record: Record, run: Run, first: int, end: int) -> _SegmentFindings:
    time_s = record.time_s[first:end]
    rows = np.arange(end - first)
    valid = record.valid[first:end]
    # Only for finding motion: across a bad sample the stem is taken to go straight.
    measured_m = np.interp(rows, rows[valid], record.position_m[first:end][valid])
    simulated_m = run.indicated_m[first:end]
    measured, simulated = slips(measured_m, record.scale_m), slips(simulated_m, record.scale_m)
    pressure_pa = _pressure(record, run)[first:end]
    load_n = np.zeros(rows.size) if record.load_n is None else record.load_n[first:end]
    begun = np.searchsorted([each.first for each in measured], rows, side="right")
    direction = np.array([0.0, *(each.direction for each in measured)])[begun]
    both = [
        forces(valve.valve, time_s, position_m, pressure_pa, load_n, record.scale_m)
        for position_m in (measured_m, simulated_m)
    ]
    return _SegmentFindings(
        measured,
        match_slips(time_s - record.time_s[0], (measured, measured_m), (simulated, simulated_m), record.scale_m),
        phases(measured_m, measured, valve),
        direction,
        velocity_m_per_s(time_s, measured_m),
        both[0],
        both[1],
    )


def _pressure(record: Record, run: Run) -> Column:
    return run.pressure_pa if record.pressure_pa is None else record.pressure_pa


def _spread(record: Record, segments: Sequence[_SegmentFindings]) -> tuple[NDArray[np.int64], Column]:
    phase, direction = np.zeros(len(record), np.int64), np.zeros(len(record))
    for (first, end), each in zip(record.segments, segments, strict=True):
        phase[first:end], direction[first:end] = each.phase, each.direction
    return phase, direction


def _join_events(events: Sequence[SlipEvents]) -> SlipEvents:
    return SlipEvents(
        tuple(pair for each in events for pair in each.matched),
        tuple(t for each in events for t in each.missed_s),
        tuple(t for each in events for t in each.spurious_s),
    )


def _evenly(record: Record, residual_m: Column) -> tuple[tuple[Column, Column], float]:
    """Return command and residual of the longest segment on an even grid of the median period, and the period."""
    first, end = max(record.segments, key=lambda each: each[1] - each[0])
    time_s, error_m = record.time_s[first:end], residual_m[first:end]
    finite = np.isfinite(error_m)
    period_s = float(np.median(np.diff(time_s)))
    grid = time_s[0] + period_s * np.arange(int((time_s[-1] - time_s[0]) / period_s + 1e-6) + 1)
    held = np.clip(np.searchsorted(time_s, grid + 1e-6 * period_s, side="right") - 1, 0, time_s.size - 1)
    return (record.command_pa[first:end][held], np.interp(grid, time_s[finite], error_m[finite])), period_s


def _phases(residual_m: Column, phase: NDArray[np.int64]) -> tuple[Phase, ...]:
    total = float(np.sum(residual_m**2)) or 1.0
    parts = [residual_m[phase == i] for i in range(len(PHASES))]
    return tuple(
        Phase(name, part.size, rms(part), float(part.mean()) if part.size else np.nan, float(np.sum(part**2)) / total)
        for name, part in zip(PHASES, parts, strict=True)
    )


def _pressure_side(composition: Composition, record: Record, run: Run) -> PressureSide | None:
    if record.pressure_pa is None:
        return None
    stem_m = FreeRun(composition, record, from_pressure=True).position_m(composition.theta)
    rows = valid_rows(record, stem_m)
    return PressureSide(
        rms((run.pressure_pa - record.pressure_pa)[rows]),
        rms(stem_m[rows] - record.position_m[rows]),
        fit_percent(record, stem_m),
    )
