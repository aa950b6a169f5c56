"""Estimated and applied are two things: a bad identification never replaces a good one.

    applied' = accept(applied, estimated)

The two numbers of the law are taken together: each that was asked for must be valid and not too far from the one in
use, or both stay as they are.
"""

from dataclasses import dataclass, replace

from config.codes import Refusal
from positioner.estimation.estimates import Estimate, Estimates

LARGEST_CHANGE = 4.0
"""Factor by which b/c and k/c may differ from those in use, up or down."""


@dataclass(frozen=True, slots=True)
class Ratios:
    """What the law needs of the valve: b/c in Pa/m, k/c in Pa, both negative; the offset of the balance in Pa."""

    b_over_c: float
    k_over_c: float
    offset_pa: float = 0.0
    """What preload and unlike friction up and down add to the balance of either direction; 0 in the seed's model."""

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
    slope, friction = estimated.b_over_c, estimated.k_over_c
    if in_use is None or estimated.law_ready:
        return Ratios(slope.value, friction.value)
    return Ratios(slope.value, in_use.k_over_c) if slope.valid else Ratios(in_use.b_over_c, friction.value)
