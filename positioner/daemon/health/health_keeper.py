"""Keeps a valve's health beside the cycle: logs when its status changes, and keeps its counts.

The counts are written a minute after the last time, at once when the baseline or an alarm changed, and at the end: a
crash costs a minute of them at the most.
"""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from config.codes import Ne107Cause, Ne107Status
from config.errors import explain_failure
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.alarms.alarm_states import Alarm
from positioner.daemon.health.health_file import (
    HealthRecord,
    KeptAlarm,
    KeptHealth,
    KeptMore,
    Scales,
    read_record,
    write_record,
)
from positioner.daemon.health.ne107 import Ne107Condition, ne107_condition
from positioner.daemon.health.valve_health import Health
from positioner.daemon.keeping_thread import WRITE_EVERY_CHECKS
from positioner.daemon.logs import log_event, logging_valve
from positioner.daemon.snapshot import Snapshot
from positioner.daemon.sole_daemon import HEALTH, valve_file_path

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StoredHealth:
    """A valve's file, by which scales its pressures are read, and what was in it at the start."""

    path: Path
    scales: Scales
    kept: KeptHealth

    @classmethod
    def in_folder(cls, folder: Path, valve: str, scales: Scales) -> "StoredHealth":
        """Read what is kept of a valve, and make sure that it can be kept again.

        Raises:
            InputError: the file cannot be read or written.
        """
        path = valve_file_path(folder, valve, HEALTH)
        with explain_failure(path, "the health record cannot be kept there"):
            folder.mkdir(parents=True, exist_ok=True)
            kept = read_record(path, valve, scales)
            write_record(path, valve, kept.record, scales, kept.more)
        return cls(path, scales, kept)


class HealthKeeper:
    """Looked at from `start` to `stop`. Without a file it only says when the status changes."""

    def __init__(
        self,
        health: Health,
        seen: Callable[[], Snapshot],
        valve: str,
        stored: StoredHealth | None,
        tell: Callable[[Ne107Condition], None] = lambda _: None,
        alarms: AlarmList | None = None,
    ) -> None:
        self._health = health
        self._seen = seen
        self._alarms = alarms or AlarmList()
        if stored is not None:
            health.watch.begin(stored.kept.more.conditions)
            health.operation.begin(stored.kept.more.days)
            self._alarms.begin(
                {Ne107Cause[name]: Alarm(**dict(each)) for name, each in stored.kept.more.alarms.items()}
            )
        self.valve = valve
        self._file = stored
        self._tell = tell
        self._written = (health.record, self._more)
        self._logged = Ne107Condition(())
        self._failed = False
        self._checks = 0

    def start(self) -> None:
        """Say if what was kept cannot be read, or its baseline is of other scales."""
        if self._file is not None:
            with logging_valve(self.valve):
                _say_of(self._file)

    def stop(self) -> None:
        """Keep the counts."""
        with logging_valve(self.valve):
            self.store(self._health.record)

    def check(self) -> None:
        """Check once: log a new status, and write the counts when it is time."""
        seen = self._seen()
        self._health.look(seen.sample, seen.decision, time.time())
        now = ne107_condition(seen.decision, self._health)
        self._alarms.look(now.causes)
        if now != self._logged:
            self._logged = now
            level = logging.INFO if now.status in (Ne107Status.GOOD, Ne107Status.FUNCTION_CHECK) else logging.WARNING
            causes = [cause.name for cause in now.causes]
            self._tell(now)
            log_event(
                log, level, "health", status=now.status.name, causes=causes, friction_ratio=self._health.friction_ratio
            )
        self._checks += 1
        record = self._health.record
        if self._file is not None and (self._checks % WRITE_EVERY_CHECKS == 0 or self._is_urgent(record)):
            self.store(record)

    def _is_urgent(self, record: HealthRecord) -> bool:
        """Whether something has changed that a crash must not lose: the baseline, or an alarm."""
        before, more = self._written
        return record.baseline_pa != before.baseline_pa or self._more.alarms != more.alarms

    def store(self, record: HealthRecord) -> None:
        """Write a record if it is not the one last written; one line of the log when that fails."""
        more = self._more
        if self._file is None or (record, more) == self._written:
            return
        try:
            write_record(self._file.path, self.valve, record, self._file.scales, more)
        except OSError as error:
            if not self._failed:
                fields = {"file": str(self._file.path), "reason": error.strerror}
                log_event(log, logging.ERROR, "health record cannot be written", **fields)
            self._failed = True
            return
        self._written, self._failed = (record, more), False

    @property
    def _more(self) -> KeptMore:
        kept = {
            cause.name: KeptAlarm(**each._asdict()) for cause, each in self._alarms.alarms.items() if each != Alarm()
        }
        return KeptMore(conditions=self._health.watch.kept, alarms=kept, days=self._health.operation.days)


def _say_of(stored: StoredHealth) -> None:
    """Log what of a file is not gone on with."""
    file, kept = str(stored.path), stored.kept
    if kept.problem is not None:
        fields = {"file": file, "reason": kept.problem}
        log_event(log, logging.WARNING, "health record unreadable, counts start anew", **fields)
    if kept.rescaled is not None:
        reason = f"pressures are read by another scale: {kept.rescaled}"
        log_event(log, logging.WARNING, "friction baseline dropped", file=file, reason=reason)
