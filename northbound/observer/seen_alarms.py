"""The alarms of a valve as its registers say them: which hold or were not seen, and what may be done about each."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from config.alarm_advice import ADVICE
from config.codes import AlarmState, Ne107Cause
from northbound.observer.register_words import code_text

BITS = ("alarms_active", "alarms_unacknowledged", "alarms_shelved")
"""Registers whose bit n - 1 is cause n."""
ALARM_READS = (*BITS, "fault")


@dataclass(frozen=True, slots=True)
class SeenAlarm:
    """An alarm that is not normal."""

    cause: Ne107Cause
    state: AlarmState
    text: str
    """Its cause; of a fault in force, which."""

    @property
    def name(self) -> str:
        """By which people acknowledge and shelve it."""
        return self.cause.name.lower()

    @property
    def advice(self) -> str:
        """What somebody does about it."""
        return ADVICE[self.cause]

    @property
    def unseen(self) -> bool:
        """Whether it waits for somebody to acknowledge it."""
        return self.state in (AlarmState.UNACKNOWLEDGED, AlarmState.RETURNED)


def alarms(values: Mapping[str, float]) -> Iterator[SeenAlarm]:
    """Yield the alarms that are not normal, from registers by name; none where those were not read."""
    active, unseen, shelved = (int(values.get(each, 0.0)) for each in BITS)
    for cause in ADVICE:
        bit = 1 << (cause - 1)
        state = _state(bool(active & bit), bool(unseen & bit), bool(shelved & bit))
        if state is not AlarmState.NORMAL:
            faulty = cause is Ne107Cause.FAULT and values.get("fault", 0.0)
            yield SeenAlarm(cause, state, f"fault: {code_text('fault', values['fault'])}" if faulty else cause.text)


def _state(holds: bool, unseen: bool, shelved: bool) -> AlarmState:
    if shelved:
        return AlarmState.SHELVED
    if holds:
        return AlarmState.UNACKNOWLEDGED if unseen else AlarmState.ACKNOWLEDGED
    return AlarmState.RETURNED if unseen else AlarmState.NORMAL
