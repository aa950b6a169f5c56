"""A valve file made ready to run: its effects, its parameter vector, its kernel.

The parameter vector theta holds the base model's parameters in the order of BASE, then each effect's in the order of
the file; an effect's parameter is named `effect.parameter`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, Self, TypeVar

import numpy as np

from config.drive import Kind
from config.errors import InputError
from config.loading import validate
from config.valve_file import ValveFile, ValveParameters
from sim.effect import SHIPPED, Effect, find_effect
from sim.karnopp import MEMORY, Vector
from sim.kernel import EitherKernel, Kernel, QuasiStaticKernel, ToldKernel, kernel, quasi_static_kernel, told_kernel

BASE = (
    "mass_kg",
    "diaphragm_area_m2",
    "spring_n_per_m",
    "viscous_ns_per_m",
    "coulomb_n",
    "static_n",
    "stribeck_velocity_m_per_s",
    "deadzone_ratio",
)
T = TypeVar("T")
MASS, AREA, SPRING, VISCOUS, COULOMB, STATIC, STRIBECK, DEADZONE = range(len(BASE))
"""Where they stand in theta."""


@dataclass(frozen=True, slots=True)
class Composition:
    """The bare valve with its effects in their places."""

    valve: ValveParameters
    effects: tuple[Effect, ...]
    theta: Vector = field(repr=False)
    source: str
    """What errors name: the valve file."""
    _compiled: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    """The kernels that have been asked for."""

    @classmethod
    def from_file(cls, file: ValveFile, source: str = "valve file") -> Self:
        """Compose a valve file with the effects that it names.

        Raises:
            InputError: an unknown effect, one that stands twice, a parameter unknown, missing or out of its range.
        """
        return cls.of(file, [find_effect(each.name, source) for each in file.effect], source)

    @classmethod
    def of(cls, file: ValveFile, effects: Sequence[Effect], source: str = "valve file") -> Self:
        """Compose a valve file, `effects` being what its `[[effect]]` tables name, in their order.

        Raises:
            InputError: an effect that stands twice or does not compile, a parameter unknown, missing or out of range.
        """
        composed = cls(file.valve, tuple(effects), parameter_vector(file, effects, source), source)
        if any(each.path.parent != SHIPPED for each in effects):
            # What comes along is known to compile, and is compiled when it is first asked for.
            kernel(effects)
        return composed

    @property
    def names(self) -> tuple[str, ...]:
        """Name the entries of theta."""
        return BASE + tuple(f"{each.name}.{key}" for each in self.effects for key in each.parameters)

    @property
    def kernel(self) -> Kernel:
        """The kernel; compiled when it is first asked for."""
        return self._kernel("kernel", kernel)

    @property
    def quasi_static(self) -> QuasiStaticKernel:
        """The kernel without inertia; compiled when it is first asked for."""
        return self._kernel("quasi-static", quasi_static_kernel)

    @property
    def told(self) -> ToldKernel:
        """The kernel of a stem that is told when it moves; compiled when it is first asked for."""
        return self._kernel("told", told_kernel)

    @property
    def state_size(self) -> int:
        """Entries of the state vector."""
        return MEMORY + sum(each.memory for each in self.effects)

    def rest(self, theta: Vector, state: Vector, time_s: float, position_m: float, command_pa: float) -> None:
        """Set a state at rest, by whichever kernel is there."""
        self._either.rest(theta, state, time_s, position_m, command_pa)

    def begin(
        self, theta: Vector, time_s: float, position_m: float, velocity_m_per_s: float, command_pa: float
    ) -> Vector:
        """Return the state, (state_size,), of `sim.karnopp.begin`, by whichever kernel is there."""
        state = np.zeros(self.state_size)
        self._either.begin(theta, state, time_s, position_m, velocity_m_per_s, command_pa)
        return state

    @property
    def _either(self) -> EitherKernel:
        """Whichever kernel is there."""
        found: EitherKernel = self._compiled.get("quasi-static") or self._compiled.get("told") or self.kernel
        return found

    def _kernel(self, name: str, compiled: Callable[[Sequence[Effect]], T]) -> T:
        if name not in self._compiled:
            self._compiled[name] = compiled(self.effects)
        found: T = self._compiled[name]
        return found

    @property
    def step_s(self) -> float:
        """Longest step of the integration that its effects bear, s; infinite if any."""
        return min((each.step_s for each in self.effects), default=inf)

    @property
    def positioner(self) -> Effect | None:
        """The effect that obeys a set point, if there is one."""
        return next((each for each in self.effects if each.by_setpoint), None)

    @property
    def by_setpoint(self) -> bool:
        """Whether its input is a set point, m, that a positioner obeys, and not a pressure, Pa."""
        return self.positioner is not None

    def changed(self, theta: Vector, parameters: Mapping[str, float]) -> Vector:
        """Return theta, (parameters,) in the order of `names`, with some of them replaced by name.

        Raises:
            InputError: an unknown name, or a value that is not physical (ranges, static_n >= coulomb_n).
        """
        for name in parameters:
            if name not in self.names:
                raise InputError(self.source, f"{name}: unknown parameter; there are: {', '.join(self.names)}")
        values: dict[str, Any] = {**dict(zip(self.names, theta.tolist(), strict=True)), **parameters}
        base = {"name": self.valve.name, "stroke_m": self.valve.stroke_m} | {name: values[name] for name in BASE}
        validate(ValveParameters, base, self.source)
        for effect in self.effects:
            written = {key: values[f"{effect.name}.{key}"] for key in effect.parameters}
            _values(effect, written, f"{self.source}: effect {effect.name}", self.valve.own)
        return np.array([float(values[name]) for name in self.names])

    def file(self, theta: Vector) -> ValveFile:
        """Return the valve file that says theta, (parameters,) in the order of `names`.

        Raises:
            InputError: a value that no valve file may say.
        """
        values: dict[str, Any] = dict(zip(self.names, theta.tolist(), strict=True))
        base = self.valve.model_dump() | {name: values[name] for name in BASE}
        tables = [
            {"name": each.written} | {key: values[f"{each.name}.{key}"] for key in each.parameters}
            for each in self.effects
        ]
        return validate(ValveFile, {"valve": base, "effect": tables}, self.source)


def _values(effect: Effect, written: Mapping[str, Any], source: str, kind: Kind) -> tuple[float, ...]:
    """Return an effect's parameters; what is wrong with them is said in the kind's own names.

    Raises:
        InputError: a parameter unknown, missing or out of its range.
    """
    try:
        return effect.values(written, source)
    except InputError as error:
        raise InputError(source, kind.text(error.problem)) from None


def parameter_vector(file: ValveFile, effects: Sequence[Effect], source: str) -> Vector:
    """Return theta of a valve file, `effects` being what its `[[effect]]` tables name, in their order.

    Raises:
        InputError: an effect that stands twice, a parameter unknown, missing or out of its range.
    """
    names = [each.name for each in effects]
    for name in names:
        if names.count(name) > 1:
            raise InputError(source, f"effect {name} stands {names.count(name)} times; once is allowed")
    path = [each for each in effects if "pressure" in each.functions]
    for late in (each for each in path[1:] if each.by_setpoint):
        raise InputError(source, f"effect {late.name} obeys a set point: it must stand before {path[0].name}")
    theta = [float(getattr(file.valve, name)) for name in BASE]
    by_force = not file.valve.own.area
    for effect, table in zip(effects, file.effect, strict=True):
        written = table.parameters
        if by_force:
            written = {effect.declared(key): value for key, value in written.items()}
        theta += _values(effect, written, f"{source}: effect {table.name}", file.valve.own)
    vector = np.array(theta)
    vector.flags.writeable = False
    return vector
