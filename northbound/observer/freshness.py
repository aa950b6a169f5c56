"""Whether what a daemon said last is still so: from when it was read, the age of its sample, its count of cycles.

What a page shows is of now only while

    the last reading came within READ_WITHIN_S, and none has failed since,
    the count of cycles moved within   limit_s = max(STANDS_AFTER_S, STALE_PERIODS T),
    the age of the last good measurement is at most   limit_s   (else position and pressure alone are old),

T, s, being the period of the daemon's loop. A daemon was started anew when its count fell, or, after the connection
was away, when all it has counted fits into the time that it was away. Time comes in as data.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from positioner.dcs import CYCLES_WRAP

READ_WITHIN_S = 1.0
STANDS_AFTER_S = 1.0
STALE_PERIODS = 3
"""Periods of a slow loop after which one without news counts as standing."""


@dataclass(frozen=True, slots=True)
class Freshness:
    """Why what is shown is not of now, in words; empty where it is."""

    daemon: str = ""
    """Of all that the daemon says."""
    measurement: str = ""
    """Of position and pressure."""

    @property
    def live(self) -> bool:
        """Whether what the daemon says is of now."""
        return not self.daemon

    @property
    def measured_live(self) -> bool:
        """Whether position and pressure are of now."""
        return not self.daemon and not self.measurement


@dataclass(frozen=True, slots=True)
class FreshnessMemory:
    """What is remembered of readings, times in s on a clock that is never set back."""

    read_s: float = -math.inf
    """When the last reading came."""
    failed_s: float = -math.inf
    failure: str = "not connected yet"
    cycles: float | None = None
    moved_s: float = -math.inf
    """When the count of cycles was first seen as it is."""
    period_s: float = 0.0
    sample_age_s: float = math.inf
    restarts: int = 0
    """How often the daemon was started anew while somebody looked."""

    @property
    def limit_s(self) -> float:
        """How long a loop of this period may be without news."""
        return news_within_s(self.period_s)

    @property
    def is_away(self) -> bool:
        """Whether the last request failed."""
        return self.failed_s >= self.read_s


def news_within_s(period_s: float) -> float:
    """Return how long a loop of a period, s, may be without news; NaN is a period that is not known."""
    return max(STANDS_AFTER_S, STALE_PERIODS * period_s) if math.isfinite(period_s) else STANDS_AFTER_S


def after_reading(memory: FreshnessMemory, time_s: float, values: Mapping[str, float]) -> FreshnessMemory:
    """Return what is remembered after a reading of some registers, by name."""
    after = replace(
        memory,
        read_s=time_s,
        period_s=values.get("period", memory.period_s),
        sample_age_s=values.get("sample_age", memory.sample_age_s),
    )
    cycles = values.get("cycles")
    if cycles is None:
        return after
    restarted = memory.cycles is not None and _is_restarted(memory, after.period_s, time_s, cycles)
    if restarted or cycles != memory.cycles:
        after = replace(after, cycles=cycles, moved_s=time_s)
    return replace(after, restarts=memory.restarts + restarted)


def after_failure(memory: FreshnessMemory, time_s: float, failure: str) -> FreshnessMemory:
    """Return what is remembered after a request that was not answered."""
    return replace(memory, failed_s=time_s, failure=failure)


def freshness(memory: FreshnessMemory, now_s: float) -> Freshness:
    """Return whether what was read last is still so."""
    unread_s, stands_s = now_s - memory.read_s, now_s - memory.moved_s
    if memory.is_away:
        since = f"for {unread_s:.0f} s: " if math.isfinite(unread_s) else ""
        return Freshness(f"no connection {since}{memory.failure}" if since else memory.failure)
    if unread_s > READ_WITHIN_S:
        return Freshness(f"the last reading is {unread_s:.1f} s old")
    if stands_s > memory.limit_s:
        return Freshness(f"the daemon's cycle has stood still for {stands_s:.1f} s")
    age_s = memory.sample_age_s + unread_s
    if not age_s <= memory.limit_s:
        old = f"the last good measurement is {age_s:.1f} s old" if math.isfinite(age_s) else "no good measurement yet"
        return Freshness(measurement=old)
    return Freshness()


def _is_restarted(memory: FreshnessMemory, period_s: float, time_s: float, cycles: float) -> bool:
    assert memory.cycles is not None
    ahead = (cycles - memory.cycles) % CYCLES_WRAP
    fell = ahead >= CYCLES_WRAP // 2
    return fell or (memory.is_away and 0 < cycles * period_s <= time_s - memory.read_s)
