"""The daemon on a device and a valve of equations that are not ours: identified and moved, in real time."""

import pytest

from tests.other_device import Parameters, other_device
from tests.other_site import LAW, identified_at, moved

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.filterwarnings("ignore:isSet:DeprecationWarning", "ignore:setDaemon:DeprecationWarning"),
]

PERIOD_S = 0.02
WITHIN_S = 200.0
NEAR, LANDED = 0.03, 3e-3


def test_it_is_identified_with_nothing_typed_in_and_its_steps_land() -> None:
    valve = Parameters()
    with other_device(0.4 * valve.stroke_m, valve) as device, identified_at(device, PERIOD_S, WITHIN_S) as dcs:
        for name, true in zip(LAW, valve.static_law, strict=True):
            assert dcs.get(f"{name}_e") == pytest.approx(true, rel=NEAR), name
        for reference in (0.52, 0.515, 0.55):
            assert abs(moved(device, dcs, reference).error) < LANDED
