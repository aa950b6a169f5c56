"""Some cases of the campaign (`make campaign` runs them all), and that one which is not as documented is told."""

from dataclasses import replace

import pytest

from benchmarks.campaign import BUSES, NONE, STATES, Case, Outcome, all_cases, run_case, table
from config.codes import Fault
from positioner.control.supervision import Limits

pytestmark = pytest.mark.real_time

CASES = all_cases(BUSES)
SOME = CASES[::89]


def test_there_are_at_least_five_hundred_cases_of_every_fault_in_every_state() -> None:
    assert len(CASES) >= 500
    faults = {(each.bus, each.fault.name) for each in CASES}
    tried = {(each.bus, each.state, each.fault.name) for each in CASES}
    assert tried == {(bus, state, fault) for bus, fault in faults for state in STATES}
    assert len(set(map(str, CASES))) == len(CASES)


@pytest.mark.parametrize("case", SOME, ids=str)
def test_a_fault_ends_as_documented(case: Case) -> None:
    assert run_case(case).violations == []


def test_a_fault_that_is_not_seen_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    (case,) = (each for each in CASES if str(each) == "modbus, manual, vent: another master writes")
    assert run_case(case).violations == []
    monkeypatch.setattr(Limits, "action_on", lambda *_: "hold")
    monkeypatch.setattr("positioner.daemon.link.Link.overwritten_pa", lambda _: None)
    (said,) = run_case(case).violations
    assert said == "ended in NONE after 130 cycles"
    tolerated = replace(case, fault=replace(case.fault, ends_in=NONE))
    rows = table([(case, Outcome(Fault.NONE, 130, [said])), (tolerated, Outcome(Fault.OTHER_MASTER, 1, []))])
    assert rows[0].startswith("2 cases, 1 not as documented.")
    assert rows[-1] == "| another master writes | 2 | other master | 1 |"
