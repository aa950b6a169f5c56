"""The pressure that lands a slide at a position: the straight law, corrected by the landings near it.

    B(x, s) = κ x + s φ + offset + Σ w_j e_j / (w_0 + Σ w_j)       e_j = p_j - (κ x_j + s φ + offset),  s_j = s
    w_j = exp(-((x_j - x) / h)^2 / 2) ρ^(landings of direction s since j)

Where spring or friction change over the travel no straight law holds, but a slide to x that missed says what is
missing there: the next one lands. w_0 holds the correction back where there is little to go by.
"""

from collections.abc import Callable, Iterable
from math import copysign, exp

from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome

WIDTH = 0.04
"""h, of the stroke."""
FADING = 0.7
"""ρ"""
HELD_BACK = 0.1
"""w_0"""


def ahead_m(each: SlideOutcome, ratios: Ratios, landings: Iterable[SlideOutcome], stroke_m: float) -> float:
    """Return how far a change of the command sends a stem that breaks loose, m, by the balance where it starts from.

    Args:
        each: the change, and where the stem was.
        ratios, landings, stroke_m: as of `landing_pa`.
    """
    ahead_pa = each.command_pa - landing_pa(each.from_m, each.direction, ratios, landings, stroke_m)
    return each.direction * ahead_pa / -ratios.b_over_c


def landing_pa(
    position_m: float, direction: int, ratios: Ratios, landings: Iterable[SlideOutcome], stroke_m: float
) -> float:
    """Return the pressure, Pa, under which a slide up (+1) or down (-1) lands at a position, m.

    Args:
        position_m: where it is to land.
        direction: of the slide.
        ratios: the straight law.
        landings: the latest first.
        stroke_m: full travel.
    """
    landed = (each for each in landings if each.direction == direction)
    missed = missed_pa(position_m, landed, ratios.balance_pa, WIDTH * stroke_m)
    return ratios.balance_pa(position_m, direction) + missed


def missed_pa(
    position_m: float,
    landed: Iterable[SlideOutcome],
    law: Callable[[float, int], float],
    width_m: float,
    least_pa: float = 0.0,
) -> float:
    """Return by what a law misses landings near a position, Pa: the mean of e_j, weighted.

    Args:
        position_m: where.
        landed: all in one direction, the latest first.
        law: the pressure, Pa, at a position, m, in a direction.
        width_m: h.
        least_pa: by which each e_j is brought nearer to 0: less says nothing.
    """
    weighted_pa, weights, age = 0.0, HELD_BACK, 1.0
    for each in landed:
        weight = age * exp(-(((each.position_m - position_m) / width_m) ** 2) / 2)
        missed = each.command_pa - law(each.position_m, each.direction)
        weighted_pa += weight * copysign(max(0.0, abs(missed) - least_pa), missed)
        weights += weight
        age *= FADING
    return weighted_pa / weights
