"""The model on its own through a whole record: it sees the command, never the measured position after the start.

Each segment begins with the stem at rest where it is first measured; one that begins in motion begins with that
velocity. The place is the median of the first still samples, corrected by what the sensor's effects make of it, so that
the model indicates it. What was commanded before is not known. A pressure path that remembers it, a lag or a limited
rate, begins with the pressure nearest to the first command of those that balance the forces:

    at rest      |A p - k_s x| <= F_s
    in motion    A p = k_s x + F_v v + F_c sign v

Behind a positioner no command is a pressure: it begins at rest, with that in the middle of those that balance, and
the positioner brings it to where it moves.

Simulated from measured pressure, the pressure path's effects are left out, and the pressure of a period is the mean
of the measurements at its ends. A measured load acts as the pressure load / A besides.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from config.errors import InputError
from config.recording import Column
from config.results.result import Brief
from config.valve_file import EffectTable, ValveFile
from sim.composition import AREA, COULOMB, SPRING, STATIC, VISCOUS, Composition
from sim.karnopp import SLIP, Vector, read, write
from sim.open_loop import INDICATED, PATH_ROWS, at_rest, checked_commands, checked_periods, checked_step
from workbench.data.record import Record


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How finely a run is integrated.

    Steps are as long as a sample where the effects bear that, else so many times the longest they bear. The tolerance
    is that of `sim.karnopp`.
    """

    steps: float
    tolerance: float


FINE = Accuracy(1.0, 3e-4)
"""Within 0.5 um rms of steps and a tolerance a hundredth of it: a hundredth of a transmitter's noise."""
ROUGH = Accuracy(2.0, 1e-3)
"""Within 50 um, in half the time."""
MOST_CORRECTIONS = 3
"""Of the stem at the start, until the model indicates what was measured there."""
STILL = 4.0
"""Standard deviations of the noise within which the stem stands still."""
LONGEST_START = 50
"""Samples of the start that are averaged at most."""
SHORT = 4
"""Samples within which a stem that leaves its place is in motion from the start."""


@dataclass(frozen=True, slots=True, repr=False)
class Run(Brief):
    """The simulation, a row a sample of the record; NaN outside its segments. Stem and indicated position apart."""

    indicated_m: Column
    stem_m: Column
    velocity_m_per_s: Column
    pressure_pa: Column


@dataclass(frozen=True, slots=True)
class InitialState:
    """Where a segment begins: position, m, and velocity, m/s."""

    position_m: float
    velocity_m_per_s: float


class Segment(NamedTuple):
    """A stretch of a record without a gap, rows first to end (half open), as it is simulated."""

    first: int
    end: int
    begin: InitialState
    drive_pa: Vector
    """Held from each of its samples to the next, Pa."""
    load_n: Vector | None
    """The same of a measured load, N."""
    periods_s: Vector
    """Between its samples, s."""
    step_s: float
    """Longest of the integration, s."""


class FreeRun:
    """A composition made ready to run through a record, for one parameter vector after another.

    Raises:
        InputError: simulated from pressure without a measured one; a load together with an effect that needs the
            pressure itself.
    """

    def __init__(
        self, composition: Composition, record: Record, *, from_pressure: bool = False, accuracy: Accuracy = FINE
    ) -> None:
        self.record = record
        self._tolerance = accuracy.tolerance
        self.from_pressure = from_pressure
        everything = (composition, list(range(len(composition.names))))
        self._composition, self._kept = _behind_pressure(composition) if from_pressure else everything
        if not from_pressure:
            _require_same_input(self._composition, record)
        drive_pa = _measured(record) if from_pressure else record.command_pa
        if record.load_n is not None:
            _require_bare_pressure(self._composition)
        longest_s = accuracy.steps * self._composition.step_s
        self._segments = [_segment(record, drive_pa, first, end, longest_s) for first, end in record.segments]

    def run(self, theta: Vector) -> Run:
        """Simulate; theta, (parameters,), as `composition.names`."""
        rows = np.full((4, len(self.record)), np.nan)
        for first, end, (_, pressure_pa, stem_m, velocity_m_per_s, indicated_m) in self._paths(theta):
            rows[:, first:end] = indicated_m, stem_m, velocity_m_per_s, pressure_pa
        return Run(*rows)

    def position_m(self, theta: Vector) -> Column:
        """Return the indicated position, m, (n,)."""
        indicated_m = np.full(len(self.record), np.nan)
        for first, end, path in self._paths(theta):
            indicated_m[first:end] = path[INDICATED]
        return indicated_m

    def _paths(self, theta: Vector) -> Iterator[tuple[int, int, Vector]]:
        """Simulate each segment: its rows and what the kernel writes, (5, rows)."""
        vector = np.array(theta[self._kept])
        for first, end, begin, held_pa, load_n, periods_s, step_s in self._segments:
            drive_pa = held_pa if load_n is None else held_pa + load_n / vector[AREA]
            state = self._begin(vector, begin, float(self.record.time_s[first]), float(drive_pa[0]))
            path = np.empty((PATH_ROWS, end - first))
            self._composition.kernel.respond(vector, state, drive_pa, periods_s, step_s, self._tolerance, path)
            yield first, end, path

    def _begin(self, theta: Vector, begin: InitialState, time_s: float, pressure_pa: float) -> Vector:
        stem_m = begin.position_m
        if self._composition.by_setpoint:
            begin = InitialState(stem_m, 0.0)
            pressure_pa = float(theta[SPRING] * stem_m / theta[AREA])
        for _ in range(MOST_CORRECTIONS):
            held_pa = equilibrium_pa(theta, stem_m, begin.velocity_m_per_s, pressure_pa)
            state = at_rest(self._composition, theta, time_s, stem_m, held_pa)
            off_m = begin.position_m - read(state).indicated
            if off_m == 0.0:
                break
            stem_m += off_m
        if begin.velocity_m_per_s:
            direction = float(np.sign(begin.velocity_m_per_s))
            write(state, read(state)._replace(v=begin.velocity_m_per_s, mode=SLIP, sigma=direction))
        return state


