"""The law that chooses the move: a pulse where the loop is fast enough, slides elsewhere, and what it may not do."""

from dataclasses import replace

import numpy as np
import pytest

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.control.breakaway_memory import LearntPush
from positioner.control.law_memory import first_memory
from positioner.control.move_memory import MoveMemory
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.control.slide_margins import Margin, Margins
from positioner.control.valve_knowledge import ValveKnowledge, with_learnt
from positioner.estimation.acceptance import Ratios
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
LEAST = (VALVE.static_n - VALVE.coulomb_n) / VALVE.spring_n_per_m / STROKE_M
KNOWN = {
    "b_over_c_pa_per_m": -VALVE.spring_n_per_m / VALVE.diaphragm_area_m2,
    "k_over_c_pa": -VALVE.coulomb_n / VALVE.diaphragm_area_m2,
}
BREAKAWAY_PA = VALVE.static_n / VALVE.diaphragm_area_m2


def settings_at(period_s: float, **control: object) -> tuple[DaemonFile, Settings]:
    file = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": STROKE_M, "breakaway_pa": BREAKAWAY_PA},
            "cycle": {"pace": "device", "period_s": period_s},
            "safety": {"stale_after_s": max(0.1, 4 * period_s)},
            "control": {"law": "moves", **control},
            "law": KNOWN,
        }
    )
    return file, Settings.of(file)


class Loop:
    """The seed's valve, whose numbers are typed in, under the law, in virtual time."""

    def __init__(self, period_s: float, **control: object) -> None:
        self.period_s = period_s
        slave = {"clock": {"mode": "lockstep", "period_s": period_s}, "sensor": {"noise_std_m": 1e-5, "seed": 1}}
        self.valve = Valve.from_file(ValveFile.model_validate({"valve": VALVE.model_dump()}), step_s=FINE_STEP_S)
        self.valve.rest_at(0.0, 0.0)
        device = Device(self.valve, SlaveFile.model_validate(slave), {})
        file, _ = settings_at(period_s, **control)
        self.cycle = virtual_cycle(file, device, Requests(mode=Mode.AUTOMATIC, mode_writes=1))

    def step_to(self, reference: float, duration_s: float) -> np.ndarray:
        """Return the true stem, p.u., at every cycle."""
        writes = self.cycle.requests.reference_writes + 1
        self.cycle.requests = replace(self.cycle.requests, reference_m=reference * STROKE_M, reference_writes=writes)
        path = []
        for _ in range(round(duration_s / self.period_s)):
            self.cycle.once()
            path.append(self.valve.position_m / STROKE_M)
        return np.array(path)

    def farthest(self, reference: float, duration_s: float) -> tuple[float, float]:
        """Return the error at the end and how far beyond the way the stem was meanwhile, p.u."""
        before = self.valve.position_m / STROKE_M
        path = self.step_to(reference, duration_s)
        beyond = max(min(before, reference) - path.min(), path.max() - max(before, reference))
        return abs(path[-1] - reference), beyond


@pytest.mark.parametrize(("period_s", "excursions"), [(1e-3, False), (0.02, True)], ids=["fast", "slow"])
def test_small_steps_are_pulses_in_a_fast_loop_and_slides_in_a_slow_one(period_s: float, excursions: bool) -> None:
    loop = Loop(period_s)
    loop.step_to(0.6, 2.0)
    loop.farthest(0.61, 1.5)  # the first pulses teach
    for at in (0.604, 0.607, 0.612, 0.605):
        error, beyond = loop.farthest(at, 1.5)
        assert error < 1e-3
        assert (beyond > 0.5 * LEAST) == excursions


def test_what_no_pulse_reaches_two_slides_do() -> None:
    loop = Loop(5e-3)
    loop.step_to(0.6, 2.0)
    loop.farthest(0.64, 1.5)
    error, beyond = loop.farthest(0.643, 2.0)  # shorter than any pulse of 5 ms
    assert error < 2e-4
    assert beyond > 0.5 * LEAST


def test_an_excursion_that_the_site_bars_leaves_pulses() -> None:
    loop = Loop(5e-3, excursion_limit=0.01)
    loop.step_to(0.6, 2.0)
    loop.farthest(0.64, 1.5)
    error, beyond = loop.farthest(0.653, 2.0)
    assert beyond < 0.01
    assert error < 7e-3  # of a step of 13e-3: the shortest pulse of 5 ms goes as far


def test_a_ramp_is_followed_by_pulses_without_excursions() -> None:
    loop = Loop(2e-3)
    loop.step_to(0.5, 2.0)
    for at in (0.505, 0.51, 0.515):  # the first is a step like any other, and teaches
        loop.step_to(at, 0.5)
    travel = 0.0
    for at in np.arange(0.52, 0.561, 0.005):
        path = loop.step_to(float(at), 0.5)
        travel += float(np.abs(np.diff(path)).sum())
        assert abs(path[-1] - at) < 1e-3
    assert travel < 1.2 * 0.045


def test_no_pulse_while_what_was_restored_is_provisional() -> None:
    """Only slides say whether it still holds."""
    loop = Loop(1e-3)
    controller = loop.cycle._controller
    controller._memory = controller._memory._replace(
        restoration=replace(
            controller._memory.restoration,
            knowledge=ValveKnowledge(
                Ratios(KNOWN["b_over_c_pa_per_m"], KNOWN["k_over_c_pa"]), ((0.0, 0.0, 0.0),) * 3, 1e-5
            ),
            trust=type(controller._memory.restoration.trust).PROVISIONAL,
        )
    )
    loop.step_to(0.6, 2.0)
    _, beyond = loop.farthest(0.605, 0.5)
    assert beyond > 0.5 * LEAST


def test_what_either_hand_has_learnt_is_kept() -> None:
    _, settings = settings_at(1e-3)
    margin = Margin(4e-3, 5e-3)
    pushes = LearntPush(5e-3, True), LearntPush(6e-3, True)
    knowledge = ValveKnowledge(
        Ratios(-8e5, -2e4),
        ((0.0, 0.0, 0.0),) * 3,
        1e-5,
        margins=Margins(margin, margin, margin, margin),
        pushes=pushes,
    )
    law = with_learnt(first_memory(settings.law_with_memory, 0.0), knowledge, STROKE_M)
    assert isinstance(law, MoveMemory)
    assert law.slides.margins.onward_up == margin
    assert (law.pulses.up, law.pulses.down) == pushes


@pytest.mark.parametrize(("excitation", "stairs"), [({}, True), ({"kind": "sine"}, False)], ids=["by itself", "asked"])
def test_it_identifies_by_a_staircase_in_a_fast_loop_too(excitation: dict[str, str], *, stairs: bool) -> None:
    """A sine is refused behind a slow I/P, and knows the friction of one direction only."""
    file, _ = settings_at(1e-3)
    asked = file.model_dump(exclude_unset=True) | {"excitation": excitation}
    assert (Settings.of(DaemonFile.model_validate(asked)).staircase is not None) is stairs
