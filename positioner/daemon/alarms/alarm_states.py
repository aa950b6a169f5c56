"""One alarm, by ISA-18.2: a condition that holds or does not, seen by somebody or not, shelved for a while or not.

    normal           -- it holds -->       unacknowledged
    unacknowledged   -- acknowledged -->   acknowledged      -- it is over -->     normal
    unacknowledged   -- it is over -->     returned          -- acknowledged -->   normal
    returned         -- it holds -->       unacknowledged
    any              -- shelved -->        shelved           -- its time is over, or unshelved -->  what holds then

A shelved alarm is followed but not shown. Its time is as asked, at most `[alarms] shelve_limit_s` (`alarm_table`); one
that holds then is unacknowledged.
"""

from typing import NamedTuple

from config.codes import AlarmState


class Alarm(NamedTuple):
    """An alarm; times in s since 1970."""

    holds: bool = False
    acknowledged: bool = True
    since_s: float = 0.0
    """When it was last raised or returned."""
    shelved_until_s: float = 0.0
    """0: it is not shelved."""

    @property
    def state(self) -> AlarmState:
        """Its state."""
        if self.shelved_until_s > 0.0:
            return AlarmState.SHELVED
        if self.holds:
            return AlarmState.ACKNOWLEDGED if self.acknowledged else AlarmState.UNACKNOWLEDGED
        return AlarmState.NORMAL if self.acknowledged else AlarmState.RETURNED

    def after(self, now_s: float, *, holds: bool) -> "Alarm":
        """Return the alarm after its condition was looked at."""
        alarm = self
        if holds != alarm.holds:
            alarm = alarm._replace(holds=holds, acknowledged=alarm.acknowledged and not holds, since_s=now_s)
        return alarm.unshelved() if 0.0 < alarm.shelved_until_s <= now_s else alarm

    def acknowledge(self) -> "Alarm":
        """Return it as seen by somebody."""
        return self if self.acknowledged else self._replace(acknowledged=True)

    def shelved(self, until_s: float) -> "Alarm":
        """Return it put aside until a time."""
        return self._replace(shelved_until_s=until_s)

    def unshelved(self) -> "Alarm":
        """Return it as it is when it is shown again: unacknowledged if it holds."""
        return self._replace(shelved_until_s=0.0, acknowledged=not self.holds)
