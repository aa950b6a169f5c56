"""Where searches begin that would not come there from elsewhere."""

import numpy as np
import pytest

from sim.composition import COULOMB, STATIC, Composition
from tests.workbench.valves import drawn_valve, with_effect
from workbench.fit.starts import with_plays
from workbench.model.parameters import free_parameters

VALVE = drawn_valve(np.random.default_rng(0))


def test_a_play_takes_from_friction_what_friction_stood_in_for() -> None:
    composition = Composition.from_file(with_effect(VALVE, "backlash", width_m=0.0))
    added = free_parameters(composition, ["backlash.width_m"])
    bands = with_plays(composition.theta, added)
    assert len(bands) == 3
    for theta in (each for band in bands for each in band):
        shift_n = 0.5 * VALVE.valve.spring_n_per_m * theta[-1]
        assert theta[COULOMB] == pytest.approx(VALVE.valve.coulomb_n - shift_n)
        assert abs(theta[STATIC] - VALVE.valve.static_n) <= 1.0001 * shift_n
        assert theta[COULOMB] > 0.0
    assert not with_plays(composition.theta, free_parameters(composition, ["spring_n_per_m"]))
