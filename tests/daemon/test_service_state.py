"""The service's states on the controller: every cell of their table, be it a transition or none."""

from pathlib import Path

import pytest

from config.codes import Mode, Quality, ServiceState
from config.daemon_file import DaemonFile
from config.quantities import DeviceStatus
from docs.code_tables import STATES_BEGIN, STATES_END
from positioner.control.controller_memory import Decision
from positioner.control.settings import Settings
from positioner.daemon.end_signals import Endings
from positioner.daemon.service_state import TRANSITIONS, ServiceEvent, service_state, table
from tests.control.test_controller import LAW, STROKE_M, Bench

SAFETY = {"action": "vent", "lost_after_cycles": 5}
SUPERVISION = {
    "position_rate": {"threshold": 10.0, "action": "hold"},
    "plausibility": {"action": "manual"},
}
TABLES = {"safety": SAFETY, "supervision": SUPERVISION}
LIMITS = Settings.of(DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M}, "law": LAW, **TABLES})).limits


class Service:
    """A valve's service; what happens to it, and the state that its last cycle stands for."""

    def __init__(self, state: ServiceState) -> None:
        self.bench = Bench(**TABLES)
        self.shadow = state is ServiceState.SHADOW
        self.decision: Decision
        self.lost()
        if state is ServiceState.STARTING:
            return
        self.measured()
        if state not in (ServiceState.SHADOW, ServiceState.STANDBY):
            self.commanded()
        if state is ServiceState.FAULT_HOLD:
            self.fault_holds()
        if state is ServiceState.FAULT_SAFE:
            self.fault_safe()
        if state is ServiceState.FAULT_MANUAL:
            self.fault_manual()

    @property
    def state(self) -> ServiceState:
        return service_state(self.decision, LIMITS, shadow=self.shadow)

    def lost(self) -> None:
        self.decision = self.bench.step(quality=Quality.LOST)

    def measured(self) -> None:
        self.decision = self.bench.step()

    def commanded(self) -> None:
        self.bench.ask(mode=Mode.MANUAL)
        self.lost()

    def held(self) -> None:
        self.bench.ask(mode=Mode.HOLD)
        self.lost()

    def fault_holds(self) -> None:
        self.bench.step()
        self.bench.position_m += 0.02
        self.decision = self.bench.step()

    def fault_safe(self) -> None:
        self.decision = self.bench.step(status=DeviceStatus.SENSOR_FAULT)

    def fault_manual(self) -> None:
        for _ in range(5):
            self.bench.step(position_m=1.0)
        self.measured()

    def acknowledged(self) -> None:
        self.bench.acknowledge()
        self.lost()


@pytest.mark.parametrize("event", [each for each in ServiceEvent if each is not ServiceEvent.ENDED])
@pytest.mark.parametrize("state", [each for each in ServiceState if each is not ServiceState.STOPPED])
def test_every_event_in_every_state_leads_where_the_table_says(state: ServiceState, event: ServiceEvent) -> None:
    service = Service(state)
    assert service.state is state
    getattr(service, event.name.lower())()
    assert service.state is TRANSITIONS[state].get(event, state)


def test_the_end_is_the_end() -> None:
    assert {TRANSITIONS[each].get(ServiceEvent.ENDED, each) for each in ServiceState} == {ServiceState.STOPPED}
    assert TRANSITIONS[ServiceState.STOPPED] == {}
    assert Endings.__doc__, "tests/cli/test_daemon_process.py ends it, tests/daemon/test_end_signals.py by every signal"


def test_a_fault_whose_cause_lasts_is_not_acknowledged() -> None:
    service = Service(ServiceState.FAULT_SAFE)
    service.bench.acknowledge()
    service.fault_safe()
    assert service.state is ServiceState.FAULT_SAFE


def test_the_document_shows_the_table() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reliability.md").read_text()
    shown = text.partition(STATES_BEGIN)[2].partition(STATES_END)[0].strip().splitlines()
    assert shown == table(), "python -m docs.code_tables"
