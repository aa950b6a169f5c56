"""Between which pressures a stem rests where it is shown, by what is known of its valve: what it is known to need.

    B(x, +1), B(x, -1)      pressures that balance a slide up and down at x: identified, or of the extended valve
    c = (B(x, +1) + B(x, -1))/2,   f = (B(x, +1) - B(x, -1))/2
    f_s = f + min(k m, f/2)                 m shortest slide that has broken it loose, k slope: no more than F_s/A
    tau = k max(2 % of stroke, 3 residuals of the landings)

    rests       c - t f_s - tau <= p <= c + t f_s + tau        t threshold, times what it needs

In a direction in which friction has not been seen it may be three times as much: so much it is with a preload of half
the friction. Where nothing has been identified there is no band: what the valve needs is not known then.
"""

from dataclasses import dataclass
from math import isfinite

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification

STATIC = 0.5
"""Of Coulomb friction: static friction is taken for no more beyond it, where no shorter slide has been seen."""
UNSEEN = 3.0
"""Times the friction of the direction that was seen: the most that is expected in the other."""
NEAR_STROKE_SHARE, RESIDUALS = 0.02, 3.0
"""Of the stroke; of the deviation of landings: by which the balance may be off at a place."""


@dataclass(frozen=True, slots=True)
class RestBand:
    """The band at any place, as long as nothing new is known.

    Attributes:
        ratios: identified.
        landings: that were known when the rest was worked out.
        valve: extended, if there is one.
        beyond_pa: k m, by how much static friction exceeds Coulomb's at the most.
        off_pa: tau.
    """

    ratios: Ratios
    landings: tuple[SlideOutcome, ...]
    valve: ExtendedValve | None
    beyond_pa: float
    off_pa: float

    def pressures_pa(self, position_m: float, threshold: float) -> tuple[float, float]:
        """Return the least and the most under which the stem rests at a position, m."""
        balance = self.ratios.balance_pa if self.valve is None else self.valve.landing_pa
        up_pa, down_pa = balance(position_m, 1), balance(position_m, -1)
        middle_pa, friction_pa = 0.5 * (up_pa + down_pa), max(0.0, 0.5 * (up_pa - down_pa))
        static_pa = threshold * (friction_pa + min(self.beyond_pa, STATIC * friction_pa))
        unseen = self.ratios.directions.unseen
        low_pa, high_pa = (static_pa * (UNSEEN if unseen == each else 1.0) for each in (-1, 1))
        return middle_pa - low_pa - self.off_pa, middle_pa + high_pa + self.off_pa

    @property
    def jump_m(self) -> float:
        """How far the stem jumps at the most when it breaks loose, (F_s - F_c)/k_s."""
        return min(self.beyond_pa, STATIC * -self.ratios.k_over_c) / -self.ratios.b_over_c


def rest_band(
    before: RestBand | None, ratios: Ratios | None, statics: StaticIdentification, stroke_m: float
) -> RestBand | None:
    """Return the band by what is known now; the one before where that is the same. None: it is not known.

    Args:
        before: in the step before.
        ratios: in use.
        statics: landings.
        stroke_m: full travel.
    """
    if ratios is None:
        return None
    if before is not None and before.ratios is ratios and before.landings is statics.landings:
        return before
    slope_pa_per_m, landings = -ratios.b_over_c, statics.landings
    shortest_m = min((abs(each.position_m - each.from_m) for each in landings), default=stroke_m)
    residual_m = statics.law.residual_m if isfinite(statics.law.residual_m) else 0.0
    off_m = max(NEAR_STROKE_SHARE * stroke_m, RESIDUALS * residual_m)
    return RestBand(ratios, landings, statics.valve, slope_pa_per_m * shortest_m, slope_pa_per_m * off_m)
