"""S3 by a staircase finds a packing that needs more than the spring takes over the stroke, by its own slides."""

import pytest

from config.codes import Fault, State
from config.daemon_file import DaemonFile
from drivers.in_memory import Plant
from positioner.control.controller_memory import Decision
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant, with_friction
from tests.control.virtual_loop import VirtualLoop

PERIOD_S = 0.02
STROKE_M = SEED_LIKE.stroke_m


def identified(plant: Plant, maximum_pa: float) -> Decision:
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "pressure": {"maximum_pa": maximum_pa},
            "control": {"law": "slides"},
        }
    )
    loop = VirtualLoop(file, plant)
    loop.cycles(0.2)
    loop.begin()
    loop.cycles(PERIOD_S)
    while loop.decision.state is State.S3_IDENTIFY and loop.decision.estimates.progress < 1.0:
        loop.cycles(PERIOD_S)
    loop.end()
    return loop.decision


@pytest.mark.parametrize("maximum_pa", [140e3, 420e3])
@pytest.mark.parametrize("factor", few_always([2.0, 1.0, 1.5], 1))
def test_friction_that_has_doubled_is_found_on_another_plant(factor: float, maximum_pa: float) -> None:
    """The first turn needs F_c + F_s: 97 kPa of the doubled packing, where the spring takes 83 over the stroke."""
    plant = OtherPlant(with_friction(SEED_LIKE, factor), PERIOD_S, noise_std_m=1e-5)
    found = identified(plant, maximum_pa)
    assert (found.fault, found.applied.count) == (Fault.NONE, 1)
    assert found.applied.ratios is not None
    friction_pa = factor * SEED_LIKE.coulomb_n / SEED_LIKE.area_m2
    assert -found.applied.ratios.k_over_c == pytest.approx(friction_pa, rel=0.01)
