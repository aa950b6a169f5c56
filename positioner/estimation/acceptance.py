"""Estimated and applied are two things: a bad identification never replaces a good one.

    applied' = accept(applied, estimated)

The two numbers of the law are taken together: each that was asked for must be valid and not too far from the one in
use, or both stay as they are. Which estimate is too uncertain is said before: of the integrals by `validity`, of a
whole recording by `batch`.

Friction has two numbers, φ_up and φ_down, with preload and unlike packings (`landings.static_law`):

    k/c = -(φ_up + φ_down)/2,    offset = (φ_up - φ_down)/2

A motion one way, s, says φ_s alone. Of a valve of which the other was known before,

    φ'_-s = φ_-s + (φ'_s - φ_s)     a preload stays, friction grows alike; or
    φ'_-s = φ_-s φ'_s/φ_s           all of it grows

and where the two differ by more than 5 % of φ'_s, φ_-s is not known any more. Where nothing was known, φ_-s = φ_s is
a guess. Of a direction that is not known (`Ratios.directions`) the first landing tells it (`unseen_direction`).
"""

from dataclasses import dataclass, replace

from config.codes import Refusal
from positioner.estimation.estimates import Directions, Estimate, Estimates

LARGEST_CHANGE = 4.0
"""Factor by which b/c and k/c may differ from those in use, up or down."""
OPEN = 0.05
"""Of friction: by which that of the other direction may be open."""


@dataclass(frozen=True, slots=True)
class Ratios:
    """What the law needs of the valve: b/c in Pa/m, k/c in Pa, both negative; the offset of the balance in Pa."""

    b_over_c: float
    k_over_c: float
    offset_pa: float = 0.0
    """What preload and unlike friction up and down add to the balance of either direction; 0 in the seed's model."""
    directions: Directions = Directions.BOTH
    """In which friction is known; of another it is a guess."""

    @classmethod
    def of(cls, slope: float, up_pa: float, down_pa: float, directions: Directions = Directions.BOTH) -> "Ratios":
        """Return the ratios of κ, Pa/m, and of φ_up and φ_down, Pa."""
        return cls(-slope, -(up_pa + down_pa) / 2, (up_pa - down_pa) / 2, directions)

    def friction_pa(self, direction: int) -> float:
        """Return φ of a direction, Pa: what moving that way takes beside the spring."""
        return -self.k_over_c + direction * self.offset_pa

    def balance_pa(self, position_m: float, direction: int) -> float:
        """Return the pressure, Pa, that balances a stem moving up (+1) or down (-1) at a position, m: (23), (24)."""
        return -(self.b_over_c * position_m + direction * self.k_over_c) + self.offset_pa


@dataclass(frozen=True, slots=True)
class Applied:
    """What the law uses, and how it came to be.

    Attributes:
        ratios: in use; None before the first identification.
        count: how many identifications were accepted.
        refusals: how many were refused.
        last_refusal: why the last identification was refused; `Refusal.VALID` when it was accepted.
    """

    ratios: Ratios | None = None
    count: int = 0
    refusals: int = 0
    last_refusal: Refusal = Refusal.NOT_STARTED

    def refused(self, reason: Refusal) -> "Applied":
        """Return what is applied after an identification that was refused: the numbers in use."""
        return replace(self, refusals=self.refusals + 1, last_refusal=reason)


def accept(applied: Applied, estimated: Estimates) -> Applied:
    """Return what is applied after an identification: its numbers, or those in use and why."""
    reason = _refusal(applied.ratios, estimated)
    if reason is not Refusal.VALID:
        return applied.refused(reason)
    return Applied(_ratios(applied.ratios, estimated), applied.count + 1, applied.refusals, Refusal.VALID)


def _refusal(ratios: Ratios | None, estimated: Estimates) -> Refusal:
    slope, friction = estimated.b_over_c, estimated.k_over_c
    for each in (slope, friction):
        if not (each.valid or each.reason is Refusal.NOT_ASKED):
            return each.reason
    if not (slope.valid or friction.valid):
        return Refusal.NOT_ASKED
    if ratios is None:
        missing = slope if not slope.valid else friction
        return missing.reason
    if _changes_implausibly(slope, ratios.b_over_c) or _changes_implausibly(friction, ratios.k_over_c):
        return Refusal.IMPLAUSIBLE_CHANGE
    return Refusal.VALID


def _changes_implausibly(new: Estimate, in_use: float) -> bool:
    return new.valid and not 1 / LARGEST_CHANGE <= new.value / in_use <= LARGEST_CHANGE


def _ratios(in_use: Ratios | None, estimated: Estimates) -> Ratios:
    slope, friction, seen = estimated.b_over_c, estimated.k_over_c, estimated.directions
    if in_use is None:
        return Ratios(slope.value, friction.value, directions=seen)
    b_over_c = slope.value if slope.valid else in_use.b_over_c
    if not friction.valid:
        return replace(in_use, b_over_c=b_over_c)
    if seen is Directions.BOTH:
        return Ratios(b_over_c, friction.value)
    return _grown(replace(in_use, b_over_c=b_over_c), -friction.value, seen)


def _grown(in_use: Ratios, friction_pa: float, seen: Directions) -> Ratios:
    """Return ratios with the friction of one direction, Pa, and what that says of the other."""
    s, slope = seen.value, -in_use.b_over_c
    before_pa, other_pa = in_use.friction_pa(s), in_use.friction_pa(-s)
    directions = Directions.BOTH
    if in_use.directions.unseen == -s:
        directions, other_pa = seen, friction_pa
    elif in_use.directions is Directions.BOTH:
        grown_pa = friction_pa - before_pa
        if abs(grown_pa * (before_pa - other_pa)) > OPEN * friction_pa * abs(before_pa):
            directions = seen
        other_pa += grown_pa
    if friction_pa + other_pa <= 0.0:  # no valve's: the preload is another
        directions, other_pa = seen, friction_pa
    up_pa, down_pa = (friction_pa, other_pa) if s > 0 else (other_pa, friction_pa)
    return Ratios.of(slope, up_pa, down_pa, directions)
