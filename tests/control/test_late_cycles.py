"""Cycles of a busy machine come late: samples are missed, commands act late. What S3 finds is applied all the same."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from config.codes import Mode, Refusal
from config.daemon_file import DaemonFile
from positioner.control.requests import Requests
from positioner.daemon.cycle import Cycle
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant, with_friction

PERIOD_S = 1e-3
AGED = 1.3
DEVIATIONS, NEAR = 3.0, 2e-3


class Busy:
    """A plant that goes on for some periods more, now and then, before it is looked at and commanded anew."""

    def __init__(self, plant: OtherPlant, seed: int, share: float) -> None:
        self.plant = plant
        self._rng, self._share = np.random.default_rng(seed), share

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plant, name)

    def tick(self, command_pa: float) -> None:
        late = int(self._rng.geometric(0.25)) if self._rng.random() < self._share else 0
        for _ in range(late):
            self.plant.tick(self.plant.command_pa)
        self.plant.tick(command_pa)


PACKING = with_friction(SEED_LIKE, AGED)


def begun(share: float, seed: int) -> Cycle:
    """Return a cycle that has looked on for a while."""
    plant = OtherPlant(PACKING, PERIOD_S, at_pu=0.0, noise_std_m=1e-5, seed=seed)
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": PACKING.stroke_m},
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "control": {"law": "seed"},
        }
    )
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=79e3, beta_pa=13238.0)
    cycle = virtual_cycle(file, Busy(plant, seed, share), first)
    for _ in range(300):
        cycle.once()
    return cycle


@pytest.mark.parametrize("share", [0.02, 0.1])
@pytest.mark.parametrize("seed", few_always([0, 3, 1, 2, 4, 5, 6, 7]))
def test_an_aged_packing_is_identified_by_late_cycles(seed: int, share: float) -> None:
    cycle = begun(share, seed)
    for _ in run_identification(cycle, 5.0, wait=False):
        pass
    applied, estimates = cycle.snapshot.decision.applied, cycle.snapshot.decision.estimates
    assert applied.ratios is not None, applied.last_refusal.name
    slope, friction_pa = PACKING.spring_n_per_m / PACKING.area_m2, PACKING.coulomb_n / PACKING.area_m2
    middle_pa = applied.ratios.balance_pa(0.5 * PACKING.stroke_m, 1) - (0.5 * PACKING.stroke_m * slope + friction_pa)
    assert abs(middle_pa) < max(NEAR * slope * PACKING.stroke_m, DEVIATIONS * estimates.k_over_c.std)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.MANUAL])
def test_a_sine_that_is_broken_off_applies_nothing(mode: Mode) -> None:
    """What it has by then nobody has examined."""
    cycle = begun(0.02, 0)
    asked = replace(cycle.requests, eta=(0, 0, 0))
    cycle.requests = asked
    while not cycle.snapshot.decision.estimates.acceptable:
        cycle.once()
    assert cycle.snapshot.decision.estimates.progress < 0.9
    cycle.requests = replace(asked, mode=mode, mode_writes=2)
    for _ in range(3):
        cycle.once()
    applied = cycle.snapshot.decision.applied
    assert (applied.count, applied.refusals, applied.last_refusal) == (0, 1, Refusal.BROKEN_OFF)
