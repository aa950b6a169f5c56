"""Whether a measured pressure is the one commanded, by what the two had to do with each other before."""

from math import nan

import numpy as np
import pytest

from positioner.estimation.landings.pressure_delivered import PressureDelivered

LEVELS_PA = (30e3, 36e3, 44e3, 52e3, 61e3, 70e3, 62e3, 53e3, 45e3, 37e3)


def after(pairs_pa: list[tuple[float, float]]) -> PressureDelivered:
    delivered = PressureDelivered()
    for pair_pa in pairs_pa:
        delivered.add(*pair_pa)
    return delivered


@pytest.mark.parametrize(("offset_pa", "scale"), [(0.0, 1.0), (5e3, 1.0), (-2e3, 0.1), (0.0, 6.9)])
def test_a_fallen_supply_is_told_whatever_the_register_counts_in(offset_pa: float, scale: float) -> None:
    delivered = after([(each, offset_pa + scale * each) for each in LEVELS_PA])
    assert delivered.agrees(75e3, offset_pa + scale * 75e3)
    assert delivered.agrees(120e3, offset_pa + scale * 120e3)
    assert not delivered.agrees(75e3, offset_pa + scale * 66e3)
    assert not delivered.agrees(75e3, offset_pa)


def test_hysteresis_and_noise_are_no_lost_supply() -> None:
    generator = np.random.default_rng(1)
    way = np.sign(np.diff([0.0, *LEVELS_PA]))
    measured_pa = np.array(LEVELS_PA) - 800.0 * way + generator.normal(0.0, 300.0, way.size)
    delivered = after(list(zip(LEVELS_PA, measured_pa.tolist(), strict=True)))
    assert all(delivered.agrees(50e3, 50e3 + off_pa) for off_pa in (-1.5e3, 1.5e3))
    assert not delivered.agrees(50e3, 40e3)


@pytest.mark.parametrize(("scale", "levels"), [(1.0, 0), (1.0, 3), (0.0, len(LEVELS_PA))])
def test_where_nothing_is_known_nothing_is_doubted(scale: float, levels: int) -> None:
    assert after([(each, scale * each) for each in LEVELS_PA[:levels]]).agrees(50e3, 0.0)


def test_a_pressure_that_is_not_measured_is_not_doubted() -> None:
    delivered = after([(each, each) for each in LEVELS_PA])
    delivered.add(50e3, nan)
    assert delivered.agrees(50e3, nan)
    assert not delivered.agrees(50e3, 20e3)
