"""Each effect's equation against a truth computed by hand, on the valve with the whole library in its places."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sim.effect import read_effect
from sim.effects import dead_time, quadratic_drag, spring_hardening
from sim.first_order_lag import lagged
from sim.karnopp import Vector
from sim.open_loop import respond
from tests.sim.library import SEED, Series, library, plain, valve_with

A, k_s, m = SEED.valve.diaphragm_area_m2, SEED.valve.spring_n_per_m, SEED.valve.mass_kg
F_c, F_s, F_v = SEED.valve.coulomb_n, SEED.valve.static_n, SEED.valve.viscous_ns_per_m
STROKE = SEED.valve.stroke_m
X = 0.05
S = X / STROKE
STAIRS = np.repeat(np.array([30e3, 60e3, 58e3, 62e3, 20e3, 80e3, 10e3]), 150)


@pytest.mark.parametrize(
    ("name", "parameters", "opening_pa", "closing_pa"),
    [
        ("preload", {"force_n": 300.0}, (k_s * X + 300.0 + F_s) / A, (k_s * X + 300.0 - F_s) / A),
        (
            "spring_hardening",
            {"cubic_n_per_m3": 4e6},
            (k_s * X + 500.0 + F_s) / A,
            (k_s * X + 500.0 - F_s) / A,
        ),
        (
            "area_variation",
            {"change_m2": -0.01, "travel_m": STROKE},
            (k_s * X + F_s) / (A - 0.01 * S),
            (k_s * X - F_s) / (A - 0.01 * S),
        ),
        (
            "flow_force",
            {"force_n": 900.0, "travel_m": STROKE},
            (k_s * X - 900.0 * S**2 + F_s) / A,
            (k_s * X - 900.0 * S**2 - F_s) / A,
        ),
        ("stribeck", {"excess_n": 200.0}, (k_s * X + F_s + 200.0) / A, (k_s * X - F_s - 200.0) / A),
        (
            "position_friction",
            {"growth": -0.4, "travel_m": STROKE},
            (k_s * X + F_s * (1 - 0.4 * S)) / A,
            (k_s * X - F_s * (1 - 0.4 * S)) / A,
        ),
        (
            "pressure_friction",
            {"growth_n_per_pa": 0.005},
            (k_s * X + F_s) / (A - 0.005),
            (k_s * X - F_s) / (A + 0.005),
        ),
        ("dwell_stiction", {"growth_n": 250.0}, (k_s * X + F_s + 250.0) / A, (k_s * X - F_s - 250.0) / A),
    ],
)
def test_the_force_at_which_it_breaks_away(
    name: str, parameters: dict[str, float], opening_pa: float, closing_pa: float
) -> None:
    valve = valve_with(name, **parameters)
    for border_pa, direction in ((opening_pa, 1.0), (closing_pa, -1.0)):
        for shift, moves in ((-1e-4, False), (1e-4, True)):
            valve.rest_at(X)
            valve.advance(border_pa * (1.0 + direction * shift), 5e-3)
            assert direction * (valve.position_m - X) > 1e-7 if moves else abs(valve.position_m - X) < 1e-7


Law = Callable[[Series, Series, Series, Series], Series]


@pytest.mark.parametrize(
    ("name", "parameters", "extra_n"),
    [
        ("preload", {"force_n": 300.0}, lambda t, x, v, p: -300.0),
        ("spring_hardening", {"cubic_n_per_m3": 4e6}, lambda t, x, v, p: -4e6 * x**3),
        ("area_variation", {"change_m2": 0.01, "travel_m": STROKE}, lambda t, x, v, p: 0.01 * x / STROKE * p),
        ("flow_force", {"force_n": -900.0, "travel_m": STROKE}, lambda t, x, v, p: -900.0 * (x / STROKE) ** 2),
        ("quadratic_drag", {"drag_ns2_per_m2": 2e3}, lambda t, x, v, p: -2e3 * v * np.abs(v)),
        ("asymmetric_friction", {"asymmetry": 0.2}, lambda t, x, v, p: -0.2 * F_c),
        (
            "position_friction",
            {"growth": 0.5, "travel_m": STROKE},
            lambda t, x, v, p: -np.sign(v) * F_c * 0.5 * x / STROKE,
        ),
        ("pressure_friction", {"growth_n_per_pa": 0.005}, lambda t, x, v, p: -np.sign(v) * 0.005 * p),
        ("friction_drift", {"rate_per_s": 0.1}, lambda t, x, v, p: -np.sign(v) * F_c * 0.1 * t),
        (
            "stribeck",
            {"excess_n": 200.0, "velocity_m_per_s": 0.2, "exponent": 1.5},
            lambda t, x, v, p: -np.sign(v) * 200.0 * np.exp(-((np.abs(v) / 0.2) ** 1.5)),
        ),
        ("dwell_stiction", {"growth_n": 250.0}, lambda t, x, v, p: 0.0),
    ],
)
@pytest.mark.parametrize("command_pa", [90e3, 0.0], ids=["opening", "closing"])
def test_the_force_along_a_slip(name: str, parameters: dict[str, float], extra_n: Law, command_pa: float) -> None:
    valve = valve_with(name, **parameters)
    valve.advance(0.0, 2.0)
    valve.rest_at(X)
    h = 2e-5
    path = valve.run(np.full(1500, command_pa), h)
    t, x, v, p = path.time_s[1:-1], path.position_m[1:-1], path.velocity_m_per_s[1:-1], path.pressure_pa[1:-1]
    net = A * p - k_s * x - F_v * v - np.sign(v) * F_c + extra_n(t, x, v, p)
    inertia = m * (path.velocity_m_per_s[2:] - path.velocity_m_per_s[:-2]) / (2.0 * h)
    sliding = np.abs(path.velocity_m_per_s[:-2]) > 0.02
    assert sliding.sum() > 1000
    assert np.ptp(x) > 5e-3
    assert np.abs(inertia - net)[sliding].max() < 0.5, "which is what the central difference leaves"


def test_the_spring_and_the_drag_work_both_ways() -> None:
    spring, drag = spring_hardening.Parameters(4e6), quadratic_drag.Parameters(2e3)
    assert spring_hardening.force(0.05, spring) == pytest.approx(-500.0)
    assert spring_hardening.force(-0.05, spring) == pytest.approx(500.0)
    assert quadratic_drag.force(0.5, drag) == pytest.approx(-500.0)
    assert quadratic_drag.force(-0.5, drag) == pytest.approx(500.0)


@pytest.mark.parametrize(("rate", "at_s", "left"), [(0.1, 3.0, 1.3), (-0.1, 4.0, 0.6), (-1.0, 2.0, 0.0)])
def test_friction_drifts_on_and_stops_at_none(rate: float, at_s: float, left: float) -> None:
    for more_n, moves in ((-1.0, False), (1.0, True)):
        valve = valve_with("friction_drift", rate_per_s=rate)
        valve.advance(0.0, at_s)
        valve.advance((k_s * valve.position_m + left * F_s + more_n) / A, 1e-3)
        assert (valve.position_m > 1e-8) == moves


@pytest.mark.parametrize("hold_s", [0.01, 0.5, 2.0])
def test_stiction_grows_with_the_hold(hold_s: float) -> None:
    for factor, moves in ((0.999, False), (1.001, True)):
        valve = valve_with("dwell_stiction", growth_n=400.0, time_constant_s=0.5)
        slip = valve.run(np.full(1500, 60e3), 1e-4)
        x = valve.position_m
        stuck_s = slip.time_s[np.flatnonzero(slip.velocity_m_per_s)[-1]]
        assert 0.01 < stuck_s < 0.15
        valve.advance(k_s * x / A, hold_s)
        rested_s = valve.time_s - stuck_s
        level = F_s - 400.0 * math.expm1(-rested_s / 0.5)
        valve.advance((k_s * x - factor * level) / A, 2e-4)
        assert (x - valve.position_m > 1e-8) == moves


@pytest.mark.parametrize("periods", [1, 7, 40])
def test_dead_time_is_the_same_record_later(periods: int) -> None:
    prompt = valve_with("dead_time", dead_time_s=0.0).run(STAIRS, 1e-3)
    late = valve_with("dead_time", dead_time_s=periods * 1e-3).run(STAIRS, 1e-3)
    assert late.pressure_pa[periods + 1 :].tolist() == prompt.pressure_pa[1:-periods].tolist()
    assert late.position_m[periods:].tolist() == prompt.position_m[:-periods].tolist()
    assert not late.pressure_pa[: periods + 1].any()
    assert np.ptp(prompt.position_m) > 0.03


def test_dead_time_behind_a_lag_is_the_lag_s_answer_later() -> None:
    """The ring joins stretches here: 12 500 steps of 40 us pass within the dead time."""
    composition = library()
    theta = composition.changed(composition.theta, {"ip_lag.time_constant_s": 0.1})
    prompt = respond(composition, theta, STAIRS, 2e-3).pressure_pa
    delayed = through_dead_time(prompt, 2e-3, 0.5)
    np.testing.assert_allclose(delayed[250:], prompt[:-250], atol=1e-3 * np.ptp(prompt))


def test_joined_stretches_of_a_ramp_are_the_ramp() -> None:
    ramp = np.asarray(200.0 * np.arange(400), dtype=np.float64)
    np.testing.assert_allclose(through_dead_time(ramp, 2e-3, 0.5)[250:], ramp[:-250], atol=1e-6)


def through_dead_time(samples: Series, period_s: float, dead_time_s: float) -> Series:
    """Pass straight lines between samples through a dead time, 50 steps a period; return its output at the samples."""
    q, z = dead_time.Parameters(dead_time_s), np.zeros(dead_time.MEMORY)
    dead_time.start(0.0, float(samples[0]), z)
    h, out = period_s / 50, [float(samples[0])]
    for i in range(samples.size - 1):
        line = np.linspace(samples[i], samples[i + 1], 51)
        for k in range(50):
            t = i * period_s + k * h
            dead_time.advance(t, float(line[k]), float(line[k + 1]), h, q, z)
        out.append(dead_time.pressure(float(line[-1]), t + h, t + 0.5 * h, q, z))
    return np.array(out)


def test_the_dead_time_s_ring_forgets_only_what_is_past() -> None:
    commands = np.arange(20000.0) % 97.0
    q, z, h = dead_time.Parameters(0.4), np.zeros(dead_time.MEMORY), 1e-4
    dead_time.start(0.0, 0.0, z)
    for i, u in enumerate(commands.tolist()):
        shown = dead_time.pressure(u, i * h, (i + 0.5) * h, q, z)
        dead_time.advance(i * h, u, u, h, q, z)
        assert (
            shown == dead_time.pressure(u, (i + 1) * h, (i + 0.5) * h, q, z) == (commands[i - 4000] if i >= 4000 else 0)
        )
    assert z[dead_time.COUNT] > 4 * dead_time.STRETCHES


def test_a_rate_limit_fills_and_vents_at_its_own_rates() -> None:
    valve = valve_with("rate_limit", filling_pa_per_s=100e3, venting_pa_per_s=400e3)
    response = valve.run(np.repeat([50e3, 10e3], 1000), 1e-3)
    t = response.time_s
    expected = np.where(t < 1.0 + 5e-4, np.minimum(100e3 * t, 50e3), np.maximum(50e3 - 400e3 * (t - 1.0), 10e3))
    np.testing.assert_allclose(response.pressure_pa, expected, rtol=1e-9, atol=1e-6)
    slow = valve_with("rate_limit", filling_pa_per_s=100e3, venting_pa_per_s=400e3)
    ramp = np.linspace(0.0, 90e3, 1000)
    np.testing.assert_allclose(slow.run(ramp, 1e-3).pressure_pa[1:], ramp, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("dead_time_s", [3.43e-3, 0.43e-3, 3e-3, 1e-9, 0.0])
def test_a_step_ends_where_a_delayed_jump_comes_out(dead_time_s: float) -> None:
    q, z, h = dead_time.Parameters(dead_time_s), np.zeros(dead_time.MEMORY), 1e-3
    dead_time.start(0.0, 0.0, z)
    t = 0.0
    for i in range(6):
        while t < (i + 1) * h - 1e-12:
            s = dead_time.straight(5e4, (i + 1) * h - t, t, q, z)
            begins = dead_time.pressure(5e4, t, t + 0.5 * s, q, z)
            dead_time.advance(t, 5e4, 5e4, s, q, z)
            ends = dead_time.pressure(5e4, t + s, t + 0.5 * s, q, z)
            assert begins == ends == (5e4 if t + 0.5 * s > dead_time_s else 0.0)
            assert not t + 1e-9 < dead_time_s < t + s - 1e-9
            t += s
        assert t == pytest.approx((i + 1) * h, abs=1e-12)


def steps_cut(dead_time_s: float, rate_pa_per_s: float, swing_pa: float) -> int:
    """Return in how many steps 100 periods of 5 ms go of a ramp that swings, behind a dead time."""
    q, z, h, t, steps = dead_time.Parameters(dead_time_s), np.zeros(dead_time.MEMORY), 5e-3, 0.0, 0

    def enters(t: float) -> float:
        return 4e4 + rate_pa_per_s * t + swing_pa * float(np.sin(20.0 * t))

    dead_time.start(0.0, enters(0.0), z)
    for i in range(100):
        while t < (i + 1) * h - 1e-12:
            s = dead_time.straight(enters(t), (i + 1) * h - t, t, q, z)
            dead_time.advance(t, enters(t), enters(t + s), s, q, z)
            t, steps = t + s, steps + 1
    return steps


@pytest.mark.parametrize("dead_time_s", [1e-3, 3e-3, 1.23e-2])
def test_what_hardly_bends_ends_no_step(dead_time_s: float) -> None:
    """As a positioner's pressure does: each step was cut into five to ten."""
    assert steps_cut(dead_time_s, 300.0, 10.0) == 100
    assert steps_cut(dead_time_s, 300.0, 1e4) > 100


