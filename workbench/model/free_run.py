"""The model on its own through a whole record: it sees the command, never the measured position after the start.

Each segment begins with the stem at rest where it is first measured; one that begins in motion begins with that
velocity. The place is the median of the first still samples, corrected by what the sensor's effects make of it, so that
the model indicates it. What was commanded before is not known. A pressure path that remembers it, a lag or a limited
rate, begins with the pressure nearest to the first command of those that balance the forces:

    at rest      |A p - k_s x + F| <= F_s
    in motion    A p = k_s x - F + F_v v + F_c sign v       F, F_c, F_s with all effects

Of a recording that begins in motion, and is judged from a rest on, the commands before are known: the pressure path
begins with the recording and follows them, with the stem held where it comes to rest.

Behind a positioner no command is a pressure: it begins at rest, with what the record tells of it (`initial_state`).

Simulated from measured pressure, the pressure path's effects are left out, and what the pressure is between its samples
`pressure_between_samples` says. A measured load acts as the pressure load / A besides.

Where samples lie farther apart than slides last (`simulation_regime`), the stem has no inertia (`slow_segments`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple

import numpy as np

from config.errors import InputError
from config.recording import Column
from config.results.result import Brief
from config.valve_file import EffectTable, ValveFile
from sim.composition import AREA, COULOMB, STATIC, Composition
from sim.karnopp import Vector, read, write
from sim.open_loop import (
    INDICATED,
    PATH_ROWS,
    PRESSURE,
    at_rest,
    check_commands,
    check_periods,
    check_step,
    require_numbers,
)
from workbench.data.record import Mask, Record
from workbench.model.initial_state import (
    BeforeStart,
    InitialState,
    before_start,
    held,
    initial_state,
)
from workbench.model.lead import Lead, lead_of
from workbench.model.pressure_between_samples import means_between_samples_pa
from workbench.model.simulation_regime import NO_LANDING, Sampling, sampling
from workbench.model.slow_segments import SlowSegment, slow_segments, told_nothing


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How finely a run is integrated.

    Steps are as long as a sample where the effects bear that, else so many times the longest they bear. The tolerance
    is that of `sim.karnopp`.
    """

    steps: float
    tolerance: float


FINE = Accuracy(1.0, 3e-4)
"""Within 1 um rms, where effects remember, of steps a hundredth as long: a fiftieth of a transmitter's noise."""
PART_S, MOST_PARTS = 2e-3, 8
"""Parts of a sample over which a measured pressure is held: about as long, at most so many."""
BEYOND_PA = 1e12
"""More than holds any stem: nearest to it is what breaks it loose."""


@dataclass(frozen=True, slots=True, repr=False)
class Run(Brief):
    """The simulation, a row a sample of the record; NaN outside its segments. Stem and indicated position apart."""

    indicated_m: Column
    stem_m: Column
    velocity_m_per_s: Column
    pressure_pa: Column


class Segment(NamedTuple):
    """A stretch of a record without a gap, rows first to end (half open), as it is simulated."""

    first: int
    end: int
    begin: InitialState
    before: BeforeStart | None
    """Behind a positioner: what is known of it from before."""
    lead: Lead | None
    """Where a pressure path that remembers was commanded before."""
    drive_pa: Vector
    """Held over each part of the time from one of its samples to the next, Pa."""
    load_n: Vector | None
    """The same of a measured load, N."""
    periods_s: Vector
    """How long each part is, s."""
    parts: int
    """From sample to sample."""
    step_s: float
    """Longest of the integration, s."""


