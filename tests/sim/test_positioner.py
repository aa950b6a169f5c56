"""The positioner element between set point and pressure, on the seed's valve with little friction."""

import numpy as np
import pytest

from config.errors import InputError
from config.valve_file import ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.simulation import simulate
from sim.static_inverse import extended_valve
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed")).valve
PA_PER_M = SEED.spring_n_per_m / SEED.diaphragm_area_m2
TABLE = {
    "name": "positioner",
    "gain_pa_per_ms": 2.0 * PA_PER_M,
    "integral_time_s": 1e6,
    "dead_band_m": 0.0,
    "filling_pa_per_s": 2e4,
    "venting_pa_per_s": 1e4,
    "supply_pa": 2e5,
    "shut_below_m": -100.0,
    "open_above_m": 100.0,
}


def valve_file(friction_n: float = 1.0, **changed: float) -> ValveFile:
    base = SEED.model_dump() | {"coulomb_n": friction_n, "static_n": friction_n}
    return ValveFile.model_validate({"valve": base, "effect": [TABLE | changed]})


def settled_m(setpoint_m: float, friction_n: float = 1.0, **changed: float) -> float:
    valve = Valve.from_file(valve_file(friction_n, **changed))
    valve.advance(setpoint_m, 30.0)
    return valve.position_m


def test_the_stem_arrives_at_its_set_point() -> None:
    assert settled_m(0.05) == pytest.approx(0.05, abs=1e-4)


def test_within_the_dead_band_nothing_is_answered_and_beyond_it_stops_at_its_edge() -> None:
    assert settled_m(0.002, dead_band_m=0.005) == 0.0
    assert settled_m(0.05, dead_band_m=0.005) == pytest.approx(0.05 - 0.0025, abs=1e-4)


def test_the_pilot_fills_and_vents_no_faster_than_its_flow() -> None:
    valve = Valve.from_file(valve_file())
    valve.advance(0.1, 1.0)
    assert valve.pressure_pa == pytest.approx(2e4)
    valve.advance(-0.1, 1.0)
    assert valve.pressure_pa == pytest.approx(1e4)


@pytest.mark.parametrize(("setpoint_m", "pressure_pa"), [(0.001, 0.0), (0.099, 2e5)])
def test_beyond_the_cut_offs_it_shuts_tight_and_opens_wide(setpoint_m: float, pressure_pa: float) -> None:
    valve = Valve.from_file(valve_file(shut_below_m=0.002, open_above_m=0.098))
    valve.rest_at(0.05)
    valve.advance(setpoint_m, 30.0)
    assert valve.pressure_pa == pressure_pa


def test_with_an_integral_it_goes_on_inside_what_friction_holds() -> None:
    """For the same error, that friction does not let go, the pressure rises ever faster."""
    pressures = []
    for integral_time_s in (1e6, 0.5):
        valve = Valve.from_file(valve_file(1e4, integral_time_s=integral_time_s, gain_pa_per_ms=1e5))
        valve.advance(0.05, 1.0)
        pressures.append(valve.pressure_pa)
    assert pressures[0] == pytest.approx(1e5 * 0.05, rel=0.01)
    assert pressures[1] == pytest.approx(1e5 * 0.05 * (1.0 + 1.0 / (2.0 * 0.5)), rel=0.01)


def test_friction_makes_it_late_and_jump() -> None:
    valve = Valve.from_file(valve_file(500.0))
    valve.advance(0.004, 0.1)
    assert valve.position_m == 0.0
    assert settled_m(0.05, 500.0) == pytest.approx(0.05, abs=2.0 * 500.0 / SEED.spring_n_per_m)


def test_it_must_stand_first_in_the_pressure_path() -> None:
    late = valve_file().model_dump()
    late["effect"] = [{"name": "ip_lag", "time_constant_s": 0.1}, TABLE]
    with pytest.raises(InputError, match="positioner obeys a set point: it must stand before ip_lag"):
        Composition.from_file(ValveFile.model_validate(late))


def test_a_simulated_recording_says_that_it_is_of_set_points() -> None:
    recording = simulate(valve_file(), np.arange(20.0), np.full(20, 0.03))
    assert recording.by_setpoint
    with pytest.raises(InputError, match="column command_pa is missing: it has a set point, reference_m"):
        _ = recording.command_pa


def test_a_daemon_cannot_command_through_it() -> None:
    with pytest.raises(InputError, match="effect positioner declares no inverse"):
        extended_valve(valve_file(), "valve.toml")


def test_the_integral_does_not_wind_up_while_the_pilot_is_at_its_limit() -> None:
    """At 1.5 s the limit is reached, with an integral of 0.05 m 1.5 s / 0.5 s = 0.15 m; it stays that."""
    valve = Valve.from_file(valve_file(1e4, integral_time_s=0.5, gain_pa_per_ms=1e5))
    valve.advance(0.05, 2.0)
    before_pa = valve.pressure_pa
    valve.advance(-0.001, 0.01)
    assert valve.pressure_pa - before_pa == pytest.approx(1e5 * (0.15 - 0.001) * 0.01, rel=0.02)
