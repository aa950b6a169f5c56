"""The registers of the alarms: bit n - 1 of each word of bits is cause n of `ne107_cause`."""

from collections.abc import Callable, Mapping

from config.alarm_advice import ADVICE
from config.codes import AlarmState, Ne107Cause
from positioner.control.requests import Requests
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.experiment_registers import WriteRejected
from positioner.daemon.snapshot import Snapshot

Getter = Callable[[Snapshot, Requests], float]
SHOWN = frozenset({AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED})
UNSEEN = frozenset({AlarmState.UNACKNOWLEDGED, AlarmState.RETURNED})


def alarm_getters(alarms: AlarmList) -> dict[str, Getter]:
    """Return, by register, what it serves of the alarms."""

    def bits(states: frozenset[AlarmState]) -> Getter:
        return lambda _s, _r: sum(1 << (cause - 1) for cause, it in alarms.alarms.items() if it.state in states)

    def expires(_s: Snapshot, _r: Requests) -> float:
        return min((it.shelved_until_s for it in alarms.alarms.values() if it.shelved_until_s), default=0.0)

    return {
        "alarm_acknowledge": lambda _s, _r: 0,
        "alarm_shelve": lambda _s, _r: 0,
        "alarm_shelve_time": lambda _s, _r: 0,
        "alarms_active": bits(SHOWN),
        "alarms_unacknowledged": bits(UNSEEN),
        "alarms_shelved": bits(frozenset({AlarmState.SHELVED})),
        "alarms_shelved_until": expires,
    }


def require_alarm(values: Mapping[str, float], longest_s: float) -> None:
    """Require that what is written of the alarms can be obeyed.

    Raises:
        WriteRejected: the cause is no alarm, or it would be shelved for too long.
    """
    for name in ("alarm_acknowledge", "alarm_shelve"):
        if name in values and values[name] not in ADVICE:
            allowed = ", ".join(str(int(each)) for each in ADVICE)
            raise WriteRejected(f"{name}: allowed are {allowed}, got {values[name]:g}")
    if ("alarm_shelve" in values) != ("alarm_shelve_time" in values):
        raise WriteRejected("alarm_shelve: cause and time go in one request")
    if values.get("alarm_shelve_time", 0.0) > longest_s:
        raise WriteRejected(
            f"alarm_shelve_time: allowed is 0 to {longest_s:g} s ([alarms] shelve_limit_s), "
            f"got {values['alarm_shelve_time']:g}",
        )


def obey(values: Mapping[str, float], alarms: AlarmList) -> None:
    """Do what was written of the alarms."""
    if "alarm_acknowledge" in values:
        alarms.acknowledge(Ne107Cause(int(values["alarm_acknowledge"])))
    if "alarm_shelve" in values:
        alarms.shelve(Ne107Cause(int(values["alarm_shelve"])), values["alarm_shelve_time"])
