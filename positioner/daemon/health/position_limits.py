"""Limits of the opening, each with a dead band and a delay.

high:  raised when h > h_l for its delay;  over when h < h_l - b
low:   raised when h < h_l for its delay;  over when h > h_l + b
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite

from config.alarm_table import AlarmsTable, PositionLimit
from config.codes import Ne107Cause

SIDES = {Ne107Cause.HIGH_HIGH: 1, Ne107Cause.HIGH: 1, Ne107Cause.LOW: -1, Ne107Cause.LOW_LOW: -1}
"""Whether the opening is too high or too low."""


@dataclass(frozen=True, slots=True)
class PositionLimits:
    """Those that are watched, since when each is passed, s, and those that are raised."""

    limits: Mapping[Ne107Cause, PositionLimit]
    since_s: Mapping[Ne107Cause, float]
    raised: frozenset[Ne107Cause] = frozenset()

    @classmethod
    def of(cls, table: AlarmsTable) -> "PositionLimits":
        """Return the limits of table `[alarms]`."""
        each: dict[Ne107Cause, PositionLimit] = {cause: getattr(table, cause.name.lower()) for cause in SIDES}
        watched = {cause: limit for cause, limit in each.items() if limit.threshold is not None}
        return cls(watched, dict.fromkeys(watched, inf))

    def after(self, now_s: float, opening: float) -> "PositionLimits":
        """Return what is raised after an opening was looked at; one that is no number changes nothing."""
        if not self.limits or not isfinite(opening):
            return self
        since_s, raised = {}, set()
        for cause, limit in self.limits.items():
            assert limit.threshold is not None
            beyond = SIDES[cause] * (opening - limit.threshold)
            since_s[cause] = min(self.since_s[cause], now_s) if beyond > 0.0 else inf
            if now_s - since_s[cause] >= limit.delay_s or (cause in self.raised and beyond >= -limit.dead_band):
                raised.add(cause)
        return PositionLimits(self.limits, since_s, frozenset(raised))
