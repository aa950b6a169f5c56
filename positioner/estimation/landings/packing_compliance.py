"""How far the packing of a stuck stem gives way: its compliance, from changes of the command that held.

    Δx = c Δp         c = A/(k_s + k_p), k_p the packing's stiffness: less than 1/κ = A/k_s
    c  = Σ w_j Δx_j Δp_j / Σ w_j Δp_j^2,     w_j = ρ^j,  j = 0 the latest in that direction
    σ  = sqrt(Σ w_j (Δx_j - c Δp_j)^2 / Σ w_j) beside the changes' own deviations

A packing is no spring: it gives way less at first, and more near break-away. So what is asked of it is asked by steps,
each with the c of the last ones; σ says how far the next may lie off. A stiff packing has no c.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

from positioner.estimation.landings.landing_detector import SlideOutcome

FADING, LATEST_CHANGES = 0.5, 6
"""ρ, and how many changes count."""
SURE = 3.0
"""Deviations of the way beyond which the packing has given way at all."""
EXPLAINED = 1.5
"""Times the way that the packing gives: what went no farther was not broken loose."""


class Compliance(NamedTuple):
    """c, m/Pa, and how far a change may lie off it, as a share of its way."""

    m_per_pa: float
    spread: float

    def explains(self, change: SlideOutcome) -> bool:
        """Whether what a change of the command did is no more than the packing giving way."""
        if change.from_pa is None:
            return False
        gives_m = self.m_per_pa * abs(change.command_pa - change.from_pa)
        return abs(change.position_m - change.from_m) <= EXPLAINED * gives_m


@lru_cache(maxsize=8)
def compliance(held: Sequence[SlideOutcome], direction: int) -> Compliance | None:
    """Return how a packing gives way in a direction; None: it is stiff, or nothing says.

    Args:
        held: changes that did not break the stem loose, the latest first.
        direction: +1 up, -1 down.
    """
    changes = [
        (each.position_m - each.from_m, each.command_pa - each.from_pa, each.std_m)
        for each in held
        if each.direction == direction and each.from_pa is not None and each.command_pa != each.from_pa
    ][:LATEST_CHANGES]
    if not changes:
        return None
    weights = [FADING**age for age in range(len(changes))]
    squares = sum(w * dp * dp for w, (_, dp, _) in zip(weights, changes, strict=True))
    c = sum(w * dx * dp for w, (dx, dp, _) in zip(weights, changes, strict=True)) / squares
    way_m = sqrt(sum(w * dx * dx for w, (dx, _, _) in zip(weights, changes, strict=True)) / sum(weights))
    known_m = sqrt(2.0 * sum(w * std * std for w, (_, _, std) in zip(weights, changes, strict=True)) / sum(weights))
    if c <= 0.0 or way_m <= SURE * known_m:
        return None
    off = sum(w * ((dx - c * dp) ** 2) for w, (dx, dp, _) in zip(weights, changes, strict=True)) / sum(weights)
    return Compliance(c, sqrt(off) / way_m)
