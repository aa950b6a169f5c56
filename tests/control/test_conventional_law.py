"""The conventional law: PI with a dead band of the integral, by hand; and in the control core."""

import pytest

from positioner.control.laws.conventional.conventional_law import ConventionalLaw, ConventionalSettings
from positioner.estimation.acceptance import Ratios
from tests.control.test_controller import HELD_PA, STROKE_M, automatic

RATIOS = Ratios(b_over_c=-800e3, k_over_c=-20e3)
DEAD_BAND_M = 1e-3
SETTINGS = ConventionalSettings(0.0, 100e3, gain=0.1, integral_rate_per_s=8.0)
BEGUN = ConventionalLaw(40e3, SETTINGS, 40e3, 1.0)
"""After a sample without error."""
ERROR_M = 0.01
"""8000 Pa of the spring."""


def test_it_takes_over_without_a_bump() -> None:
    begun = SETTINGS.begin(40e3).after(1.0, ERROR_M, RATIOS, DEAD_BAND_M)
    assert (begun.command_pa, begun.now_s) == (40e3, 1.0)
    assert begun.integral_pa == pytest.approx(39_200.0)


@pytest.mark.parametrize(
    ("elapsed_s", "share"), [(0.01, 0.08), (0.05, 0.4), (0.2, 0.8)], ids=["10 ms", "50 ms", "at gain margin 2"]
)
def test_the_integral_grows_with_the_time_that_passed(elapsed_s: float, share: float) -> None:
    after = BEGUN.after(1.0 + elapsed_s, ERROR_M, RATIOS, DEAD_BAND_M)
    assert after.integral_pa == pytest.approx(40e3 + share * 8e3)
    assert after.command_pa == pytest.approx(40e3 + (0.1 + share) * 8e3)


@pytest.mark.parametrize(("error_m", "stands"), [(0.9e-3, True), (-0.9e-3, True), (1.1e-3, False), (-1.1e-3, False)])
def test_within_the_dead_band_the_integral_stands(error_m: float, stands: bool) -> None:
    after = BEGUN.after(1.1, error_m, RATIOS, DEAD_BAND_M)
    assert (after.integral_pa == 40e3) == stands
    assert after.command_pa != 40e3


@pytest.mark.parametrize(("error_m", "limit_pa"), [(0.09, 100e3), (-0.09, 0.0)])
def test_at_a_limit_of_the_pressure_the_integral_stands(error_m: float, limit_pa: float) -> None:
    after = BEGUN.after(2.0, error_m, RATIOS, DEAD_BAND_M)
    assert (after.command_pa, after.integral_pa) == (limit_pa, 40e3)


@pytest.mark.parametrize("period_s", [0.02, 0.1, 1.0])
def test_a_stem_without_friction_comes_to_its_reference(period_s: float) -> None:
    law, position_m, now_s = BEGUN, 0.03, 1.0
    for _ in range(round(3 / period_s) + 10):
        now_s += period_s
        law = law.after(now_s, 0.05 - position_m, RATIOS, DEAD_BAND_M)
        position_m = law.command_pa / 800e3
    assert position_m == pytest.approx(0.05, abs=DEAD_BAND_M)


def test_the_control_core_gives_what_it_asks_for() -> None:
    bench = automatic(control={"law": "conventional", "dead_band": 0.01})
    bench.ask(reference_m=bench.position_m + 0.01)
    assert bench.step().command_pa == HELD_PA
    more_pa = bench.step().command_pa - HELD_PA
    assert more_pa == pytest.approx(8.0 * 0.01 * 8e3)
    bench.position_m += 0.01 - 0.5 * 0.01 * STROKE_M
    inside = bench.step().command_pa
    assert bench.step().command_pa == inside


def test_a_lost_measurement_changes_nothing() -> None:
    bench = automatic(control={"law": "conventional"})
    bench.ask(reference_m=bench.position_m + 0.01)
    bench.step()
    before_pa = bench.step().command_pa
    assert bench.step(position_m=float("nan")).command_pa == before_pa
