"""The law against the force balance it stands for."""

import pytest

from positioner.control.balance_law import balance_pa
from positioner.estimation.acceptance import Ratios

A, K_S, F_C = 0.0645, 52538.0, 1423.4
SEED = Ratios(b_over_c=-K_S / A, k_over_c=-F_C / A)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("reference_m", [0.0, 0.03, 0.1016])
def test_no_net_force_on_the_moving_stem_at_the_reference(reference_m: float, direction: int) -> None:
    pressure_pa = balance_pa(reference_m, direction, SEED)
    assert A * pressure_pa - K_S * reference_m - direction * F_C == pytest.approx(0.0, abs=1e-9)


def test_the_printed_formula_is_not_this_one() -> None:
    """(23) as printed, u = (r - b_e k_e) / c_e, misses by orders of magnitude."""
    m = 1.3608
    b, c, k = -K_S / m, A / m, -F_C / m
    printed_pa = (0.03 - b * k) / c
    assert abs(printed_pa - balance_pa(0.03, 1, SEED)) > 1e6
