"""What is listed of a valve's alarms."""

import pytest

from config.codes import Fault, Ne107Cause
from northbound.observer.seen_alarms import alarms

BIT = float(1 << (Ne107Cause.FAULT - 1))


@pytest.mark.parametrize(("fault", "text"), [(Fault.STALE, f"fault: {Fault.STALE.text}"), (Fault.NONE, "fault")])
def test_the_alarm_of_a_fault_says_which_is_in_force(fault: Fault, text: str) -> None:
    (seen,) = alarms({"alarms_active": BIT, "alarms_unacknowledged": BIT, "fault": float(fault)})
    assert seen.text == text
