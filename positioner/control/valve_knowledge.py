"""What the controller knows of its valve, as data: taken from it to be kept, given to it after a restart.

Times of what was seen are negative after a restart, seconds before what was kept was taken: older than anything new.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf, isfinite, sqrt

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Directions, Estimate, Estimates
from positioner.estimation.landings.breakaway_distance import BreakawayDistance
from positioner.estimation.landings.change_point import FINEST
from positioner.estimation.landings.extended_balance import extended_scatter_m
from positioner.estimation.landings.landing_detector import Answers, SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification

Covariance = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]

LARGEST_STD = 0.05
"""Of κ and φ: the deviation of what was applied, where nobody knows it any more."""
UNANSWERED = Answers()
NO_DOUBT: Covariance = ((0.0, 0.0, 0.0),) * 3
OTHER_WAY, UNSEEN = 0.2, 1.0
"""Of φ: what a sine, which moves the stem one way, leaves open of the other, after a landing there and before."""


@dataclass(frozen=True, slots=True)
class ValveKnowledge:
    """What is known of a valve, SI units.

    Attributes:
        ratios: that the law uses.
        covariance: of (κ, φ_up, φ_down), Pa/m and Pa.
        residual_m: how far landings lie off these, a standard deviation.
        landings, held: slides that landed and changes of the command that moved nothing, the latest first.
        answers: how long the stem takes to answer.
        distances: to break loose, as slides have taught.
        tracked: what else is followed, by name, for whoever knows the name.
    """

    ratios: Ratios
    covariance: Covariance
    residual_m: float
    landings: tuple[SlideOutcome, ...] = ()
    held: tuple[SlideOutcome, ...] = ()
    answers: Answers = UNANSWERED
    distances: BreakawayDistance | None = None
    tracked: Mapping[str, float] = field(default_factory=dict)

    def landing_m(self, command_pa: float, direction: int) -> float:
        """Return where a slide up (+1) or down (-1) lands under a pressure, m, by the straight law."""
        return (command_pa - self.ratios.balance_pa(0.0, direction)) / -self.ratios.b_over_c

    def deviation_m(self, position_m: float, direction: int) -> float:
        """Return the standard deviation of where a slide lands at a position, m."""
        row = (position_m, float(direction > 0), -float(direction < 0))
        variance = sum(row[i] * self.covariance[i][j] * row[j] for i in range(3) for j in range(3))
        return sqrt(max(0.0, variance) / self.ratios.b_over_c**2 + self.residual_m**2)

    @property
    def friction_m(self) -> float:
        """F_c/k_s, m."""
        return self.ratios.k_over_c / self.ratios.b_over_c

    def shortest_m(self, direction: int) -> float:
        """Return the shortest slide that breaks loose in a direction as far as is known, m: no more than friction."""
        if self.distances is not None and (way_m := self.distances.at(direction, turning=True).likely_m) < inf:
            return way_m
        slid_m = (abs(each.position_m - each.from_m) for each in self.landings if each.direction == direction)
        return min(slid_m, default=self.friction_m)

    def aged(self, now_s: float) -> "ValveKnowledge":
        """Return it with the times of a controller that will have been started anew."""
        return replace(self, landings=_before(self.landings, now_s), held=_before(self.held, now_s))


def known(
    ratios: Ratios, estimates: Estimates, statics: StaticIdentification, stroke_m: float, valve: ExtendedValve | None
) -> ValveKnowledge:
    """Return what a controller knows of its valve; what its law has learnt is for the law to add.

    Args:
        ratios: in use.
        estimates: from motions, the latest.
        statics: from landings.
        stroke_m: full travel.
        valve: the extended valve that the law works with, if there is one: its shape is given, so landings alone say
            how far it is off.
    """
    static_law = statics.law
    residual_m, covariance = FINEST * stroke_m, NO_DOUBT
    if valve is not None:
        residual_m = max(residual_m, extended_scatter_m(valve, statics.landings))
    elif static_law.valid:
        residual_m, covariance = static_law.residual_m, _rows(static_law.covariance.tolist())
    else:
        covariance = _covariance(ratios, estimates)
    return ValveKnowledge(
        ratios=ratios,
        covariance=covariance,
        residual_m=residual_m,
        landings=statics.landings,
        held=statics.held,
        answers=statics.detector.answers,
    )


def _before(outcomes: tuple[SlideOutcome, ...], now_s: float) -> tuple[SlideOutcome, ...]:
    return tuple(each._replace(time_s=min(0.0, each.time_s - now_s)) for each in outcomes)


def _covariance(ratios: Ratios, estimates: Estimates) -> Covariance:
    """Return the covariance of (κ, φ_up, φ_down) where they come from a motion one way, and no landing tells more."""
    slope, seen = _std(estimates.b_over_c, ratios.b_over_c), estimates.directions
    friction = _std(estimates.k_over_c, ratios.k_over_c)
    other = (UNSEEN if ratios.directions.unseen else OTHER_WAY) * ratios.k_over_c
    up, down = (other, friction) if seen is Directions.DOWN else (friction, other)
    return (slope**2, 0.0, 0.0), (0.0, up**2, 0.0), (0.0, 0.0, down**2)


def _std(estimate: Estimate, value: float) -> float:
    return estimate.std if estimate.valid and isfinite(estimate.std) else LARGEST_STD * abs(value)


def _rows(rows: list[list[float]]) -> Covariance:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return (a, b, c), (d, e, f), (g, h, i)
