"""The direction that a sine has not seen is not commanded by a guess, on the shipped files, whichever law commands."""

from copy import deepcopy
from dataclasses import replace
from functools import cache

import pytest

from config.codes import InhibitReason, Ne107Cause, Ne107Status, State
from config.loading import SHIPPED
from config.slave_file import Initial, SlaveClock, load_slave
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.cli.demo import by_steps_pu
from positioner.daemon.health import ne107_condition
from positioner.estimation.estimates import Directions
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always
from tests.control.test_frozen_sensor import shipped
from tests.control.virtual_loop import VirtualLoop

SEED = load_valve(shipped_valve("seed")).valve
STROKE_M, AREA_M2 = SEED.stroke_m, SEED.diaphragm_area_m2
UP_DOWN_N = {
    "preload": (SEED.coulomb_n + 600.0, SEED.coulomb_n - 600.0),
    "other preload": (SEED.coulomb_n - 300.0, SEED.coulomb_n + 300.0),
    "asymmetry": (1.15 * SEED.coulomb_n, 0.85 * SEED.coulomb_n),
}
EFFECTS = {
    "preload": {"name": "preload", "force_n": 600.0},
    "other preload": {"name": "preload", "force_n": -300.0},
    "asymmetry": {"name": "asymmetric_friction", "asymmetry": 0.15},
}
ALPHA_PA = {"preload": 60e3, "other preload": 46e3, "asymmetry": 50e3}
"""Enough to break the stem loose, and to leave it below three quarters of its travel."""
WITHIN = 0.02
"""Of the stroke: by which a move may end off its reference, or go beyond it."""


def excited_by_a_sine(effect: str, profile: str, law: str) -> tuple[VirtualLoop, Valve]:
    """Return a shipped daemon after S3, its first reference written at once, and its valve; excited once."""
    return deepcopy(_excited(effect, profile, law))


@cache
def _excited(effect: str, profile: str, law: str) -> tuple[VirtualLoop, Valve]:
    file = shipped(profile, 0, law)
    file = file.model_copy(update={"excitation": file.excitation.model_copy(update={"kind": "sine"})})
    slave = load_slave(SHIPPED / "profiles" / "slave.toml")
    clock = SlaveClock(mode="lockstep", period_s=file.cycle.period_s)
    slave = slave.model_copy(update={"clock": clock, "change": (), "initial": Initial()})
    valve = Valve.from_file(
        ValveFile.model_validate({"valve": SEED.model_dump(), "effect": [EFFECTS[effect]]}), step_s=FINE_STEP_S
    )
    valve.rest_at(0.0, 0.0)
    loop = VirtualLoop(file, Device(valve, slave, {}))
    loop.cycle.requests = replace(loop.cycle.requests, alpha_pa=ALPHA_PA[effect], beta_pa=13e3, omega_rad_per_s=1.0)
    loop.cycles(0.2)
    loop.begin()
    loop.cycles(loop.period_s)
    while loop.decision.state is State.S3_IDENTIFY and loop.decision.progress < 1.0:
        loop.cycles(loop.period_s)
    loop.cycle.requests = replace(loop.cycle.requests, eta=(1, 1, 1))
    loop.refer_to(0.75, 2.0)
    return loop, valve


@pytest.mark.parametrize(
    ("effect", "profile", "law"),
    few_always(
        [
            ("preload", "daemon.toml", "seed"),
            ("other preload", "daemon_canopen.toml", "slides"),
            ("asymmetry", "daemon.toml", "seed"),
            ("preload", "daemon_canopen.toml", "slides"),
            ("other preload", "daemon.toml", "seed"),
            ("asymmetry", "daemon_canopen.toml", "slides"),
        ],
        2,
    ),
)
def test_the_first_move_the_other_way_lands_once_and_goes_on_from_there(effect: str, profile: str, law: str) -> None:
    loop, valve = excited_by_a_sine(effect, profile, law)
    assert loop.decision.applied.ratios is not None
    assert loop.decision.applied.ratios.directions is Directions.UP
    condition = ne107_condition(loop.decision, loop.health)
    assert condition.status is Ne107Status.OUT_OF_SPECIFICATION
    assert condition.causes == (Ne107Cause.ONE_DIRECTION,)

    loop.refer_to(0.45, 0.0)
    off, why = [], set()
    for _ in range(round(4.0 / loop.period_s)):
        loop.cycles(loop.period_s)
        off.append(valve.position_m / STROKE_M - 0.45)
        why.add(loop.why)
    assert min(off) > -WITHIN, "it never goes beyond"
    assert abs(off[-1]) < WITHIN
    assert InhibitReason.ONE_DIRECTION in why
    assert ne107_condition(loop.decision, loop.health).status is Ne107Status.GOOD
    ratios = loop.decision.applied.ratios
    assert ratios is not None
    assert ratios.directions is Directions.BOTH
    assert (ratios.friction_pa(1) * AREA_M2, ratios.friction_pa(-1) * AREA_M2) == pytest.approx(
        UP_DOWN_N[effect], rel=0.02
    )


@pytest.mark.parametrize("way", [0.07, 0.1])
def test_a_first_move_is_left_off_by_less_than_the_papers_law_can_move(way: float) -> None:
    """The stem slides by its own jump and the step that broke it loose: what the demo holds such a move to."""
    loop, valve = excited_by_a_sine("preload", "daemon.toml", "seed")
    stood = valve.position_m / STROKE_M
    loop.refer_to(stood - way, 2.0)
    assert loop.why is not InhibitReason.ONE_DIRECTION
    assert stood - valve.position_m / STROKE_M > way / 2, "it has moved"
    assert abs(valve.position_m / STROKE_M - (stood - way)) < by_steps_pu(SEED)


def test_a_reference_back_the_known_way_ends_the_steps() -> None:
    loop, valve = excited_by_a_sine("preload", "daemon.toml", "seed")
    seen = []
    for reference_pu, for_s in ((0.45, 0.1), (0.85, 1.0)):
        loop.refer_to(reference_pu, for_s)
        seen.append((loop.why, loop.decision.one_direction))
    assert seen == [(InhibitReason.ONE_DIRECTION, True), (InhibitReason.NOTHING, True)], "nothing has landed downward"
    assert abs(valve.position_m / STROKE_M - 0.85) < 1e-3


def test_a_law_that_does_not_command_by_friction_needs_no_landing() -> None:
    loop, valve = excited_by_a_sine("preload", "daemon.toml", "conventional")
    assert not loop.decision.one_direction
    loop.refer_to(0.45, 2.0)
    assert loop.why is not InhibitReason.ONE_DIRECTION
    assert abs(valve.position_m / STROKE_M - 0.45) < WITHIN