class FreeRun:
    """A composition made ready to run through a record, for one parameter vector after another.

    Raises:
        InputError: simulated from pressure without a measured one; a load together with an effect that needs the
            pressure itself; landings alone are judged, and there is none.
    """

    def __init__(
        self,
        composition: Composition,
        record: Record,
        *,
        from_pressure: bool = False,
        accuracy: Accuracy = FINE,
        by: Sampling | None = None,
    ) -> None:
        self.record = record
        self.by = by or sampling(record, composition.valve)
        self._tolerance = accuracy.tolerance
        self.from_pressure = from_pressure
        everything = (composition, list(range(len(composition.names))))
        self._composition, self._kept = _behind_pressure(composition) if from_pressure else everything
        if not from_pressure:
            _require_same_input(self._composition, record)
        drive_pa = _measured(record) if from_pressure else record.command_pa
        if record.load_n is not None:
            _require_bare_pressure(self._composition)
        leads = [lead_of(record, self._composition, drive_pa, segment) for segment in range(len(record.segments))]
        if self.by.slow:
            self._glide = self._composition.quasi_static.glide
            self._slow = slow_segments(record, self._composition, drive_pa, self.by, from_pressure, leads)
            if not self.by.held and not self.judged.any():
                raise InputError("recording", NO_LANDING)
            return
        longest_s = accuracy.steps * self._composition.step_s
        by_setpoint = self._composition.by_setpoint
        parts_pa = _in_parts(record, drive_pa) if from_pressure else drive_pa[:, None]
        self._segments = [
            _segment(record, parts_pa, rows, longest_s, lead, by_setpoint=by_setpoint)
            for rows, lead in zip(record.segments, leads, strict=True)
        ]

    @property
    def judged(self) -> Mask:
        """Which rows are simulated and tell how good the model is, (n,)."""
        rows = np.zeros(len(self.record), dtype=np.bool_)
        for first, end in self.record.segments:
            rows[first:end] = True
        if self.by.slow:
            rows[:] = False
            for each in self._slow:
                rows[each.judged] = True
        return rows

    def run(self, theta: Vector) -> Run:
        """Simulate; theta, (parameters,), as `composition.names`."""
        rows = np.full((4, len(self.record)), np.nan)
        if self.by.slow:
            for each, (_, pressure_pa, stem_m, velocity_m_per_s, indicated_m) in self._glides(theta):
                held = np.searchsorted(each.rows, np.arange(each.rows[0], each.rows[-1] + 1), side="right") - 1
                path = np.array([indicated_m, stem_m, velocity_m_per_s, pressure_pa])
                rows[:, each.rows[0] : each.rows[-1] + 1] = path[:, held]
            return Run(*rows)
        for first, end, (_, pressure_pa, stem_m, velocity_m_per_s, indicated_m) in self._paths(theta):
            rows[:, first:end] = indicated_m, stem_m, velocity_m_per_s, pressure_pa
        return Run(*rows)

    def position_m(self, theta: Vector) -> Column:
        """Return the indicated position, m, (n,); NaN where it is not simulated or not judged."""
        indicated_m = np.full(len(self.record), np.nan)
        if self.by.slow:
            for each, path in self._glides(theta):
                indicated_m[each.judged] = path[INDICATED, each.at]
            return indicated_m
        for first, end, path in self._paths(theta):
            indicated_m[first:end] = path[INDICATED]
        return indicated_m

    def require_answer(self, indicated_m: Column) -> Column:
        """Return an indicated position, m, (n,), that says something of every row that is judged.

        What is not there is not compared: a model without an answer would be judged by the rest of the record alone.

        Raises:
            InputError: as `sim.open_loop.require_numbers`.
        """
        judged = self.judged
        require_numbers(self._composition, self.record.time_s[judged], indicated_m[judged])
        return indicated_m

    def _glides(self, theta: Vector) -> Iterator[tuple[SlowSegment, Vector]]:
        """Simulate each segment without inertia: it, and what the kernel writes, (5, rows kept)."""
        vector = np.array(theta[self._kept])
        for each in self._slow:
            drive_pa, state = self._started(vector, each)
            path = np.empty((PATH_ROWS, each.periods_s.size + 1))
            self._glide(vector, state, drive_pa, each.periods_s, each.told, each.bears_s(vector), path)
            yield each, path[:, :: each.parts]

    def _paths(self, theta: Vector) -> Iterator[tuple[int, int, Vector]]:
        """Simulate each segment: its rows and what the kernel writes, (5, rows)."""
        vector = np.array(theta[self._kept])
        for each in self._segments:
            drive_pa, state = self._started(vector, each)
            path = np.empty((PATH_ROWS, each.periods_s.size + 1))
            self._composition.kernel.respond(
                vector, state, drive_pa, each.periods_s, each.step_s, self._tolerance, path
            )
            yield each.first, each.end, path[:, :: each.parts]

    def _started(self, theta: Vector, segment: Segment | SlowSegment) -> tuple[Vector, Vector]:
        """Return the pressures of a segment's periods, Pa, and the state that it begins with."""
        drive_pa = segment.drive_pa if segment.load_n is None else segment.drive_pa + segment.load_n / theta[AREA]
        time_s = float(self.record.time_s[segment.first])
        if segment.before is None:
            state = self._begin(theta, segment.begin, time_s, float(drive_pa[0]))
            if segment.lead:
                self._remember(theta, state, segment.lead, segment.step_s)
            return drive_pa, state
        middle_pa, half_pa = self._holding_pa(theta, segment.begin, time_s)
        landed_pa = middle_pa + segment.before.came * theta[COULOMB] / theta[STATIC] * half_pa
        state = self._begin(theta, segment.begin, time_s, landed_pa)
        if segment.before.leaves:
            risen_pa = self._risen_pa(theta, state, segment, segment.before.rests)
            loose_pa = middle_pa + segment.before.leaves * half_pa
            state = self._begin(theta, segment.begin, time_s, loose_pa - risen_pa)
        return drive_pa, state

    def _remember(self, theta: Vector, state: Vector, lead: Lead, step_s: float) -> None:
        """Let the pressure path of a state at rest remember what was commanded before; the stem held."""
        led, _ = self._led(theta, lead, self._led_from_pa(theta, lead, step_s), lead.remembered, step_s)
        for memory in lead.memories:
            state[memory] = led[memory]
        write(state, read(state)._replace(p=read(led).p))

    def _led_from_pa(self, theta: Vector, lead: Lead, step_s: float) -> float:
        """Return the pressure, Pa, that a lead begins with: where the stem is seen to leave, what broke it loose then.

        A path without a dead band reaches then what is a straight line in what it begins with: two show it.
        """
        nearest_pa = self._balanced_pa(theta, lead, float(lead.drive_pa[0]))
        if not lead.before.leaves or lead.begin.velocity_m_per_s:
            return nearest_pa
        middle_pa, half_pa = self._holding_pa(theta, lead.begin, lead.time_s)
        loose_pa = middle_pa + lead.before.leaves * half_pa
        reached_pa = [self._led(theta, lead, each, lead.before.rests, step_s)[1] for each in (middle_pa, nearest_pa)]
        if reached_pa[1] == reached_pa[0]:
            return nearest_pa
        share = (loose_pa - reached_pa[0]) / (reached_pa[1] - reached_pa[0])
        return self._balanced_pa(theta, lead, middle_pa + share * (nearest_pa - middle_pa))

    def _balanced_pa(self, theta: Vector, lead: Lead, wanted_pa: float) -> float:
        """Return the pressure, Pa, nearest to the one wanted with which the stem is as a lead begins."""
        return read(self._begin(theta, lead.begin, lead.time_s, wanted_pa)).p

    def _holding_pa(self, theta: Vector, begin: InitialState, time_s: float) -> tuple[float, float]:
        """Return the middle of the pressures that static friction holds a stem at rest against, and half the band, Pa.

        Half the band above the middle it is about to break loose opening, below it closing.
        """
        closing_pa, opening_pa = (read(self._begin(theta, begin, time_s, way * BEYOND_PA)).p for way in (-1.0, 1.0))
        return 0.5 * (closing_pa + opening_pa), 0.5 * (opening_pa - closing_pa)

    def _led(self, theta: Vector, lead: Lead, begin_pa: float, periods: int, step_s: float) -> tuple[Vector, float]:
        """Return the state after so many periods of a lead, the stem held, and the pressure amid the last one, Pa."""
        state = at_rest(self._composition, theta, lead.time_s, lead.begin.position_m, begin_pa)
        drive_pa, periods_s = lead.drive_pa[:periods], lead.periods_s[:periods]
        return state, float(np.mean(self._held_pa(theta, state, drive_pa, periods_s, step_s)[-2:]))

    def _risen_pa(self, theta: Vector, state: Vector, segment: Segment | SlowSegment, rests: int) -> float:
        """Return by how much the positioner raises the pressure until the middle of a period, the stem held, Pa."""
        drive_pa, periods_s = segment.drive_pa[:rests], segment.periods_s[:rests]
        pressure_pa = self._held_pa(theta, state.copy(), drive_pa, periods_s, segment.step_s)
        return float(0.5 * (pressure_pa[-1] + pressure_pa[-2]) - pressure_pa[0])

    def _held_pa(self, theta: Vector, state: Vector, drive_pa: Vector, periods_s: Vector, step_s: float) -> Vector:
        """Carry a state on with the stem held; return the pressure at the start and after each period, Pa."""
        path = np.empty((PATH_ROWS, periods_s.size + 1))
        if self.by.slow:
            told = np.full(periods_s.size, told_nothing(self._composition))
            self._glide(held(theta), state, drive_pa, periods_s, told, step_s, path)
        else:
            self._composition.kernel.respond(held(theta), state, drive_pa, periods_s, step_s, self._tolerance, path)
        return np.asarray(path[PRESSURE])

    def _begin(self, theta: Vector, begin: InitialState, time_s: float, pressure_pa: float) -> Vector:
        return self._composition.begin(theta, time_s, begin.position_m, begin.velocity_m_per_s, pressure_pa)


