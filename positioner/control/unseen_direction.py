"""The first landing in a direction whose friction nobody has seen: by steps, whichever law commands before and after.

An excitation that moves the stem one way says nothing of friction the other way, be it a preload or an unlike packing
(`estimation/acceptance.py`). What a law would command in that direction is a guess. Where the stem might follow it,

    d (p_law - p) > κ h / 2,    d (p_law - B(x, -d)) > 0

the pressure goes that way in steps in its place, each once the stem rests under the one before:

    p' = p + d κ max(h, λ d (r - x))

p pressure in force, d direction, B balance (`Ratios.balance_pa`), κ = k_s/A, h = 1 % of stroke, λ = 0.4, r - x the way
that is left. The stem breaks loose under a pressure that is at most one step beyond what it needs, so
that it slides by its own jump and 0.4 of its way at the most.
Where it lands φ_d = d (p - κ x) is known, and the law commands on from there; or from where a new reference asks the
stem back the way that is known.
"""

from positioner.control.laws.boundary import Seen
from positioner.estimation.acceptance import Ratios

LEAST_STEP = 0.01
"""h as a share of the stroke: a slide of twice what is seen for one (`landing_detector.VISIBLE`)."""
SHARE = 0.4
"""λ."""


def needed(seen: Seen, ratios: Ratios, asked_pa: float, stroke_m: float) -> bool:
    """Return whether a stem might slide in the direction that was not seen by what a law asks for, Pa.

    Args:
        seen: of the stem, and the pressure in force.
        ratios: in use.
        asked_pa: by the law.
        stroke_m: full travel.
    """
    d, visible_pa = ratios.directions.unseen, -ratios.b_over_c * LEAST_STEP * stroke_m / 2
    over_pa = d * (asked_pa - ratios.balance_pa(seen.sample.position_m, -d))
    return d * (asked_pa - seen.command_pa) > visible_pa and over_pa > 0.0


def stepped_pa(pressure_pa: float, direction: int, ratios: Ratios, way_m: float, stroke_m: float) -> float:
    """Return the next pressure, Pa, for a stem that rests under one.

    >>> stepped_pa(60e3, -1, Ratios(-8e5, -2e4), way_m=-0.03, stroke_m=0.1)
    50400.0
    """
    step_m = max(LEAST_STEP * stroke_m, SHARE * direction * way_m)
    return pressure_pa - direction * ratios.b_over_c * step_m
