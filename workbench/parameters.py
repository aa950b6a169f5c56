"""The parameters of a fit and the coordinates in which they are searched.

z = log p                     a parameter that is positive throughout
z = log(F_s / F_c) >= 0       static friction: never below Coulomb friction
z = asinh(p / s)              a parameter that may be zero or negative, s = 1 % of its range
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import asinh, exp, log, sinh

import numpy as np

from config.errors import InputError
from sim.composition import BASE, Composition
from sim.karnopp import Vector
from workbench.record import Record

DEFAULT = ("spring_n_per_m", "viscous_ns_per_m", "coulomb_n", "static_n")
"""What is free of the base model by default. A is fixed: pressure and position give only ratios of forces."""
FACTOR = 50.0
"""A base parameter is sought within this factor of the valve file's."""
MOST_STATIC = 5.0
"""F_s / F_c at most."""
STRENGTHS = 6
MOST_GRID = 48
COULOMB, STATIC = BASE.index("coulomb_n"), BASE.index("static_n")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A free parameter: where it stands in theta, and its physical range."""

    name: str
    index: int
    least: float
    most: float

    def coordinate(self, theta: Vector) -> float:
        """Return z of the value in theta, inside the range."""
        value = float(theta[self.index])
        if self.index == STATIC:
            return log(min(max(value / float(theta[COULOMB]), 1.0), self.most))
        value = min(max(value, self.least), self.most)
        return log(value) if self.least > 0 else asinh(value / self.scale)

    def put(self, theta: Vector, z: float) -> None:
        """Write the value of z into theta; Coulomb friction takes the static along, which is free after it or not."""
        if self.index == STATIC:
            theta[STATIC] = theta[COULOMB] * exp(z)
        elif self.index == COULOMB:
            ratio = max(1.0, theta[STATIC] / theta[COULOMB]) if theta[COULOMB] else 1.0
            theta[COULOMB] = exp(z)
            theta[STATIC] = ratio * theta[COULOMB]
        else:
            theta[self.index] = exp(z) if self.least > 0 else self.scale * sinh(z)

    @property
    def scale(self) -> float:
        """s."""
        return 0.01 * max(abs(self.least), abs(self.most))

    @property
    def bounds(self) -> tuple[float, float]:
        """The range of z."""
        if self.index == STATIC or self.least > 0:
            return log(self.least), log(self.most)
        return asinh(self.least / self.scale), asinh(self.most / self.scale)


def free_parameters(composition: Composition, free: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the named parameters, Coulomb before static friction.

    Raises:
        InputError: an unknown name, the area, or a stem without Coulomb friction.
    """
    names = composition.names
    for name in free:
        if name not in names:
            raise InputError(composition.source, f"free: unknown parameter {name}; there are: {', '.join(names)}")
        if name == "diaphragm_area_m2":
            raise InputError(
                composition.source, "free: diaphragm_area_m2 cannot be fitted: only ratios of forces are in a recording"
            )
    return tuple(_parameter(composition, names.index(name)) for name in names if name in free)


def _parameter(composition: Composition, index: int) -> Parameter:
    name = composition.names[index]
    if index == STATIC:
        return Parameter(name, index, 1.0, MOST_STATIC)
    if index < len(BASE):
        value = float(composition.theta[index]) or _smallest(composition, name)
        return Parameter(name, index, value / FACTOR, value * FACTOR)
    effect, _, key = name.partition(".")
    declared = next(each for each in composition.effects if each.name == effect).parameters[key]
    return Parameter(name, index, declared.least, declared.most)


def _smallest(composition: Composition, name: str) -> float:
    """Return where to begin with a friction that the valve file puts to zero."""
    valve = composition.valve
    if name == "viscous_ns_per_m":
        return 0.1 * float(np.sqrt(valve.spring_n_per_m * valve.mass_kg))
    return 0.01 * valve.spring_n_per_m * valve.stroke_m


def strengths(composition: Composition, parameters: Sequence[Parameter], record: Record) -> list[tuple[float, ...]]:
    """Return a grid of values of the parameters, weak to strong, on the scales of the valve and the record."""
    axes = [_axis(composition, each, record) for each in parameters]
    points = list(product(*axes))
    if len(points) > MOST_GRID:
        chosen = np.random.default_rng(0).choice(len(points), MOST_GRID, replace=False)
        points = [points[i] for i in sorted(chosen.tolist())]
    return points


def _axis(composition: Composition, parameter: Parameter, record: Record) -> list[float]:
    weak, strong = _natural(composition, parameter, record)
    least, most = parameter.least, parameter.most
    values = np.geomspace(weak, max(strong, 2.0 * weak), STRENGTHS)
    both = np.concatenate([-values[::-1], values]) if least < 0.0 else values
    inside = both[(both >= least) & (both <= most)].tolist()
    return inside or [most if least <= 0.0 else float(np.sqrt(least * most))]


def _natural(composition: Composition, parameter: Parameter, record: Record) -> tuple[float, float]:
    """Return a weak and a strong value by the unit at the end of the name."""
    valve = composition.valve
    name = parameter.name
    span_m = float(np.ptp(record.position_m[record.judged])) or valve.stroke_m
    span_pa = float(np.ptp(record.command_pa))
    scales = {
        "_n_per_m": (valve.spring_n_per_m, 1e3 * valve.spring_n_per_m),
        "_pa_per_s": (0.05 * span_pa, 50.0 * span_pa),
        "_per_s": (0.01, 10.0),
        "_n": (0.02 * valve.coulomb_n, valve.coulomb_n),
        "_pa": (0.02 * valve.coulomb_n / valve.diaphragm_area_m2, float(np.max(np.abs(record.command_pa)))),
        "_m": (max(record.noise_m, 1e-3 * span_m), span_m),
        "_s": (record.period_s, 0.1 * float(record.time_s[-1] - record.time_s[0])),
        "": (0.01 * max(abs(parameter.least), parameter.most), 0.5 * parameter.most),
    }
    return next(scale for ending, scale in scales.items() if name.endswith(ending))
