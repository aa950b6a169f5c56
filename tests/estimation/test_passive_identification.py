"""Passive identification: friction that drifts is followed from ordinary moves, without any excitation."""

import numpy as np
import pytest

from tests.estimation.stem import AREA, COULOMB, NOISE, SPRING, STATIC, STROKE, rested

PERIOD_S, MOVES, EVERY_S = 2e-3, 30, 20.0


def test_friction_that_drifts_by_30_percent_in_10_minutes_is_followed_within_3_percent() -> None:
    valve, identification = rested()
    pressure_pa, rng = valve.pressure_pa, np.random.default_rng(0)
    errors = []
    for move in range(MOVES):
        grown = 1 + 0.3 * move / (MOVES - 1)
        valve.change(coulomb_n=COULOMB * grown, static_n=STATIC * grown)
        known = identification.estimates
        friction_n = -known.k_over_c.value * AREA if known.law_ready else COULOMB
        target_m = STROKE * float(rng.uniform(0.3, 0.8))
        direction = 1 if target_m > valve.position_m else -1
        for row in range(250):
            if row == 100:
                pressure_pa = (SPRING * target_m + direction * friction_n) / AREA
            valve.advance(pressure_pa, PERIOD_S)
            identification.update(
                EVERY_S * move + PERIOD_S * row,
                valve.position_m + float(rng.normal(0, NOISE)),
                valve.pressure_pa,
                parameters=True,
                friction=True,
                passive=True,
            )
        errors.append(identification.estimates.k_over_c.value / (-COULOMB * grown / AREA) - 1)
    assert identification.moves > 0.5 * MOVES
    assert np.nanmax(np.abs(errors[3:])) < 0.03
    assert identification.estimates.b_over_c.value == pytest.approx(-SPRING / AREA, rel=2e-3)


def test_a_first_move_alone_tells_nothing_that_may_be_used() -> None:
    valve, identification = rested()
    pressure_pa, rng = valve.pressure_pa, np.random.default_rng(0)
    for row in range(250):
        if row == 100:
            pressure_pa += 5e4
        valve.advance(pressure_pa, PERIOD_S)
        position_m = valve.position_m + float(rng.normal(0, NOISE))
        identification.update(
            PERIOD_S * row, position_m, valve.pressure_pa, parameters=True, friction=True, passive=True
        )
    assert identification.moves == 0
    assert not identification.estimates.acceptable