@pytest.mark.parametrize("dead_time_s", [1.3e-5, 5.637e-4, 7.3e-3])
def test_behind_a_lag_no_step_is_cut_without_end(dead_time_s: float) -> None:
    """Each step's end came out one dead time later and ended another there: a run through a record took minutes."""
    q, z, h = dead_time.Parameters(dead_time_s), np.zeros(dead_time.MEMORY), 2e-3
    dead_time.start(0.0, 0.0, z)
    t, u = 0.0, 0.0
    for i in range(300):
        steps = 0
        while (left := (i + 1) * h - t) > 1e-12:
            s = dead_time.straight(u, left, t, q, z)
            before, u = u, lagged(u, 5e4, 5e4, s, 0.1)
            dead_time.advance(t, before, u, s, q, z)
            t, steps = t + s, steps + 1
        assert steps <= 12


def test_a_dead_time_that_is_short_for_a_step_does_not_cut_a_ramp() -> None:
    q, z, h = dead_time.Parameters(1e-6), np.zeros(dead_time.MEMORY), 1e-3
    dead_time.start(0.0, 0.0, z)
    dead_time.advance(0.0, 0.0, 30.0, h, q, z)
    rounded = 30.0 * (1.0 + 1e-15)
    assert dead_time.straight(rounded, h, h, q, z) == h
    assert dead_time.pressure(rounded, h, 1.5 * h, q, z) == pytest.approx(30.0 - 30e3 * 1e-6)
    assert dead_time.straight(31.0, h, h, q, z) == 1e-6


