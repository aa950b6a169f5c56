"""Alarms of friction too high, friction too low and missed moves, by tests that keep a promise (`e_detector`).

    friction    an identification's F_c with its deviation, against the limits of [health] times its baseline
    stiction    each move that was asked for, made or missed, against [health] stiction_limit

The baseline is taken in `valve_health`. A test raises the alarm. It is over when the figure is back within its limit:
friction by the next identification, stiction by the index over the last moves. An identification counts an hour after
the one before it at the earliest, and the first after a start as if an hour had passed.
"""

from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple

from config.codes import Ne107Cause
from positioner.daemon.health.e_detector import EDetector, of_a_mean, of_a_share

TESTS = 3
"""That share a promise: friction high, friction low, stiction."""
HOUR_S = 3600.0
EXCESS_BETS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Deviations."""
MISSED_BETS = (0.25, 0.5, 0.75, 0.9, 0.99)
"""Of the way from the limit to 1."""
LEAST_DEVIATION = 0.01
"""Of the friction: no identification is trusted more."""
UNKNOWN_DEVIATION = 0.1
"""Of the friction, where nobody has said."""


class FoundFriction(NamedTuple):
    """What an identification found, Pa; its deviation NaN where that is not known."""

    friction_pa: float
    std_pa: float

    @property
    def deviation_pa(self) -> float:
        """How sure it is taken to be."""
        known_pa = self.std_pa if isfinite(self.std_pa) else UNKNOWN_DEVIATION * self.friction_pa
        return max(known_pa, LEAST_DEVIATION * self.friction_pa)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionLimits:
    """Limits of friction over its baseline, and of the share of moves missed; 0: none. The promise in years."""

    friction_high: float
    friction_low: float
    stiction_limit: float
    false_alarm_years: float


class FrictionAlarms:
    """All three alarms, in the thread that looks once a second."""

    def __init__(self, limits: FrictionLimits) -> None:
        self._limits = limits
        years = TESTS * limits.false_alarm_years
        self._high, self._low = (EDetector(years, len(EXCESS_BETS)) for _ in range(2))
        self._missed = EDetector(years, len(MISSED_BETS))
        self._raised: frozenset[Ne107Cause] = frozenset()
        self._found: FoundFriction | None = None
        self._found_s = self._moves_s = inf
        self._moves = (0, 0)
        self._baseline_pa = nan

    def begin(self, raised: frozenset[Ne107Cause]) -> None:
        """Go on with what was raised before a restart."""
        self._raised = raised

    def look(
        self,
        now_s: float,
        found: FoundFriction | None,
        baseline_pa: float,
        moves: tuple[int, int],
        stiction_index: float,
    ) -> frozenset[Ne107Cause]:
        """Return which alarms hold.

        Args:
            now_s: on a clock that never goes back.
            found: by the last identification after that of the baseline; None before there was one.
            baseline_pa: the friction that is called normal; NaN: none.
            moves: asked for, and missed, since the start.
            stiction_index: the share missed of the last.
        """
        self._moves_s = min(self._moves_s, now_s)
        if isfinite(self._baseline_pa) and baseline_pa != self._baseline_pa:
            self._raised -= {Ne107Cause.FRICTION_HIGH, Ne107Cause.FRICTION_LOW}
            self._high.restart()
            self._low.restart()
        self._baseline_pa = baseline_pa
        if found is not None and isfinite(baseline_pa):
            self._friction(now_s, found, baseline_pa)
        self._stiction(now_s, moves, stiction_index)
        return self._raised

    def _friction(self, now_s: float, found: FoundFriction, baseline_pa: float) -> None:
        due = self._found is None or now_s - self._found_s >= HOUR_S
        new = found is not self._found and due
        lasted_s = max(now_s - self._found_s, HOUR_S)
        if new:
            self._found, self._found_s = found, now_s
        for cause, limit, sign, test in (
            (Ne107Cause.FRICTION_HIGH, self._limits.friction_high, 1.0, self._high),
            (Ne107Cause.FRICTION_LOW, self._limits.friction_low, -1.0, self._low),
        ):
            excess_pa = sign * (found.friction_pa - limit * baseline_pa)
            beyond = limit > 0.0 and excess_pa > 0.0
            raised = limit > 0.0 and new and test.enter(of_a_mean(excess_pa, found.deviation_pa, EXCESS_BETS), lasted_s)
            self._set(cause, raised=raised and beyond, holds=beyond)

    def _stiction(self, now_s: float, moves: tuple[int, int], stiction_index: float) -> None:
        limit, new = self._limits.stiction_limit, moves[0] - self._moves[0]
        raised = False
        if new > 0 and 0.0 < limit < 1.0:
            bad = moves[1] - self._moves[1]
            bets = [limit + each * (1.0 - limit) for each in MISSED_BETS]
            raised = self._missed.enter(of_a_share(bad, new - bad, limit, bets), now_s - self._moves_s)
            self._moves_s = now_s
        self._moves = moves
        beyond = limit > 0.0 and stiction_index > limit
        self._set(Ne107Cause.STICTION, raised=raised and beyond, holds=beyond)

    def _set(self, cause: Ne107Cause, *, raised: bool, holds: bool) -> None:
        if raised:
            self._raised |= {cause}
        elif not holds:
            self._raised -= {cause}
