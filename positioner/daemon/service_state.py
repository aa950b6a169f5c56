"""What the service does for a valve, beside the states S0 to S3 of its law: a state machine, declared as its table.

The state is a function of what the last cycle decided; the table says which transitions that makes. Both are tested
against each other on the controller, every cell. `docs/reliability.md` shows the table.
"""

from enum import StrEnum

from config.codes import Fault, Mode, ServiceState
from positioner.control.controller_memory import Decision
from positioner.control.supervision import Limits


class ServiceEvent(StrEnum):
    """What may change the state."""

    MEASURED = "the first good measurement"
    COMMANDED = "mode manual or automatic is written"
    HELD = "mode hold is written"
    FAULT_HOLDS = "a fault whose action is hold"
    FAULT_SAFE = "a fault whose action is vent, fill or safe"
    FAULT_MANUAL = "a fault whose action is manual"
    ACKNOWLEDGED = "acknowledged, the cause gone"
    ENDED = "a signal, or a thread that died"


_FAULTS = {
    ServiceEvent.FAULT_HOLDS: ServiceState.FAULT_HOLD,
    ServiceEvent.FAULT_SAFE: ServiceState.FAULT_SAFE,
    ServiceEvent.FAULT_MANUAL: ServiceState.FAULT_HOLD,
}
"""In mode hold, as all but active and fault-manual are, nobody commands by hand before the mode is written."""
_BY_HAND = {ServiceEvent.FAULT_MANUAL: ServiceState.FAULT_MANUAL}
_END = {ServiceEvent.ENDED: ServiceState.STOPPED}

TRANSITIONS: dict[ServiceState, dict[ServiceEvent, ServiceState]] = {
    ServiceState.STARTING: {ServiceEvent.MEASURED: ServiceState.STANDBY, **_FAULTS, **_END},
    ServiceState.SHADOW: _END,
    ServiceState.STANDBY: {ServiceEvent.COMMANDED: ServiceState.ACTIVE, **_FAULTS, **_END},
    ServiceState.ACTIVE: {ServiceEvent.HELD: ServiceState.STANDBY, **_FAULTS, **_BY_HAND, **_END},
    ServiceState.FAULT_HOLD: {ServiceEvent.ACKNOWLEDGED: ServiceState.STANDBY, **_FAULTS, **_END},
    ServiceState.FAULT_SAFE: {ServiceEvent.ACKNOWLEDGED: ServiceState.STANDBY, **_FAULTS, **_END},
    ServiceState.FAULT_MANUAL: {
        ServiceEvent.HELD: ServiceState.FAULT_HOLD,
        ServiceEvent.ACKNOWLEDGED: ServiceState.ACTIVE,
        **_FAULTS,
        **_BY_HAND,
        **_END,
    },
    ServiceState.STOPPED: {},
}
"""Where an event leads; what is not named leaves the state as it is."""


def service_state(decision: Decision, limits: Limits, *, shadow: bool) -> ServiceState:
    """Return the state that a cycle's decision stands for."""
    if shadow:
        return ServiceState.SHADOW
    if decision.fault is not Fault.NONE:
        if decision.mode is Mode.MANUAL:
            return ServiceState.FAULT_MANUAL
        holds = limits.action_on(decision.fault) in ("hold", "manual")
        return ServiceState.FAULT_HOLD if holds else ServiceState.FAULT_SAFE
    if not decision.measured:
        return ServiceState.STARTING
    return ServiceState.STANDBY if decision.mode is Mode.HOLD else ServiceState.ACTIVE


def state_by_mode(decision: Decision) -> ServiceState:
    """Return the state where nobody says what a fault's action is: as if it were hold."""
    if decision.fault is not Fault.NONE:
        return ServiceState.FAULT_HOLD
    return ServiceState.STANDBY if decision.mode is Mode.HOLD else ServiceState.ACTIVE


def table() -> list[str]:
    """Return the transitions as rows of a table: what happens, the states that it changes, and what they become."""
    befores: dict[tuple[ServiceEvent, ServiceState], list[str]] = {}
    for state, changes in TRANSITIONS.items():
        for event, after in changes.items():
            if after is not state:
                befores.setdefault((event, after), []).append(_word(state))
    rows = [(event, ", ".join(befores[event, after]), _word(after)) for event, after in sorted(befores, key=_place)]
    head = (("what happens", "in state", "leads to"), ("---",) * 3)
    return [f"| {' | '.join(row)} |" for row in (*head, *rows)]


def _place(change: tuple[ServiceEvent, ServiceState]) -> tuple[int, int]:
    return list(ServiceEvent).index(change[0]), change[1]


def _word(state: ServiceState) -> str:
    return state.name.lower().replace("_", "-")