@pytest.mark.parametrize("dead_time_s", [1e-7, 1e-5, 1.3e-4, 0.9e-3, 3.1e-3])
def test_a_short_dead_time_behind_a_lag_is_the_lag_s_answer_later(dead_time_s: float) -> None:
    composition = library()
    lag = composition.changed(composition.theta, {"ip_lag.time_constant_s": 0.1})
    late = composition.changed(lag, {"dead_time.dead_time_s": dead_time_s})
    shown = respond(composition, late, STAIRS, 2e-3, step_s=2e-3).pressure_pa
    prompt = respond(composition, lag, STAIRS, 2e-3)
    expected = np.interp(prompt.time_s - dead_time_s, prompt.time_s, prompt.pressure_pa)
    np.testing.assert_allclose(shown, expected, atol=3e-3 * np.ptp(expected))


def test_a_limited_rate_that_ends_inside_a_step_comes_out_right() -> None:
    composition = library()
    limits = {"rate_limit.filling_pa_per_s": 713e3, "rate_limit.venting_pa_per_s": 1.9e6}
    theta = composition.changed(composition.theta, limits)
    coarse, fine = (respond(composition, theta, STAIRS, 5e-3, step_s=step_s).position_m for step_s in (1e-3, 1e-5))
    assert np.ptp(fine) > 0.03
    assert np.abs(coarse - fine).max() < 3e-5


