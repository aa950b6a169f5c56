"""S3 by a staircase finds a packing that needs more than the spring takes over the stroke, by its own slides."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import pytest

from config.codes import Fault, InhibitReason, Refusal, State
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from drivers.in_memory import Plant
from positioner.control.controller_memory import Decision
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always
from tests.control.other_plant import SEED_LIKE, OtherPlant, with_friction
from tests.control.virtual_loop import VirtualLoop

PERIOD_S = 0.02
STROKE_M = SEED_LIKE.stroke_m


def excited(plant: Plant, maximum_pa: float) -> VirtualLoop:
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
    while loop.decision.state is State.S3_IDENTIFY and loop.decision.progress < 1.0:
        loop.cycles(PERIOD_S)
    return loop


def identified(plant: Plant, maximum_pa: float) -> Decision:
    loop = excited(plant, maximum_pa)
    loop.end()
    return loop.decision


def seed_valve(factor: float, at_pu: float) -> Plant:
    file = load_valve(shipped_valve("seed"))
    valve = Valve.from_file(file, step_s=FINE_STEP_S)
    valve.change(coulomb_n=factor * file.valve.coulomb_n, static_n=factor * file.valve.static_n)
    valve.rest_at(at_pu * STROKE_M, at_pu * STROKE_M * file.valve.spring_n_per_m / file.valve.diaphragm_area_m2)
    slave = {"clock": {"mode": "lockstep", "period_s": PERIOD_S}, "sensor": {"noise_std_m": 1e-4 * STROKE_M, "seed": 1}}
    return Device(valve, SlaveFile.model_validate(slave), {})


def heavy_valve(factor: float, at_pu: float) -> Plant:
    heavy = replace(with_friction(SEED_LIKE, factor), mass_kg=60.0)
    return OtherPlant(heavy, PERIOD_S, at_pu=at_pu, noise_std_m=1e-5)


def other_valve(factor: float, at_pu: float) -> Plant:
    return OtherPlant(with_friction(SEED_LIKE, factor), PERIOD_S, at_pu=at_pu, noise_std_m=1e-5)


FACTORS_AT = ((2.0, 0.3), (2.0, 0.5), (2.0, 0.86), (2.5, 0.15), (2.5, 0.5), (1.0, 0.5), (1.5, 0.5))
FIRST = [(2.0, 0.3, 140e3, seed_valve), (2.0, 0.3, 420e3, other_valve)]
REST = [(*each, *how) for each, *how in product(FACTORS_AT, (140e3, 420e3), (seed_valve, other_valve))]


@pytest.mark.parametrize(("factor", "at_pu", "maximum_pa", "valve"), few_always([*FIRST, *REST], len(FIRST)))
def test_friction_that_has_doubled_is_found(
    factor: float, at_pu: float, maximum_pa: float, valve: Callable[[float, float], Plant]
) -> None:
    """The first turn needs F_c + F_s: 97 kPa of the doubled packing, where the spring takes 83 over the stroke.

    From 0.3 the first slide ends where no pressure takes the stem down again: the staircase turns twice, and the slide
    that goes on needs less than a turn. From 0.5 a packing of 2.5 times then needs 2 F_s. From 0.86 the stem comes off
    its stop, and the first landings are downward.
    """
    found = identified(valve(factor, at_pu), maximum_pa)
    assert (found.fault, found.applied.count) == (Fault.NONE, 1)
    assert found.applied.ratios is not None
    friction_pa = factor * SEED_LIKE.coulomb_n / SEED_LIKE.area_m2
    assert -found.applied.ratios.k_over_c == pytest.approx(friction_pa, rel=0.01)


def test_a_heavy_stem_that_gives_way_before_it_slides_is_found_within_its_deviations() -> None:
    """Its slide did not count, for friction was taken up in the same rise: the staircase turned round, in vain."""
    found = identified(heavy_valve(2.0, 0.3), 420e3)
    assert (found.fault, found.applied.count) == (Fault.NONE, 1)
    friction_pa = 2.0 * SEED_LIKE.coulomb_n / SEED_LIKE.area_m2
    for each in (found.static_law.up, found.static_law.down):
        assert each.value == pytest.approx(friction_pa, abs=3.0 * each.std)
    assert max(found.static_law.up.std, found.static_law.down.std) < 0.05 * friction_pa


@pytest.mark.parametrize(
    ("plant", "maximum_pa"),
    [(seed_valve(3.0, 0.5), 140e3), (heavy_valve(3.0, 0.3), 420e3)],
)
def test_friction_that_has_tripled_is_named_where_the_pressure_does_not_suffice(
    plant: Plant, maximum_pa: float
) -> None:
    """A turn needs 145 kPa: the landings are too few both ways, and it is not the valve's law that is crooked."""
    loop = excited(plant, maximum_pa)
    assert loop.decision.inhibit_reason is InhibitReason.STAIRCASE_LIMITED
    loop.end()
    assert loop.decision.static_law.reason is Refusal.LANDINGS_TOO_FEW