def _segment(
    record: Record, drive_pa: Vector, rows: tuple[int, int], longest_s: float, lead: Lead | None, *, by_setpoint: bool
) -> Segment:
    """Return a segment; drive_pa, Pa, (n, parts)."""
    first, end = rows
    parts = drive_pa.shape[1]
    held_pa = check_commands(drive_pa[first : end - 1].ravel())
    load_n = None if record.load_n is None else check_commands(np.repeat(record.load_n[first : end - 1], parts))
    periods_s = check_periods(np.repeat(np.diff(record.time_s[first:end]) / parts, parts), held_pa)
    step_s = check_step(min(float(periods_s.max()), longest_s))
    begin = initial_state(record, first, end, moving=not by_setpoint)
    before = before_start(record, first, end, begin.position_m) if by_setpoint else None
    return Segment(first, end, begin, before, lead, held_pa, load_n, periods_s, parts, step_s)


def _behind_pressure(composition: Composition) -> tuple[Composition, list[int]]:
    """Return the composition without its pressure path, and where its parameters stand in the whole vector."""
    kept = [each for each in composition.effects if "pressure" not in each.functions]
    values = dict(zip(composition.names, composition.theta.tolist(), strict=True))
    tables = tuple(
        EffectTable.model_validate({"name": each.name} | {key: values[f"{each.name}.{key}"] for key in each.parameters})
        for each in kept
    )
    bare = Composition.of(ValveFile(valve=composition.valve, effect=tables), kept, composition.source)
    return bare, [composition.names.index(name) for name in bare.names]