def test_the_supply_limit_cuts_both_ends() -> None:
    valve = valve_with("supply_limit", supply_pa=50e3, exhaust_pa=5e3)
    assert valve.run([40e3, 60e3, 50e3, 0.0, 6e3], 0.1).pressure_pa.tolist() == [5e3, 40e3, 50e3, 50e3, 5e3, 6e3]


@pytest.mark.parametrize(
    ("name", "parameters", "law"),
    [
        ("sensor_offset", {"offset_m": -2e-3}, lambda x: x - 2e-3),
        ("sensor_gain", {"gain": 1.1}, lambda x: 1.1 * x),
        (
            "sensor_nonlinearity",
            {"bow_m": 4e-3, "travel_m": 0.05},
            lambda x: x + np.where(x < 0.05, 4.0 * 4e-3 * x * (0.05 - x) / 0.05**2, 0.0),
        ),
        ("quantisation", {"quantum_m": 1e-3}, lambda x: np.floor(x * 1e3 + 0.5) * 1e-3),
    ],
)
def test_what_the_sensor_indicates(name: str, parameters: dict[str, float], law: Callable[[Series], Series]) -> None:
    response = valve_with(name, **parameters).run(STAIRS, 1e-3)
    assert response.position_m.min() >= 0.0
    assert response.position_m.max() > 0.055
    np.testing.assert_allclose(response.indicated_m, law(response.position_m), rtol=1e-12, atol=1e-15)


