"""Health by the hour: one row a valve and hour, written anew every minute until the hour is over."""

from typing import NamedTuple

from config.codes import Ne107Status
from positioner.daemon.health.health_file import HealthRecord
from positioner.history.entries import HealthHour

HOUR_S = 3600


class HealthLook(NamedTuple):
    """What is seen of a valve at a moment; counts of the cycle are since the start."""

    status: Ne107Status
    record: HealthRecord
    friction_pa: float
    cycles: int
    missed_periods: int
    lost_samples: int
    lost_replies: int
    unrecorded: int


class HealthHours:
    """Of one valve, in one thread."""

    def __init__(self, valve: str) -> None:
        self._valve = valve
        self._hour_s = 0
        self._worst = Ne107Status.GOOD

    def row(self, look: HealthLook, now_s: float) -> HealthHour:
        """Return the row of this hour, s since 1970, as it is now."""
        hour_s = int(now_s // HOUR_S) * HOUR_S
        if hour_s != self._hour_s:
            self._hour_s, self._worst = hour_s, Ne107Status.GOOD
        self._worst = max(self._worst, look.status)
        record, baseline_pa = look.record, look.record.baseline_pa
        return HealthHour(
            self._valve,
            hour_s,
            int(self._worst),
            record.travel_m,
            record.reversals,
            record.stiction_index,
            record.moves_judged,
            look.friction_pa,
            float("nan") if baseline_pa is None else baseline_pa,
            look.cycles,
            look.missed_periods,
            look.lost_samples,
            look.lost_replies,
            look.unrecorded,
        )
