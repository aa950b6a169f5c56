"""Friction as the balance of forces leaves it over, for the measurement and, by the same way, for the model.

    F_f = A p + load - k_s x - m x''        N, at moving samples; viscous friction and missing forces are part of it

p is the measured pressure, or the model's where there is none. x'' comes from local parabolas over nine samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from config.recording import Column
from config.results.result import Brief
from config.valve_file import ValveParameters
from signals.moves import directions
from workbench.compare.residuals import Profile, profile
from workbench.data.motion import PARABOLA_ROWS, acceleration_m_per_s2, velocity_m_per_s


@dataclass(frozen=True, slots=True, repr=False)
class Forces(Brief):
    """Moving samples: when, where, how fast, which way, at what pressure, and the friction, N."""

    time_s: Column
    position_m: Column
    velocity_m_per_s: Column
    direction: Column
    pressure_pa: Column
    friction_n: Column


@dataclass(frozen=True, slots=True, repr=False)
class FrictionBalance(Brief):
    """Mean friction, N, by velocity and by position, opening and closing: pairs of the measured and the model's."""

    over_velocity: tuple[Profile, Profile]
    opening_over_position: tuple[Profile, Profile]
    closing_over_position: tuple[Profile, Profile]


def forces(
    valve: ValveParameters, time_s: Column, position_m: Column, pressure_pa: Column, load_n: Column, noise_m: float
) -> Forces:
    """Reconstruct the friction of an unbroken stretch without NaN, arrays of (n,); none of fewer than nine samples."""
    if time_s.size < PARABOLA_ROWS:
        return Forces(*np.empty((6, 0)))
    velocity = velocity_m_per_s(time_s, position_m)
    period_s = float(np.median(np.diff(time_s)))
    acceleration = acceleration_m_per_s2(position_m, period_s)
    way = directions(position_m, noise_m)
    friction_n = (
        valve.diaphragm_area_m2 * pressure_pa
        + load_n
        - valve.spring_n_per_m * position_m
        - valve.mass_kg * acceleration
    )
    moving = way != 0
    every = (time_s, position_m, velocity, way.astype(np.float64), pressure_pa, friction_n)
    return Forces(*(each[moving] for each in every))


def join_forces(parts: Sequence[Forces]) -> Forces:
    """Return the forces of several stretches as one."""
    return Forces(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Forces)))


def balance(measured: Forces, simulated: Forces) -> FrictionBalance:
    """Set model beside measurement."""
    return FrictionBalance(
        (_over_velocity(measured), _over_velocity(simulated)),
        (_over_position(measured, 1.0), _over_position(simulated, 1.0)),
        (_over_position(measured, -1.0), _over_position(simulated, -1.0)),
    )


def _over_velocity(each: Forces) -> Profile:
    return profile(each.velocity_m_per_s, each.friction_n)


def _over_position(each: Forces, direction: float) -> Profile:
    way = each.direction == direction
    return profile(each.position_m[way], each.friction_n[way])