def test_the_sensor_s_lag_creeps_on_when_the_stem_has_stuck() -> None:
    response = valve_with("sensor_lag", time_constant_s=0.05).run(np.full(400, 60e3), 1e-3)
    stuck = np.flatnonzero(response.velocity_m_per_s)[-1] + 1
    t, left = response.time_s[stuck:], (response.position_m - response.indicated_m)[stuck:]
    assert left[0] > 1e-3
    np.testing.assert_allclose(left, left[0] * np.exp(-(t - t[0]) / 0.05), rtol=1e-7)
    rate = np.gradient(response.indicated_m, 1e-3)[5:-5]
    gap = (response.position_m - response.indicated_m)[5:-5]
    assert np.abs(0.05 * rate - gap).max() < 0.02 * gap.max()


def test_a_sensor_s_time_is_that_of_its_signal(tmp_path: Path) -> None:
    clock, slope = tmp_path / "clock.py", tmp_path / "slope.py"
    clock.write_text("def sensor(y, t):\n    return y + t\n")
    slope.write_text(
        "MEMORY = 1\n"
        "def start(z):\n    z[0] = 0.0\n"
        "def sensor(y, z):\n    return y + 100.0 * z[0]\n"
        "def advance(before, after, h, z):\n    z[0] = (after - before) / h\n"
    )
    stuck: Vector = np.zeros(5)
    path = plain([read_effect(clock), read_effect(slope)])((), stuck, 1e-3, 1e-4)
    np.testing.assert_allclose(path[4], path[0] + [0.0, *[100.0] * 5], rtol=1e-9, atol=1e-15)
