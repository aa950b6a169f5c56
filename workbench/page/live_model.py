"""A valve against a recording, its parameters moved by hand: the whole model runs anew at each move, in milliseconds.

A parameter is moved in the coordinate of a fit (`workbench.model.search_coordinates`). A slider's way is what such a
valve may be: a tenth to ten times a parameter of the valve on the desk, up to four times the strongest that an effect's
file begins a search with. A number that is typed may lie wherever it is physical.

An effect that is switched off has the parameters with which it vanishes; nothing is compiled.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from config.errors import InputError
from config.recording import Column
from config.valve_file import ValveFile
from sim.composition import BASE, Composition
from sim.effect import Parameter as Declared
from sim.karnopp import Vector
from workbench.compare.comparison import Comparison, compare_record
from workbench.compare.friction_balance import Forces, forces, join_forces
from workbench.compare.measures import rms, valid_rows
from workbench.data.record import Record, require_units
from workbench.model.free_run import FreeRun, Run
from workbench.model.search_coordinates import Parameter, free_parameters

SLIDER_FACTOR = 10.0
"""A parameter of the bare valve: slider from this part of the valve file's value to this many times it."""
STRONGEST = 4.0
"""An effect's: slider to so many times its strongest start, away from where it vanishes."""
FIXED = ("diaphragm_area_m2", "deadzone_ratio")
"""Of the bare valve: only ratios of forces are in a recording, and the dead zone is the method's."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What the hand has set: every parameter, and the effects that are switched off."""

    theta: Vector
    off: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Curve:
    """One run: what the model indicates, m, its pressure, Pa, and its error, m, (n,) each; the rms of the error, m."""

    simulated_m: Column
    pressure_pa: Column
    residual_m: Column
    rms_m: float


