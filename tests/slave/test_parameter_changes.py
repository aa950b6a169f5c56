"""Changes as functions of time: steps, drifts, one that takes over from another, what is refused."""

import math

import pytest

from config.errors import InputError
from config.slave_file import Change
from sim.parameter_changes import Changes

FRICTION = {"coulomb_n": 1000.0, "static_n": 1200.0, "viscous_ns_per_m": 600.0}


def test_a_step_holds_from_its_time() -> None:
    changes = Changes([Change(at_s=2.0, viscous_ns_per_m=700.0)], FRICTION)
    assert changes.at(1.999) == {"viscous_ns_per_m": 600.0}
    assert changes.at(2.0) == {"viscous_ns_per_m": 700.0}
    assert changes.quiet_until_s(0.0) == 2.0
    assert changes.quiet_until_s(2.0) == math.inf


def test_a_drift_is_a_straight_line() -> None:
    changes = Changes([Change(at_s=1.0, over_s=4.0, static_n=2000.0)], FRICTION)
    assert [changes.at(time_s)["static_n"] for time_s in (0, 1, 2, 3, 5, 9)] == [1200, 1200, 1400, 1600, 2000, 2000]
    assert [changes.quiet_until_s(time_s) for time_s in (0.0, 1.0, 4.9, 5.0)] == [1.0, 1.0, 4.9, math.inf]


def test_a_later_change_takes_over_from_one_under_way_in_any_order_of_writing() -> None:
    drift = Change(at_s=0.0, over_s=10.0, static_n=2200.0)
    back = Change(at_s=5.0, over_s=1.0, static_n=1200.0)
    for written in ([drift, back], [back, drift]):
        changes = Changes(written, FRICTION)
        assert [changes.at(time_s)["static_n"] for time_s in (5, 5.5, 6, 10)] == [1700, 1450, 1200, 1200]


@pytest.mark.parametrize(
    "changes",
    [
        [Change(at_s=1.0, coulomb_n=1300.0)],
        [Change(at_s=1.0, static_n=900.0)],
        [Change(at_s=0.0, over_s=4.0, static_n=2000.0), Change(at_s=1.0, coulomb_n=1500.0)],
    ],
)
def test_static_below_coulomb_friction_is_refused_whenever_it_would_come(changes: list[Change]) -> None:
    with pytest.raises(InputError, match=r"change: at [0-9.]+ s static_n is .* below coulomb_n"):
        Changes(changes, FRICTION)
