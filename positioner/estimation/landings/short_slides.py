"""How much farther a short slide goes than it was sent.

    d     = a + g(a)                      how far a slide goes that is sent a: by the balance of long slides
    g(a)  = Σ v_j g_j / (v_0 + Σ v_j)     g_j = d_j - a_j = -s_j e_j/κ,  e_j by what its pressure lay off the balance
    v_j   = exp(-(log(a_j/a) / h)^2 / 2) ρ^(slides in that direction since j)

Behind a slow I/P a slide creeps into its rest and sticks short of its balance, for friction rises as it comes to an
end. Long slides do so all alike, so a balance taken from them has it. A short one jumps as it breaks loose, and lands
farther by that. It goes by how far a slide was sent: all that are sent a little too short jump to the same place.
"""

from collections.abc import Iterable, Sequence
from math import log
from typing import NamedTuple

from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.mean_nearby import mean_nearby

ALIKE = 0.15
"""h: of the logarithm of a way."""
FADING, HELD_BACK = 0.9, 0.5
"""ρ, v_0"""
HALF, STEPS = 0.5, 6
"""Of the way to a solution, and how many: d rises with a, but may hardly do so."""
LEAST_SENT_SHARE = 0.25
"""Of how far a slide is to go: it is sent no less."""


class Sent(NamedTuple):
    """A slide that landed: how far it was sent, a_j, and how much farther it went, g_j, m."""

    sent_m: float
    beyond_m: float


def sent(slides: Iterable[tuple[SlideOutcome, float]], slope_pa_per_m: float) -> tuple[Sent, ...]:
    """Return how far slides were sent; each is given with what its pressure lay off the balance, e_j, Pa.

    Args:
        slides: in one direction, the latest first; none that went nowhere.
        slope_pa_per_m: κ.
    """
    return tuple(_sent(slide, off_pa, slope_pa_per_m) for slide, off_pa in slides)


def _sent(slide: SlideOutcome, off_pa: float, slope_pa_per_m: float) -> Sent:
    went_m, beyond_m = abs(slide.position_m - slide.from_m), -slide.direction * off_pa / slope_pa_per_m
    return Sent(max(LEAST_SENT_SHARE * went_m, went_m - beyond_m), beyond_m)


def jumped_m(sent_m: float, slides: Sequence[Sent]) -> float:
    """Return g(a) of a slide that is sent a way, m."""
    if sent_m <= 0.0:
        return 0.0
    apart = (log(each.sent_m / sent_m) / ALIKE for each in slides)
    return mean_nearby(apart, (each.beyond_m for each in slides), FADING, HELD_BACK)


def beyond_m(way_m: float, slides: Sequence[Sent]) -> float:
    """Return g of a slide that is to go a way d, m: it is to be sent less by that."""
    sent_m = way_m
    for _ in range(STEPS):
        sent_m = max(LEAST_SENT_SHARE * way_m, sent_m + HALF * (way_m - sent_m - jumped_m(sent_m, slides)))
    return way_m - sent_m