class LiveModel:
    """Raises InputError as `compare_record` does."""

    def __init__(self, record: Record, valve: ValveFile) -> None:
        self.record = record
        require_units(self.record, valve.valve)
        self._composition = Composition.from_file(valve)
        self._run = FreeRun(self._composition, self.record)
        self.parameters = self._movable()
        self.setting = self._given = Setting(np.array(self._composition.theta))
        self._before: list[Setting] = []

    @property
    def effects(self) -> tuple[str, ...]:
        """The names of its effects."""
        return tuple(each.name for each in self._composition.effects)

    @property
    def written(self) -> tuple[str, ...]:
        """The same as the valve file names them; one of one's own by its path."""
        return tuple(each.written for each in self._composition.effects)

    def value(self, parameter: Parameter) -> float:
        """Return what a parameter is set to, SI."""
        return float(self.setting.theta[parameter.index])

    def share(self, parameter: Parameter) -> float:
        """Return where in its range a parameter stands, 0 to 1 in its coordinate."""
        least, most = parameter.bounds
        return (parameter.coordinate(self.setting.theta) - least) / (most - least)

    def value_at(self, parameter: Parameter, share: float) -> float:
        """Return the value, SI, at a place in the range."""
        theta = np.array(self.setting.theta)
        _put(theta, parameter, share)
        return float(theta[parameter.index])

    def put(self, parameter: Parameter, value: float, per_si: float = 1.0) -> None:
        """Set a parameter to a value in a unit of which so many are one of SI.

        Raises:
            InputError: it is beyond the physical range; says what is allowed.
        """
        physical, theta = self._physical[parameter.name], np.array(self.setting.theta)
        coulomb_n = float(theta[BASE.index("coulomb_n")]) if parameter.name == "static_n" else 1.0
        least, most = (per_si * coulomb_n * each for each in (physical.least, physical.most))
        if not least <= value <= most:
            raise InputError(parameter.name, f"allowed is {least:.4g} to {most:.4g}, got {value:.6g}")
        there = np.array(theta)
        there[parameter.index] = value / per_si
        physical.put(theta, physical.coordinate(there))  # sliding friction takes the static along
        theta[parameter.index] = value / per_si
        self.keep()
        self.setting = replace(self.setting, theta=theta)

    def keep(self) -> None:
        """Remember the setting: `undo` comes back to it."""
        self._before.append(self.setting)

    def move(self, parameter: Parameter, share: float) -> None:
        """Set a parameter by its place in the range, 0 to 1."""
        theta = np.array(self.setting.theta)
        _put(theta, parameter, share)
        self.setting = replace(self.setting, theta=theta)

    def switch(self, effect: str, on: bool) -> None:
        """Switch an effect on or off."""
        self.keep()
        off = self.setting.off - {effect} if on else self.setting.off | {effect}
        self.setting = replace(self.setting, off=off)

    def undo(self) -> bool:
        """Go back to the setting kept last; whether there was one."""
        if not self._before:
            return False
        self.setting = self._before.pop()
        return True

    @property
    def valve(self) -> ValveFile:
        """The valve file as it is set: without the effects that are switched off.

        Raises:
            InputError: a value that no valve file may say.
        """
        file = self._composition.file(self.setting.theta)
        on = [
            table
            for effect, table in zip(self._composition.effects, file.effect, strict=True)
            if effect.name not in self.setting.off
        ]
        return file.model_copy(update={"effect": tuple(on)})

    @property
    def moved(self) -> Mapping[str, float]:
        """The parameters that are no longer as the valve file says, SI by name; none of an effect that is off."""
        changed = np.flatnonzero(self.setting.theta != self._given.theta).tolist()
        names = [(self._composition.names[index], index) for index in changed]
        return {
            name: float(self.setting.theta[index])
            for name, index in names
            if name.rpartition(".")[0] not in self.setting.off
        }

    @property
    def switched_off(self) -> tuple[str, ...]:
        """The effects that are off, in the file's order."""
        return tuple(name for name in self.effects if name in self.setting.off)

    def curve(self) -> Curve:
        """Run the model through the recording as it is set."""
        run = self._run.run(self._effective())
        rows = valid_rows(self.record, run.indicated_m) & (self._run.by.held | self._run.judged)
        residual_m = np.where(rows, run.indicated_m - self.record.position_m, np.nan)
        return Curve(run.indicated_m, run.pressure_pa, residual_m, rms(residual_m[rows]))

    def comparison(self) -> Comparison:
        """Return all that `compare` says of it.

        Raises:
            InputError: as `compare_record`.
        """
        return compare_record(self.record, self.valve)

    def forces(self) -> tuple[Forces, Forces]:
        """Return the friction that the balance of forces leaves in motion: as measured, and of the model."""
        run = self._run.run(self._effective())
        measured = [self._forces(run, self.record.position_m, each) for each in self.record.segments]
        model = [self._forces(run, run.indicated_m, each) for each in self.record.segments]
        return join_forces(measured), join_forces(model)

    def _forces(self, run: Run, position_m: Column, segment: tuple[int, int]) -> Forces:
        rows = slice(*segment)
        record, here_m = self.record, position_m[rows]
        whole = np.isfinite(here_m) & record.valid[rows]
        along = np.arange(here_m.size)
        load_n = np.zeros(here_m.size) if record.load_n is None else record.load_n[rows]
        pressure_pa = run.pressure_pa if record.pressure_pa is None else record.pressure_pa
        # Only for finding motion: across a bad sample the stem is taken to go straight.
        straight_m = np.interp(along, along[whole], here_m[whole])
        valve = self._composition.file(self.setting.theta).valve
        return forces(valve, record.time_s[rows], straight_m, pressure_pa[rows], load_n, record.scale_m)

    def _effective(self) -> Vector:
        theta = np.array(self.setting.theta)
        names = self._composition.names
        for effect in self._composition.effects:
            if effect.name in self.setting.off:
                for key, value in zip(effect.parameters, effect.off(self._composition.valve), strict=True):
                    theta[names.index(f"{effect.name}.{key}")] = value
        return theta

    def _movable(self) -> Mapping[str, Parameter]:
        bare = [name for name in BASE if name not in FIXED and getattr(self._composition.valve, name) > 0.0]
        rest = [name for name in self._composition.names if name not in BASE]
        self._physical = {each.name: each for each in free_parameters(self._composition, [*bare, *rest])}
        return {name: self._on_slider(each) for name, each in self._physical.items()}

    def _on_slider(self, parameter: Parameter) -> Parameter:
        """Return a parameter with the range of its slider, in which its value lies."""
        value = float(self._composition.theta[parameter.index])
        effect, _, key = parameter.name.rpartition(".")
        if parameter.name == "static_n":
            return parameter  # a ratio
        if not effect:
            low, high = value / SLIDER_FACTOR, value * SLIDER_FACTOR
        else:
            declared = next(each for each in self._composition.effects if each.name == effect).parameters[key]
            low, high = _reach(declared, parameter.starts)
        low, high = min(low, value), max(high, value)
        return replace(parameter, least=max(low, parameter.least), most=min(high, parameter.most))


def _reach(declared: Declared, starts: Sequence[float]) -> tuple[float, float]:
    """Return how far a slider reaches about the starts of a search, on both sides of where the effect vanishes.

    One that vanishes at an end of what is physical, as a stop a hundred metres away, is reached by its switch alone.

    >>> _reach(Declared("", -1e9, 1e9, off=0.0), (-0.1, 0.1, 0.5)), _reach(Declared("", -9.0, 9.0, off=9.0), (0.0, 0.1))
    ((-2.0, 2.0), (-0.4, 0.4))
    >>> _reach(Declared("", 1e-9, 1e9), (0.1, 10.0))
    (0.025, 40.0)
    """
    if declared.least > 0.0:
        return min(starts) / STRONGEST, max(starts) * STRONGEST
    off = declared.off
    middle = 0.0 if off is None or not declared.least < off < declared.most else off
    far = STRONGEST * max(abs(each - middle) for each in starts)
    return middle - far, middle + far


def _put(theta: Vector, parameter: Parameter, share: float) -> None:
    least, most = parameter.bounds
    parameter.put(theta, least + min(max(share, 0.0), 1.0) * (most - least))
