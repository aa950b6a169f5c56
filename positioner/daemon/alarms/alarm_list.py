"""The alarms of one valve: each cause that somebody must do something about, with its state and its journal.

Looked at once a second beside the cycle; acknowledged and shelved by clients. The journal is the valve's history.
"""

import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from threading import Lock

from config.alarm_advice import ADVICE
from config.alarm_table import BY_SUPERVISION
from config.codes import AlarmState, EventKind, Ne107Cause, Ne107Status
from positioner.daemon.alarms.alarm_states import Alarm

JOURNALED_ELSEWHERE = BY_SUPERVISION
"""The cycle tells the history itself when these are raised and over."""
Tell = Callable[[EventKind, Ne107Status, Ne107Cause], None]
"""Takes what goes into the journal."""


class AlarmList:
    """Thread-safe; no lock is held while anybody is told.

    Args:
        tell: takes what goes into the journal.
        class_of: of a cause.
        now_s: the time, s since 1970.
    """

    def __init__(
        self,
        tell: Tell = lambda *_: None,
        class_of: Callable[[Ne107Cause], Ne107Status] = lambda _: Ne107Status.GOOD,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._tell, self._class_of, self._now_s = tell, class_of, now_s
        self._lock = Lock()
        self._holding: frozenset[Ne107Cause] | None = None
        self._alarms: Mapping[Ne107Cause, Alarm] = dict.fromkeys(ADVICE, Alarm())

    @property
    def alarms(self) -> Mapping[Ne107Cause, Alarm]:
        """Each alarm by its cause; replaced whole."""
        return self._alarms

    def begin(self, kept: Mapping[Ne107Cause, Alarm]) -> None:
        """Go on with what was kept over a restart."""
        self._alarms = {**self._alarms, **kept}

    def look(self, causes: Collection[Ne107Cause]) -> None:
        """Take which causes hold now."""
        holding = frozenset(causes)
        if holding == self._holding and not any(each.shelved_until_s for each in self._alarms.values()):
            return
        self._holding, now_s = holding, self._now_s()
        self._change({cause: partial(Alarm.after, now_s=now_s, holds=cause in causes) for cause in ADVICE})

    def acknowledge(self, cause: Ne107Cause) -> None:
        """Somebody has seen it."""
        self._change({cause: Alarm.acknowledge}, EventKind.ALARM_ACKNOWLEDGED)

    def shelve(self, cause: Ne107Cause, for_s: float) -> None:
        """Put an alarm aside for a while, s; 0: show it again."""
        until_s = self._now_s() + for_s
        if for_s == 0.0:
            self._change({cause: Alarm.unshelved})
        else:
            self._change({cause: lambda it: it.shelved(until_s)}, EventKind.ALARM_SHELVED)

    def _change(self, by: Mapping[Ne107Cause, Callable[[Alarm], Alarm]], what: EventKind | None = None) -> None:
        with self._lock:
            before = self._alarms
            after = {cause: change(before[cause]) for cause, change in by.items()}
            changed = {cause: each for cause, each in after.items() if each != before[cause]}
            if changed:
                self._alarms = {**before, **changed}
        for cause, each in changed.items():
            for kind in _kinds(before[cause], each, what):
                if kind not in (EventKind.ALARM_RAISED, EventKind.ALARM_RETURNED) or cause not in JOURNALED_ELSEWHERE:
                    raised = kind is EventKind.ALARM_RAISED
                    self._tell(kind, self._class_of(cause) if raised else Ne107Status.GOOD, cause)


def _kinds(before: Alarm, after: Alarm, what: EventKind | None) -> list[EventKind]:
    """Return what of a change goes into the journal."""
    kinds = [] if what is None else [what]
    if before.state is AlarmState.SHELVED and after.state is not AlarmState.SHELVED:
        kinds.append(EventKind.ALARM_UNSHELVED)
    if before.holds != after.holds:
        kinds.append(EventKind.ALARM_RAISED if after.holds else EventKind.ALARM_RETURNED)
    return kinds
