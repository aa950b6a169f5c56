"""The pressures of an extended valve, and what landings say on top of them."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from config.extended_valve import ExtendedValve, Inverse
from positioner.estimation.landings.extended_balance import (
    contradicted,
    extended_scatter_m,
    straight_law,
)
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import LocalBalance
from positioner.estimation.landings.static_law import static_law

L, SLOPE, BEND, F_C, OFFSET = 0.1, 8e5, 3e6, 2e4, 5e3
GRID = tuple(L * i / 200 for i in range(201))


def table(pressure_pa: Callable[[float], float]) -> tuple[float, ...]:
    return tuple(pressure_pa(x) for x in GRID)


def bent_pa(x: float) -> float:
    return SLOPE * x + BEND * x * x + OFFSET


VALVE = ExtendedValve(
    name="bent",
    stroke_m=L,
    up_pa=table(lambda x: bent_pa(x) + F_C),
    down_pa=table(lambda x: bent_pa(x) - F_C),
    breakaway_up_pa=table(lambda x: bent_pa(x) + 1.2 * F_C),
    breakaway_down_pa=table(lambda x: bent_pa(x) - 1.2 * F_C),
    indicated_m=GRID,
    inverse=Inverse(),
)


def landing(x: float, s: int, beyond_pa: float) -> SlideOutcome:
    command_pa = bent_pa(x) + s * F_C + beyond_pa
    return SlideOutcome(0.0, s, x - s * 0.02, command_pa, x, 1e-6, moved=True, landing=True)


def lands_pa(x: float, s: int, valve: ExtendedValve, landings: list[SlideOutcome], now_s: float) -> float:
    balance = LocalBalance(ratios=straight_law(valve), landings=tuple(landings), stroke_m=L, valve=valve, now_s=now_s)
    return balance.pressure_pa(x, s)


@pytest.mark.parametrize("s", [1, -1])
def test_without_landings_it_is_the_table(s: int) -> None:
    assert lands_pa(0.04, s, VALVE, [], 0.0) == pytest.approx(bent_pa(0.04) + s * F_C, rel=1e-4)


def test_friction_that_has_grown_is_followed_over_the_whole_travel_in_its_direction() -> None:
    landings = [landing(x, 1, 3e3) for x in (0.02, 0.05, 0.03)]
    for x in (0.01, 0.05, 0.09):
        assert lands_pa(x, 1, VALVE, landings, 0.0) - VALVE.landing_pa(x, 1) == pytest.approx(3e3, rel=0.05)
        assert lands_pa(x, -1, VALVE, landings, 0.0) == VALVE.landing_pa(x, -1)


def test_a_known_drift_is_gone_on_with_since_the_landing_but_not_for_ever() -> None:
    drifting = replace(VALVE, inverse=Inverse(drift_per_s=1e-3))
    landings = [landing(x, s, 0.0) for x in (0.02, 0.05, 0.08) for s in (1, -1)]
    for s in (1, -1):
        for now_s, share in ((0.0, 0.0), (20.0, 0.02), (1e6, 0.1)):
            beyond_pa = lands_pa(0.05, s, drifting, landings, now_s) - VALVE.landing_pa(0.05, s)
            assert beyond_pa == pytest.approx(s * share * F_C, rel=0.05, abs=1.0)


def test_what_one_place_alone_says_stays_there() -> None:
    landings = [landing(0.05, 1, 2e3), *(landing(x, 1, 0.0) for x in (0.02, 0.08, 0.02, 0.08))]
    near, far = (lands_pa(x, 1, VALVE, landings, 0.0) - VALVE.landing_pa(x, 1) for x in (0.05, 0.08))
    assert near == pytest.approx(2e3, rel=0.1)
    assert abs(far) < 0.5e3


@pytest.mark.parametrize("slope", [1.0, 0.6])
def test_landings_on_a_straight_line_that_the_table_does_not_have_say_that_it_is_another_valve(slope: float) -> None:
    """With slope 0.6 as with another area: all pressures by one factor, the level followed."""
    ratios = straight_law(VALVE)
    straight = [
        SlideOutcome(0.0, s, x - s * 0.02, ratios.balance_pa(0.05 + slope * (x - 0.05), s), x, 1e-6, True, True)
        for x in (0.02, 0.035, 0.05, 0.065, 0.08)
        for s in (1, -1)
    ]
    own = [landing(x, s, 3e3) for x in (0.02, 0.035, 0.05, 0.065, 0.08) for s in (1, -1)]
    assert contradicted(VALVE, static_law(straight, L))
    assert not contradicted(VALVE, static_law(own, L))
    assert not contradicted(VALVE, static_law(own[:3], L))


def test_the_straight_law_is_the_secant() -> None:
    ratios = straight_law(VALVE)
    assert ratios.b_over_c == pytest.approx(-(bent_pa(0.075) - bent_pa(0.025)) / 0.05, rel=1e-4)
    assert ratios.k_over_c == pytest.approx(-F_C, rel=1e-6)
    assert ratios.balance_pa(0.025, 1) == pytest.approx(bent_pa(0.025) + F_C, rel=1e-4)


def test_what_landings_scatter_by_leaves_out_the_levels_that_are_followed() -> None:
    level = [landing(x, s, 6e3 + s * 2e3) for x in (0.02, 0.05, 0.03, 0.07) for s in (1, -1)]
    assert extended_scatter_m(VALVE, level) < 2e-4 * L
    assert extended_scatter_m(VALVE, []) == 0.0
    apart = [landing(x, s, sign * 1e3) for x, sign in ((0.02, 1), (0.05, -1), (0.03, 1), (0.07, -1)) for s in (1, -1)]
    assert 5e-4 < extended_scatter_m(VALVE, apart) < 2e-3