def _segment(record: Record, drive_pa: Column, first: int, end: int, longest_s: float) -> Segment:
    held_pa = checked_commands(drive_pa[first : end - 1])
    load_n = None if record.load_n is None else checked_commands(record.load_n[first : end - 1])
    periods_s = checked_periods(np.diff(record.time_s[first:end]), held_pa)
    step_s = checked_step(min(float(periods_s.max()), longest_s))
    return Segment(first, end, initial_state(record, first, end), held_pa, load_n, periods_s, step_s)


def equilibrium_pa(theta: Vector, position_m: float, velocity_m_per_s: float, command_pa: float) -> float:
    """Return the pressure, Pa, nearest to a command with which the forces are in balance; theta, (parameters,)."""
    middle_n = theta[SPRING] * position_m + theta[VISCOUS] * velocity_m_per_s
    if velocity_m_per_s:
        return float((middle_n + theta[COULOMB] * np.sign(velocity_m_per_s)) / theta[AREA])
    least_pa, most_pa = ((middle_n + sign * theta[STATIC]) / theta[AREA] for sign in (-1.0, 1.0))
    return float(min(max(command_pa, least_pa), most_pa))


def initial_state(record: Record, first: int, end: int) -> InitialState:
    """Return where a segment begins, from its first valid samples."""
    rows = first + np.flatnonzero(record.valid[first:end])
    if not rows.size:
        raise InputError("recording", f"samples {first + 1} to {end}: no position is a number")
    position_m = record.position_m[rows[:LONGEST_START]]
    time_s = record.time_s[rows[:LONGEST_START]]
    band_m = STILL * record.scale_m
    moving = np.abs(position_m - position_m[0]) > 2.0 * band_m
    still = int(moving.argmax()) if moving.any() else position_m.size
    if still >= SHORT or position_m.size < SHORT:
        return InitialState(float(np.median(position_m[: max(1, still - 1)])), 0.0)
    slope, place = np.polyfit(time_s[:SHORT] - time_s[0], position_m[:SHORT], 1)
    return InitialState(float(place), float(slope))


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
            '[[effect]] name = "positioner" (docs/recordings.md)',
        )
    if composition.by_setpoint and not record.by_setpoint:
        raise InputError(
            composition.source, "has a positioner, which obeys a set point: the recording has command_pa, a pressure"
        )


def _measured(record: Record) -> Column:
    if record.pressure_pa is None:
        raise InputError("recording", "has no measured pressure_pa to simulate from")
    following = np.append(record.pressure_pa[1:], record.pressure_pa[-1])
    return np.asarray(0.5 * (record.pressure_pa + following))


def _require_bare_pressure(composition: Composition) -> None:
    for effect in composition.effects:
        if "pressure" in effect.functions or any("p" in arguments for arguments in effect.functions.values()):
            raise InputError(
                composition.source,
                f"effect {effect.name} needs the actuator pressure itself, which a record with load_n does not give",
            )