def _require_same_input(composition: Composition, record: Record) -> None:
    if record.by_setpoint and not composition.by_setpoint:
        raise InputError(
            composition.source,
            "the recording has a set point, reference_m, and no command_pa: what obeys it must be in the valve file, "
            '[[effect]] name = "positioner" (docs/recording-format.md)',
        )
    if composition.by_setpoint and not record.by_setpoint:
        raise InputError(
            composition.source, "has a positioner, which obeys a set point: the recording has command_pa, a pressure"
        )


def _measured(record: Record) -> Column:
    """Return the measured pressure at the samples, Pa, (n,).

    Raises:
        InputError: there is none.
    """
    if record.pressure_pa is None:
        raise InputError("recording", "has no measured pressure_pa to simulate from")
    return record.pressure_pa


def _in_parts(record: Record, pressure_pa: Column) -> Vector:
    """Return the means of a pressure, Pa, (n,), over the parts from each sample to the next, (n, parts)."""
    period_s = record.period_s
    # A set point is no pressure that another one follows.
    command_pa = np.zeros_like(pressure_pa) if record.by_setpoint else record.command_pa
    parts = min(MOST_PARTS, ceil(period_s / PART_S))
    return means_between_samples_pa(period_s, command_pa, pressure_pa, record.segments, parts)


def _require_bare_pressure(composition: Composition) -> None:
    for effect in composition.effects:
        if "pressure" in effect.functions or any("p" in arguments for arguments in effect.functions.values()):
            raise InputError(
                composition.source,
                f"effect {effect.name} needs the actuator pressure itself, which a record with load_n does not give",
            )
