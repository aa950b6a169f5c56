"""The flow loop on wires: the same every time, and the one in virtual time but for float32, which may shift a slide."""

import numpy as np
import pytest

from positioner.cli.parts.flow_cases import FlowCase, virtual_outcome
from positioner.cli.parts.flow_on_bus import outcome_on_modbus

pytestmark = pytest.mark.real_time

CASE = FlowCase("slides", 0.02, settle_s=2.0, measured_s=8.0)


@pytest.mark.long
def test_dcs_and_daemon_on_modbus_make_the_same_course_every_time() -> None:
    first, second = (outcome_on_modbus(CASE).course for _ in range(2))
    assert len(first.time_s) > 10.0 / 0.02 - 2
    assert np.ptp(first.reference_pu) > 1e-3
    for name in ("time_s", "flow", "reference_pu", "stem_pu"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    virtual = virtual_outcome(CASE).course
    length = min(len(first.time_s), len(virtual.time_s))
    assert np.median(np.abs(first.flow[:length] - virtual.flow[:length])) < 1e-3
