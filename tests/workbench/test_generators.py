"""The generators of valves that are not ours: they agree with ours where they must, and obey mechanics."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from config.valve_file import EffectTable, ValveFile, ValveParameters
from signals.moves import slips
from sim.composition import Composition
from sim.effect import shipped_effects
from sim.open_loop import at_rest, follow
from tests.workbench.generators import CASES, CLEAN, DIRTY, KINDS, LAWS, SMOOTH, Plant, Series, case
from tests.workbench.generators import follow as followed
from workbench.blind.input_signal import excitation
from workbench.data.noise_floor import repeatability_m

pytestmark = pytest.mark.long

PERIOD_S = 0.01
SAME = Plant(law=SMOOTH, v_s=1e-2)
"""The law that has our valve as its limit, smoothing to zero."""
FINE_S = 2e-5
LONG_ENOUGH = 401
"""Samples in which an effect has shown, if it does."""
LIMIT_M = 5e-5
"""Agreement, rms: what the smooth law creeps while ours stands."""
OURS: Mapping[str, Mapping[str, float]] = {
    "ip_lag": {"time_constant_s": 0.06},
    "dead_time": {"dead_time_s": 0.05},
    "rate_limit": {"filling_pa_per_s": 1.2e5, "venting_pa_per_s": 8e4},
    "preload": {"force_n": 250.0},
    "spring_hardening": {"cubic_n_per_m3": 1.5e6},
    "quadratic_drag": {"drag_ns2_per_m2": 6000.0},
    "asymmetric_friction": {"asymmetry": 0.15},
    "position_friction": {"growth": 0.6, "travel_m": 0.1016},
    "pressure_friction": {"growth_n_per_pa": 4e-3},
    "backlash": {"width_m": 1.5e-3},
    "sensor_lag": {"time_constant_s": 0.08},
}


def parameters(plant: Plant) -> ValveParameters:
    return ValveParameters(
        name="same",
        mass_kg=plant.m,
        diaphragm_area_m2=plant.A,
        spring_n_per_m=plant.k_s,
        viscous_ns_per_m=plant.F_v,
        coulomb_n=plant.F_c,
        static_n=plant.F_s,
        stribeck_velocity_m_per_s=plant.v_s,
        deadzone_ratio=0.02,
        stroke_m=plant.stroke_m,
    )


def command(count: int = 401, seed: int = 3) -> Series:
    return excitation(parameters(SAME), np.random.default_rng(seed), count)


def quiet(count: int) -> tuple[Series, Series]:
    """No extra force, no jitter."""
    return np.zeros(count), np.ones(1)


def theirs(plant: Plant, command_pa: Series, fine_s: float = FINE_S, period_s: float = PERIOD_S) -> Series:
    return followed(plant, command_pa, *quiet(command_pa.size), period_s, fine_s)


def ours(file: ValveFile, command_pa: Series, period_s: float = PERIOD_S, start_m: float | None = None) -> Series:
    composition = Composition.from_file(file)
    theta = composition.theta.copy()
    balanced_m = SAME.A * command_pa[0] / SAME.k_s
    state = at_rest(composition, theta, 0.0, balanced_m if start_m is None else start_m, float(command_pa[0]))
    return follow(composition, theta, state, command_pa[:-1], period_s, 1e-5).indicated_m


@cache
def bare() -> Series:
    """What the generator makes of `SAME` without an effect, by the first command."""
    made: Series = theirs(SAME, command())[0]
    return made


def rms(error: Series) -> float:
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_smooth_law_is_our_bare_valve(seed: int) -> None:
    command_pa = command(seed=seed)
    karnopp = ours(ValveFile(valve=parameters(SAME)), command_pa)
    assert np.ptp(karnopp) > 0.5 * SAME.stroke_m
    error = rms(theirs(SAME, command_pa)[0] - karnopp)
    assert error < LIMIT_M, error


def test_stiff_bristles_come_ever_closer_to_our_bare_valve() -> None:
    """On slow ramps in steps of 1 ms; the rest is break-away that falls with the rate, LuGre's own."""
    up = np.linspace(5e3, 95e3, 4000)
    ramps = np.concatenate([up, up[::-1]])
    karnopp = ours(ValveFile(valve=parameters(SAME)), ramps, 1e-3)
    errors = [
        rms(theirs(Plant(v_s=SAME.v_s, presliding_m=softness_m), ramps, fine_s, 1e-3)[0] - karnopp)
        for softness_m, fine_s in ((1e-4, 1e-5), (1e-5, 2e-6))
    ]
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 1e-4, errors


@pytest.mark.parametrize("name", OURS)
def test_an_effect_written_again_is_ours(name: str) -> None:
    """Two programs, two integrators, two friction laws: the same motion."""
    kind, command_pa = KINDS[name], command()
    late = np.concatenate([np.full(kind.dead_samples, command_pa[0]), command_pa])[: command_pa.size]
    with_it = theirs(SAME._replace(**kind.hidden), late)[0]
    table = EffectTable.model_validate({"name": name, **OURS[name]})
    extended = ValveFile(valve=parameters(SAME), effect=(table,))
    error = rms(with_it - ours(extended, command_pa, start_m=float(with_it[0])))
    assert error < 2.0 * LIMIT_M, error
    assert rms(with_it - bare()) > 10.0 * LIMIT_M


