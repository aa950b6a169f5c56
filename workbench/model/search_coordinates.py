"""The parameters of a fit and the coordinates in which they are searched.

z = log p                     a parameter that is positive throughout
z = log(F_s / F_c) >= 0       static friction: never below Coulomb friction
z = asinh(p / s)              a parameter that may be zero or negative, s = half of what is barely visible
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import asinh, exp, log, sinh

import numpy as np

from config.errors import InputError
from config.valve_file import ValveParameters
from sim.composition import BASE, COULOMB, STATIC, Composition
from sim.effect import Guess
from sim.karnopp import Vector

DEFAULT = ("spring_n_per_m", "viscous_ns_per_m", "coulomb_n", "static_n")
"""What is free of the base model by default. A is fixed: pressure and position give only ratios of forces."""
AT_REST, LANDED = ("spring_n_per_m", "coulomb_n", "static_n"), ("spring_n_per_m", "coulomb_n")
"""The same where the stem has no inertia, and where only its landings are judged."""
BEHIND_POSITIONER = ("coulomb_n", "static_n")
"""The same behind a positioner, of which no pressure is known: pressures are known up to a factor, so that the spring
stays as the valve file has it, and viscous friction with it, which the positioner's ramps hide."""
FACTOR = 50.0
"""A base parameter is sought within this factor of the valve file's, and of where it was fitted without an effect."""
MOST_STATIC = 5.0
"""F_s / F_c at most."""
MOST_GRID = 48


@dataclass(frozen=True, slots=True)
class Parameter:
    """A free parameter: where it stands in theta, and its physical range."""

    name: str
    index: int
    least: float
    most: float
    starts: tuple[float, ...] = ()
    """Where a fit may begin, as an effect declares it."""
    guess: Guess = ""
    """What the record's positions suggest for it, as an effect declares it."""

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
            value = exp(z) if self.least > 0 else self.scale * sinh(z)
            theta[self.index] = min(max(value, self.least), self.most)  # at the end of the range rounding may leave it

    @property
    def scale(self) -> float:
        """s: half of what is barely visible; without starts, a hundredth of the range."""
        visible = [abs(start) for start in self.starts if start]
        return 0.5 * min(visible) if visible else 0.01 * max(abs(self.least), abs(self.most))

    @property
    def bounds(self) -> tuple[float, float]:
        """The range of z."""
        if self.index == STATIC or self.least > 0:
            return log(self.least), log(self.most)
        return asinh(self.least / self.scale), asinh(self.most / self.scale)


def free_parameters(
    composition: Composition,
    free: Sequence[str],
    scale: ValveParameters | None = None,
    known: ValveParameters | None = None,
) -> tuple[Parameter, ...]:
    """Return the named parameters, Coulomb before static friction.

    Args:
        composition: the valve.
        free: names.
        scale: of what the effects' starts are in units, by default the composition's valve.
        known: the valve file's, by default the composition's valve. What was fitted without an effect may be far from
            what it is beside it: base parameters are sought about both.

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
    unit, known = scale or composition.valve, known or composition.valve
    return tuple(_parameter(composition, names.index(name), unit, known) for name in names if name in free)


def _parameter(composition: Composition, index: int, scale: ValveParameters, known: ValveParameters) -> Parameter:
    name = composition.names[index]
    if index == STATIC:
        return Parameter(name, index, 1.0, MOST_STATIC)
    if index < len(BASE):
        value = float(composition.theta[index]) or _smallest(composition, name)
        if value == 0.0:
            problem = f"{name} is 0 on a drive without spring: it must be more than 0 for a fit to begin from"
            raise InputError(composition.source, problem)
        about = value, getattr(known, name) or value
        return Parameter(name, index, min(about) / FACTOR, max(about) * FACTOR)
    effect, _, key = name.partition(".")
    declared = next(each for each in composition.effects if each.name == effect).parameters[key]
    starts = declared.starts_for(scale)
    return Parameter(name, index, declared.least, declared.most, starts, declared.guess)


def _smallest(composition: Composition, name: str) -> float:
    """Return where to begin with a friction that the valve file puts to zero."""
    valve = composition.valve
    if name == "viscous_ns_per_m":
        return 0.1 * float(np.sqrt(valve.spring_n_per_m * valve.mass_kg))
    return 0.01 * valve.spring_n_per_m * valve.stroke_m


def strengths(parameters: Sequence[Parameter]) -> list[tuple[float, ...]]:
    """Return the grid of values of the parameters, weak to strong, from which their effects declare a fit may begin."""
    points = list(product(*(each.starts for each in parameters)))
    if len(points) > MOST_GRID:
        chosen = np.random.default_rng(0).choice(len(points), MOST_GRID, replace=False)
        points = [points[i] for i in sorted(chosen.tolist())]
    return points
