"""What the law of slides knows of the valve: where a slide lands, and how margins go over the travel.

    B(x, s)    pressure under which a slide in direction s lands at x            (estimation/landings/local_balance.py;
                                        of an extended valve, [law] valve:        extended_balance.py)
    φ, κ       friction and slope of B, as bent over the travel
    m_s        shortest slide that breaks loose in direction s, (F_s - F_c)/k_s

Where friction grows over the travel its static part grows alike, so m_s goes as φ/κ.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.extended_balance import extended_landing_pa
from positioner.estimation.landings.landing_detector import VISIBLE, SlideOutcome
from positioner.estimation.landings.local_balance import bent_by_pa, landing_pa, scatter_m, sliding_pa
from positioner.estimation.landings.short_slides import ALIKE

KNOWN = 1e-3
"""Of the stroke: how well an extended valve is known."""
SURE = 1.02
"""Factor on a margin that is known: a slide of just that length may hold."""
BESIDE = 0.02
"""Of the stroke, to either side: by what is between, a slope is known."""
FLATTEST = 0.25
"""Of the slope of the straight law, and of its friction: no valve has less of it anywhere."""


@dataclass(frozen=True, slots=True)
class Balance:
    """What the law knows of the valve: the straight law, the landings, and what held the stem; the latest first."""

    ratios: Ratios
    landings: Sequence[SlideOutcome]
    held: Sequence[SlideOutcome]
    stroke_m: float
    valve: ExtendedValve | None = None
    """In place of the straight law, where its effects are known."""
    now_s: float = 0.0
    swing: float = 0.0
    """ρ, share of its way by which the stem swings past its balance (estimation/landings/swing.py)."""

    def slide_pa(self, from_m: float, to_m: float, direction: int) -> float:
        """Return the pressure under which a slide from rest ends at a place, Pa: at its balance, or swung past it."""
        if self.valve is None and not self.swing:
            return sliding_pa(from_m, to_m, direction, self.ratios, self.landings, self.stroke_m)
        return self.pressure_pa(to_m - self.swing * (to_m - from_m) if self.swing else to_m, direction)

    def pressure_pa(self, position_m: float, direction: int) -> float:
        """Return B(x, s), Pa."""
        if self.valve is not None:
            return extended_landing_pa(position_m, direction, self.valve, self.landings, self.now_s)
        return landing_pa(position_m, direction, self.ratios, self.landings, self.stroke_m)

    def way_m(self, each: SlideOutcome) -> float:
        """Return how far a slide would have gone, m, by the balance at the place it starts from."""
        s, from_pa = each.direction, self.pressure_pa(each.from_m, each.direction)
        if self.valve is not None:
            followed_pa = from_pa - self.valve.landing_pa(each.from_m, s)
            return s * (self.valve.lands_m(each.command_pa - followed_pa, s) - each.from_m)
        return s * (each.command_pa - from_pa) / -self.ratios.b_over_c / (1.0 - self.swing)

    def tried(self, way_m: float, direction: int) -> int:
        """Return how many of the last slides that landed in a direction were sent about so far, m."""
        sent_m = (self.way_m(each) for each in self.landings if each.direction == direction)
        return sum(abs(each_m - way_m) < ALIKE * way_m for each_m in sent_m)

    @property
    def stops_m(self) -> tuple[float, float]:
        """The ends of the travel, m, as far as is known."""
        return (0.0, self.stroke_m) if self.valve is None else self.valve.stops_m

    @property
    def scatter_m(self) -> float:
        """How far slides land off the balance, a standard deviation, m."""
        return scatter_m(self.ratios, self.landings, self.stroke_m) if self.valve is None else KNOWN * self.stroke_m

    @property
    def friction_m(self) -> float:
        """F_c/k_s, m."""
        return self.ratios.k_over_c / self.ratios.b_over_c

    def friction_at_m(self, position_m: float) -> float:
        """Return φ/κ at a place, κ of the straight law, m."""
        apart_pa = self._shape_pa(position_m, 1) - self._shape_pa(position_m, -1)
        return max(FLATTEST * self.friction_m, 0.5 * apart_pa / -self.ratios.b_over_c)

    def going_on_m(self, position_m: float, direction: int) -> float:
        """Return what margins of slides that go on are in proportion to, m: m_s of an extended valve, or φ/κ."""
        if self.valve is not None:
            return max(SURE * self.valve.margin_m(position_m, direction), VISIBLE * self.stroke_m)
        there_m = [position_m + each * BESIDE * self.stroke_m for each in (-1, 1)]
        down_pa, up_pa = (sum(self._shape_pa(each, s) for s in (1, -1)) for each in there_m)
        straight_pa = -self.ratios.b_over_c * 4 * BESIDE * self.stroke_m
        return self.friction_at_m(position_m) / max(FLATTEST, (up_pa - down_pa) / straight_pa)

    def grows(self, from_m: float, to_m: float, direction: int) -> float:
        """Return the factor on the margin of a slide that goes on from one place to another, 1: not known."""
        return 1.0 if isnan(to_m) else self.going_on_m(to_m, direction) / self.going_on_m(from_m, direction)

    def _shape_pa(self, position_m: float, direction: int) -> float:
        """Return B as it goes over the travel, Pa, without what only the last landings near a place say."""
        if self.valve is not None:
            return self.valve.landing_pa(position_m, direction)
        bent_pa = bent_by_pa(position_m, direction, self.ratios, self.landings, self.stroke_m)
        return self.ratios.balance_pa(position_m, direction) + bent_pa
