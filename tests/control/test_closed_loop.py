"""The control core on the simulated valve, in virtual time: identification, steps, and what spoils them."""

import math
import subprocess
import sys
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from config.codes import Mode, Quality, Refusal
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.slave.slave import device_of
from tests.cases import few_always

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
B_OVER_C = -VALVE.spring_n_per_m / VALVE.diaphragm_area_m2
K_OVER_C = -VALVE.coulomb_n / VALVE.diaphragm_area_m2
DAEMON = DaemonFile.model_validate(
    {"valve": {"stroke_m": STROKE_M}, "cycle": {"pace": "device"}, "control": {"law": "seed"}}
)
ALPHA_PA, BETA_PA = 44126.0, 13238.0
IDENTIFY = (0, 0, 0)


class Plant:
    """A virtual valve with noise of 1e-4 p.u., and the DCS's requests."""

    def __init__(self, seed: int) -> None:
        slave = SlaveFile.model_validate(
            {"clock": {"mode": "lockstep"}, "sensor": {"noise_std_m": 1e-4 * STROKE_M, "seed": seed}}
        )
        first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=ALPHA_PA, beta_pa=BETA_PA)
        self.cycle = virtual_cycle(DAEMON, device_of(slave, shipped_valve("seed")), first)

    def ask(self, **values: object) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)  # type: ignore[arg-type]

    def step_to(self, reference_pu: float) -> None:
        writes = self.cycle.requests.reference_writes + 1
        self.ask(reference_m=reference_pu * STROKE_M, reference_writes=writes)

    def run(self, seconds: float) -> Decision:
        for _ in range(round(seconds / 1e-3)):
            self.cycle.once()
        return self.decision

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    def identify(self, seconds: float = 1.0) -> Decision:
        self.run(0.1)
        self.ask(eta=IDENTIFY)
        self.run(seconds)
        self.ask(eta=QUIET)
        return self.run(0.001)

    def position_pu(self) -> float:
        return self.cycle.snapshot.sample.position_m / STROKE_M


@cache
def _identified(seed: int) -> Plant:
    plant = Plant(seed)
    plant.identify()
    return plant


def identified(seed: int = 0) -> Plant:
    """Return a plant of one's own; the one that it is copied from is identified once."""
    return deepcopy(_identified(seed))


@pytest.mark.parametrize("seed", few_always(range(4)))
def test_identified_ratios_are_within_1_percent_and_steps_within_1_percent_of_the_stroke(seed: int) -> None:
    plant = identified(seed)
    ratios = plant.decision.applied.ratios
    assert ratios is not None
    assert ratios.b_over_c == pytest.approx(B_OVER_C, rel=0.01)
    assert ratios.k_over_c == pytest.approx(K_OVER_C, rel=0.01)
    for reference_pu in (0.65, 0.4, 0.8, 0.5):
        plant.step_to(reference_pu)
        plant.run(1.0)
        assert plant.position_pu() == pytest.approx(reference_pu, abs=0.01)


def test_a_second_identification_that_finds_nothing_leaves_the_first_in_use() -> None:
    plant = identified()
    first = plant.decision
    plant.ask(beta_pa=10.0, alpha_pa=first.command_pa + 1.0)
    second = plant.identify(0.5)
    assert first.applied.ratios is not None
    assert second.applied.ratios is not None
    assert second.applied.ratios.b_over_c == first.applied.ratios.b_over_c
    assert second.applied.ratios.friction_pa(1) == pytest.approx(first.applied.ratios.friction_pa(1))
    assert (second.applied.count, second.applied.refusals) == (1, 1)
    assert second.applied.last_refusal is not Refusal.VALID


def test_a_ratio_alone_is_renewed_by_the_friction_estimator() -> None:
    """eta_2 = 1: b/c stays, k/c follows."""
    plant = identified()
    first = plant.decision.applied.ratios
    plant.run(0.3)
    plant.ask(eta=(0, 1, 0))
    plant.run(1.0)
    plant.ask(eta=QUIET)
    renewed = plant.run(0.001).applied
    assert first is not None
    assert renewed.ratios is not None
    assert renewed.count == 2
    assert renewed.ratios.b_over_c == first.b_over_c
    assert renewed.ratios.k_over_c == pytest.approx(K_OVER_C, rel=0.01)


Spoil = Callable[[int, Sample], Sample]


def spiked(index: int, sample: Sample) -> Sample:
    return sample._replace(position_m=5.0 if index % 50 == 25 else sample.position_m)


def dropped(index: int, sample: Sample) -> Sample:
    return sample._replace(quality=Quality.LOST, position_m=math.nan) if index % 50 == 25 else sample


def repeated(index: int, sample: Sample) -> Sample:
    return sample._replace(quality=Quality.REPEATED, position_m=0.0) if index % 50 == 25 else sample


def interrupted(index: int, sample: Sample) -> Sample:
    return sample._replace(quality=Quality.LOST, position_m=math.nan) if 300 <= index < 330 else sample


@cache
def seen() -> tuple[tuple[Sample, Requests], ...]:
    """Samples and requests of an identification, and what is asked for then."""
    plant, seen = Plant(2), []
    for index in range(1100):
        plant.ask(eta=IDENTIFY if 100 <= index < 1050 else QUIET)
        plant.cycle.once()
        seen.append((plant.cycle.snapshot.sample, plant.cycle.requests))
    return tuple(seen)


@pytest.mark.parametrize("spoil", few_always([spiked, interrupted, dropped, repeated], 2))
def test_measurements_that_are_none_do_not_reach_the_estimators(spoil: Spoil) -> None:
    # A gap that is a fault would end the identification.
    patient = DAEMON.safety.model_copy(update={"lost_after_cycles": 50})
    controller = Controller(Settings.of(DAEMON.model_copy(update={"safety": patient})), 0.0)
    decisions = [controller.step(spoil(index, sample), requests) for index, (sample, requests) in enumerate(seen())]
    ratios = decisions[-1].applied.ratios
    assert ratios is not None
    assert ratios.b_over_c == pytest.approx(B_OVER_C, rel=0.01)
    assert ratios.k_over_c == pytest.approx(K_OVER_C, rel=0.01)
    singly = {decisions[-1].estimates.a.reason, decisions[-1].estimates.k.reason}
    assert singly == {Refusal.COMMANDS_MISSED if spoil is interrupted else Refusal.VALID}


NOTHING_LOADED = """
import sys
from tests.control.test_closed_loop import Plant
plant = Plant(1)
plant.run(0.1)
before = set(sys.modules)
plant.identify()
plant.step_to(0.6)
plant.run(0.5)
print(*sorted(set(sys.modules) - before))
"""


def test_no_cycle_loads_a_module() -> None:
    """As `np.median` does when it is first called: the cycle in which a stem first moved came 20 ms late."""
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", NOTHING_LOADED], cwd=root, capture_output=True, text=True, check=True)
    assert not done.stdout.split()