def test_the_integrator_agrees_with_scipys() -> None:
    """LuGre once more as an initial value problem, by an implicit method, from break-away through a slip to rest."""
    P = Plant()
    u, s_0 = 35e3, P.F_s / P.presliding_m

    def rates(_: float, y: Series) -> list[float]:
        x, v, z = y
        dz = v - s_0 * abs(v) * z / (P.F_c + (P.F_s - P.F_c) * np.exp(-((v / P.v_s) ** 2)))
        friction = s_0 * z + 2.0 * np.sqrt(s_0 * P.m) * dz
        return [v, (P.A * u - P.k_s * x - P.F_v * v - friction) / P.m, dz]

    x_0 = P.A * 1e3 / P.k_s
    times = np.linspace(0.0, 0.1, 11)
    reference = solve_ivp(rates, (0.0, 0.1), [x_0, 0.0, 0.0], "BDF", t_eval=times, rtol=1e-8, atol=1e-12)
    command_pa = np.concatenate([[1e3], np.full(11, u)])
    mine = followed(P, command_pa, *quiet(12), PERIOD_S, 2e-5)[1]
    assert reference.success
    assert abs(reference.y[0, -1] - x_0) > 5e-3
    assert np.max(np.abs(mine[1:] - reference.y[0])) < 1e-7


@pytest.mark.parametrize("law", LAWS)
def test_friction_dissipates_what_coulomb_and_viscosity_demand(law: str) -> None:
    """Work of the pressure = spring and kinetic energy + F_v v^2 + between F_c and F_s over the path."""
    P = Plant(**LAWS[law])
    period_s = 2e-4
    command_pa = np.repeat(command(401), 50)
    _, x, v, p = followed(P, command_pa, *quiet(command_pa.size), period_s, 2e-5)
    work = float(np.sum(P.A * p[1:] * np.diff(x)))
    stored = 0.5 * P.k_s * (x[-1] ** 2 - x[0] ** 2) + 0.5 * P.m * (v[-1] ** 2 - v[0] ** 2)
    viscous = float(np.sum(P.F_v * v**2) * period_s)
    path = float(np.sum(np.abs(np.diff(x))))
    by_friction = (work - stored - viscous) / path
    assert path > 0.3
    assert 0.98 * P.F_c < by_friction < P.F_s, by_friction


def test_only_lugre_creeps_under_a_swinging_force_below_break_away() -> None:
    """What the elasto-plastic law was made for: no drift of the stuck stem."""
    swing = 5e3 + 4e3 * np.sin(np.arange(3000) * 0.3)
    drift = {}
    for law in ("lugre", "elasto_plastic"):
        P = Plant(**LAWS[law])
        x = followed(P, np.concatenate([[0.0], swing]), *quiet(3001), PERIOD_S, 2e-5)[1]
        drift[law] = abs(float(np.mean(x[-210:]) - np.mean(x[300:510])))
    assert drift["elasto_plastic"] < 1e-7
    assert drift["lugre"] > 10.0 * drift["elasto_plastic"]


@pytest.mark.parametrize(("kind", "law"), [each for each in CASES if each[1] == "lugre" or each[0] == "bent_stem"])
def test_what_is_hidden_shows(kind: str, law: str) -> None:
    made = case(kind, law=law, duration_s=10.0)
    position_m, command_pa = made.fit.position_m, made.fit.command_pa[:LONG_ENOUGH]
    assert np.isfinite(position_m).all()
    found = slips(position_m, CLEAN.noise_m)
    assert min(sum(each.direction > 0 for each in found), sum(each.direction < 0 for each in found)) >= 5
    assert made.outside != (kind in {"nothing", *shipped_effects()})
    if KINDS[kind].hidden:
        off = {key: getattr(Plant(), key) for key in KINDS[kind].hidden}
        shown = theirs(made.plant, command_pa)[0] - theirs(made.plant._replace(**off), command_pa)[0]
        assert rms(shown) > 3.0 * CLEAN.noise_m


def test_a_case_is_the_same_again() -> None:
    cases = [case("cavitation", seed=seed, duration_s=10.0).fit for seed in (1, 1, 2)]
    for column in ("time_s", "command_pa", "position_m"):
        one, again, other = (each.columns[column] for each in cases)
        np.testing.assert_array_equal(one, again)
        assert column == "time_s" or not np.array_equal(one, other)


def test_a_clean_case_repeats_itself_and_a_dirty_one_does_not() -> None:
    clean, dirty = (case("nothing", dirty=dirty).fit for dirty in (False, True))
    clean_m = repeatability_m(clean.command_pa, clean.position_m)
    dirty_m = repeatability_m(dirty.command_pa, dirty.position_m)
    assert clean_m is not None
    assert dirty_m is not None
    assert clean_m < 1.3 * CLEAN.noise_m
    assert dirty_m > 3.0 * clean_m
    assert len(np.unique(np.round(dirty.position_m / DIRTY.quantum_m, 3) % 1.0)) == 1
