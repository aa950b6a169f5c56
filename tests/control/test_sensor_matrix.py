"""Estimators against what sensors do: a generated matrix. Nothing is applied that is off by more than its deviation.

The plant is not the product's simulator; each fault begins at several instants of S3, the first of them within the
milliseconds in which the stem is thrown from its rest.
"""

from dataclasses import dataclass
from itertools import product
from math import nan

import pytest

from config.codes import Mode, Refusal
from config.daemon_file import DaemonFile
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.virtual.virtual_cycle import virtual_cycle
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant

PERIOD_S, BEGINS_S = 1e-3, 0.1
ALPHA_PA, BETA_PA = 44126.0, 13238.0
STROKE_M = SEED_LIKE.stroke_m
SLOPE = SEED_LIKE.spring_n_per_m / SEED_LIKE.area_m2
FRICTION_PA = SEED_LIKE.coulomb_n / SEED_LIKE.area_m2
DEVIATIONS, NEAR = 3.0, 2e-3
"""Reported deviations; of the stroke, within which a slide up to mid-stroke lands all the same."""


@dataclass
class Spoiled:
    """A sensor that fails in one way from a time on: by a share of the stroke, a rate of it, 1/s, or for a time, s."""

    kind: str
    by: float
    at_s: float
    _held_m: float = nan

    def __call__(self, time_s: float, shown_m: float) -> float:
        if time_s < self.at_s:
            self._held_m = shown_m
            return shown_m
        since_s = time_s - self.at_s
        if self.kind == "jump":
            return shown_m + self.by * STROKE_M
        if self.kind == "drift":
            return shown_m + self.by * STROKE_M * since_s
        if self.kind == "spike":
            return shown_m + self.by * STROKE_M * (since_s < 3 * PERIOD_S)
        return self._held_m if since_s < self.by else shown_m

    def __str__(self) -> str:
        return f"{self.kind} {self.by:+g} at {self.at_s:g}"


def identified(spoiled: Spoiled, gap_s: float = 0.0) -> Decision:
    """Return what S3 by a sine leaves; over a gap the plant goes on and nobody samples."""
    plant = OtherPlant(SEED_LIKE, PERIOD_S, at_pu=0.0, noise_std_m=1e-5, sensed=spoiled)
    file = {
        "valve": {"stroke_m": STROKE_M},
        "cycle": {"pace": "device", "period_s": PERIOD_S},
        "control": {"law": "seed"},
    }
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=ALPHA_PA, beta_pa=BETA_PA)
    cycle = virtual_cycle(DaemonFile.model_validate(file), plant, first)

    def run(until_s: float) -> None:
        while (now_s := cycle.snapshot.sample.now_s) < until_s:
            cycle.once()
            if gap_s and now_s < spoiled.at_s <= now_s + PERIOD_S:
                for _ in range(round(gap_s / PERIOD_S)):
                    plant.tick(cycle.snapshot.decision.command_pa)
            if cycle.snapshot.decision.fault or cycle.snapshot.decision.progress >= 1.0:
                return

    run(BEGINS_S)
    cycle.requests = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=ALPHA_PA, beta_pa=BETA_PA, eta=(0, 0, 0))
    run(3.0)
    cycle.requests = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=ALPHA_PA, beta_pa=BETA_PA, eta=QUIET)
    cycle.once()
    cycle.once()
    return cycle.snapshot.decision


def assert_nothing_wrong(decision: Decision) -> None:
    ratios, estimates = decision.applied.ratios, decision.estimates
    if ratios is None:
        assert decision.applied.last_refusal is not Refusal.VALID
        return
    middle_pa = ratios.balance_pa(0.5 * STROKE_M, 1) - (0.5 * STROKE_M * SLOPE + FRICTION_PA)
    if abs(middle_pa) > NEAR * SLOPE * STROKE_M:
        assert abs(-ratios.k_over_c - FRICTION_PA) < DEVIATIONS * estimates.k_over_c.std
        assert abs(-ratios.b_over_c - SLOPE) < DEVIATIONS * estimates.b_over_c.std


AT_S = (0.105, 0.115, 0.13, 0.2, 0.4, 0.6, 0.8)
SIGNED = [("jump", by) for by in (-0.1, -0.03, 0.03, 0.1)]
SIGNED += [("drift", by) for by in (-0.05, -0.01, 0.01, 0.05)]
SIGNED += [("spike", by) for by in (-0.1, 0.01, 0.1)]
MATRIX = [Spoiled(kind, by, at_s) for (kind, by), at_s in product([*SIGNED, ("freeze", 0.05), ("freeze", 0.2)], AT_S)]
HARD = [
    Spoiled("jump", -0.1, 0.115),
    Spoiled("jump", 0.03, 0.105),
    Spoiled("drift", -0.05, 0.105),
]
SMALL = [Spoiled("drift", by, at_s) for by, at_s in product((-0.004, 0.004, 0.002), (0.0, 0.105, 0.3, 0.6))]


OVER_A_GAP = (("spike", 0.0), ("drift", 0.01))
GAPS = [
    (Spoiled("spike", 0.0, 0.12), 0.03),
    (Spoiled("drift", 0.01, 0.12), 0.1),
    *((Spoiled(*how, at_s), gap_s) for how, at_s, gap_s in product(OVER_A_GAP, (0.12, 0.3, 0.5), (0.02, 0.03, 0.1))),
]


@pytest.mark.parametrize("spoiled", few_always([*HARD, *MATRIX, *SMALL], len(HARD)), ids=str)
def test_nothing_is_applied_beyond_its_deviation_whatever_the_sensor_does(spoiled: Spoiled) -> None:
    assert_nothing_wrong(identified(spoiled))


@pytest.mark.parametrize(("spoiled", "gap_s"), few_always(GAPS, 2), ids=str)
def test_nor_over_a_gap(spoiled: Spoiled, gap_s: float) -> None:
    assert_nothing_wrong(identified(spoiled, gap_s))


def test_a_good_sensor_is_applied() -> None:
    decision = identified(Spoiled("spike", 0.0, 9.0))
    assert decision.applied.count == 1
    assert_nothing_wrong(decision)
