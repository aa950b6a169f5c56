"""Recordings of valves that are not ours: another integrator, other friction laws, effects outside the library.

Written from the equations alone; nothing of `sim` is used. Time runs in equal fine steps, far below every time
constant: explicit Runge-Kutta of fourth order for the bristle laws, implicit Euler for the smooth one, which is stiff.

    m x'' = A p - k_s x - F_v x' - F_f + F_extra

    LuGre           F_f = s_0 z + s_1 z',  z' = v - s_0 |v| z / g(v),  g(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)
    elasto-plastic  z' = v (1 - alpha(z, v) s_0 |z| / g(v)): below the break-away bristle alpha = 0, no creep (Dupont)
    smooth          F_f = g(v) tanh(v / e)

The bristles' stiffness s_0 is F_s over the presliding travel of 0.05 to 0.3 mm, their damping s_1 = 2 sqrt(s_0 m) the
critical one: bristles that swing would break away before F_s after every step of the command. Even so the bristle laws
break away the earlier the faster the force rises, as bristles faster than v_s have lost their static friction: under
stepwise commands hardly above F_c. The smooth law breaks away at F_s, as ours does.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import copysign, exp, pi, sin, sqrt, tanh
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt

from config.recording import Recording
from config.valve_file import ValveFile, ValveParameters
from workbench.blind.input_signal import excitation, lead_in

Series = npt.NDArray[np.float64]
Draw = np.random.Generator
Function = TypeVar("Function", bound=Callable[..., Any])

LUGRE, ELASTO_PLASTIC, SMOOTH = 0, 1, 2
FINE_S = 2e-5
LEAD_IN = 300
"""Samples before the record."""
OFF = 1e30


class Plant(NamedTuple):
    """A valve; SI units. What follows the bare valve is off by default."""

    law: int = LUGRE
    m: float = 1.3608
    A: float = 0.0645
    k_s: float = 52538.0
    F_v: float = 612.944
    F_c: float = 1423.4
    F_s: float = 1708.09
    v_s: float = 1e-3
    presliding_m: float = 1e-4
    smoothing_m_per_s: float = 3e-5
    # Effects that the library has, written again.
    lag_s: float = 0.0
    filling_pa_per_s: float = OFF
    venting_pa_per_s: float = OFF
    preload_n: float = 0.0
    cubic_n_per_m3: float = 0.0
    drag_ns2_per_m2: float = 0.0
    asymmetry: float = 0.0
    growth_over_stroke: float = 0.0
    growth_n_per_pa: float = 0.0
    stroke_m: float = 0.1016
    play_m: float = 0.0
    sensor_lag_s: float = 0.0
    # Effects that it does not have.
    second_mass_kg: float = 0.0
    second_stiffness_n_per_m: float = 0.0
    second_damping_ns_per_m: float = 0.0
    bend: float = 0.0
    bend_period_m: float = 0.015
    relay_band_pa: float = 0.0
    relay_leak_per_s: float = 0.0


class State(NamedTuple):
    """x, v of the stem, bristle z, x and v of the second mass."""

    x: float
    v: float
    z: float
    x2: float
    v2: float


def inlined(function: Function) -> Function:
    """Compile what only compiled functions call; LLVM inlines it, where numba's own way compiles twice as long."""
    options: dict[str, Any] = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled: Function = numba.njit(**options)(function)
    return compiled


@inlined
def levels(P: Plant, x: float, v: float, p: float, F_s: float) -> tuple[float, float]:
    """F_c and F_s here."""
    scale = 1.0 + P.growth_over_stroke * min(max(x / P.stroke_m, 0.0), 1.0)
    if P.bend != 0.0:
        scale *= 1.0 + P.bend * sin(2.0 * pi * x / P.bend_period_m)
    scale *= 1.0 + P.asymmetry * copysign(1.0, v)
    more = P.growth_n_per_pa * max(p, 0.0)
    return P.F_c * scale + more, F_s * scale + more


@inlined
def stribeck(P: Plant, x: float, v: float, p: float, F_s: float) -> float:
    """g(v), N."""
    low, high = levels(P, x, v, p, F_s)
    return low + (high - low) * exp(-((v / P.v_s) ** 2))


@inlined
def driving(P: Plant, S: State, p: float, extra: float) -> float:
    """All forces on the stem but friction and F_v v, N."""
    spring = P.k_s * S.x + P.cubic_n_per_m3 * S.x**3 + P.preload_n
    link = P.second_stiffness_n_per_m * (S.x2 - S.x) + P.second_damping_ns_per_m * (S.v2 - S.v)
    return P.A * p - spring - P.drag_ns2_per_m2 * S.v * abs(S.v) + link + extra


@inlined
def second(P: Plant, S: State) -> float:
    """Acceleration of the second mass, m/s^2."""
    if P.second_mass_kg == 0.0:
        return 0.0
    link = P.second_stiffness_n_per_m * (S.x2 - S.x) + P.second_damping_ns_per_m * (S.v2 - S.v)
    return -link / P.second_mass_kg


@inlined
def plastic(P: Plant, z: float, v: float, limit: float) -> float:
    """alpha: 1 in LuGre; in the elasto-plastic law 0 below the break-away bristle, a sine up to the sliding one."""
    if P.law == LUGRE:
        return 1.0
    if z * v <= 0.0:
        return 0.0
    least = 0.7 * limit
    if abs(z) <= least:
        return 0.0
    if abs(z) >= limit:
        return 1.0
    return 0.5 + 0.5 * sin(pi * (abs(z) - 0.5 * (limit + least)) / (limit - least))


@inlined
def rates(P: Plant, S: State, p: float, extra: float, F_s: float) -> State:
    """Time derivatives under a bristle law."""
    s_0 = P.F_s / P.presliding_m
    s_1 = 2.0 * sqrt(s_0 * P.m)
    limit = stribeck(P, S.x, S.v, p, F_s) / s_0
    dz = S.v - plastic(P, S.z, S.v, limit) * abs(S.v) * S.z / limit
    a = (driving(P, S, p, extra) - P.F_v * S.v - s_0 * S.z - s_1 * dz) / P.m
    return State(S.v, a, dz, S.v2, second(P, S))


@inlined
def ahead(S: State, d: State, h: float) -> State:
    """S + h d."""
    return State(S.x + h * d.x, S.v + h * d.v, S.z + h * d.z, S.x2 + h * d.x2, S.v2 + h * d.v2)


@inlined
def runge_kutta(P: Plant, S: State, p: float, extra: float, F_s: float, h: float) -> State:
    d1 = rates(P, S, p, extra, F_s)
    d2 = rates(P, ahead(S, d1, 0.5 * h), p, extra, F_s)
    d3 = rates(P, ahead(S, d2, 0.5 * h), p, extra, F_s)
    d4 = rates(P, ahead(S, d3, h), p, extra, F_s)
    return ahead(ahead(ahead(ahead(S, d1, h / 6.0), d2, h / 3.0), d3, h / 3.0), d4, h / 6.0)


@inlined
def unbalanced(P: Plant, S: State, p: float, force: float, F_s: float, h: float, v: float) -> float:
    """m (v - v_0) / h less the forces at the end of the step; it rises with v."""
    friction = stribeck(P, S.x, v, p, F_s) * tanh(v / P.smoothing_m_per_s) + P.F_v * v
    return P.m * (v - S.v) / h + P.k_s * h * v + friction - force


@inlined
def implicit(P: Plant, S: State, p: float, extra: float, F_s: float, h: float) -> State:
    """Implicit Euler: the end's velocity by false position (Illinois) in a bracket that grows until it holds it."""
    force = driving(P, S, p, extra)
    reach = 1e-6
    low, high = S.v - reach, S.v + reach
    below, above = unbalanced(P, S, p, force, F_s, h, low), unbalanced(P, S, p, force, F_s, h, high)
    while below > 0.0 or above < 0.0:
        reach *= 8.0
        if below > 0.0:
            low = S.v - reach
            below = unbalanced(P, S, p, force, F_s, h, low)
        else:
            high = S.v + reach
            above = unbalanced(P, S, p, force, F_s, h, high)
    v, side = S.v, 0
    for _ in range(60):
        v = (low * above - high * below) / (above - below)
        here = unbalanced(P, S, p, force, F_s, h, v)
        if abs(here) < 1e-6 * P.F_c or high - low < 1e-12:
            break
        if here > 0.0:
            high, above, below, side = v, here, (0.5 * below if side > 0 else below), 1
        else:
            low, below, above, side = v, here, (0.5 * above if side < 0 else above), -1
    v2 = S.v2 + h * second(P, S)
    return State(S.x + h * v, v, 0.0, S.x2 + h * v2, v2)


@inlined
def pressed(P: Plant, u: float, p: float, is_open: bool, h: float) -> tuple[float, bool]:
    """The actuator pressure a step later: lag or limits, or a relay that leaks until it opens again."""
    if P.relay_band_pa > 0.0:
        is_open = abs(u - p) > (0.02 if is_open else 1.0) * P.relay_band_pa
        return (p + h * (u - p) / 0.02 if is_open else p - h * P.relay_leak_per_s * p), is_open
    wanted = u if P.lag_s <= 0.0 else u + (p - u) * exp(-h / P.lag_s)
    return p + min(max(wanted - p, -h * P.venting_pa_per_s), h * P.filling_pa_per_s), is_open


@numba.njit(cache=True)
def follow(P: Plant, command: Series, extra: Series, jitter: Series, period: float, fine: float) -> Series:
    """Return rows indicated, x, v, p at the samples; each command and extra force held from its sample to the next."""
    n = max(1, round(period / fine))
    h = period / n
    rows = np.empty((4, command.size))
    p, is_open = command[0], False
    x = (P.A * p - P.preload_n) / P.k_s
    S = State(x, 0.0, 0.0, x, 0.0)
    linkage, y, F_s, stops, moving = x, x, P.F_s, 0, False
    for i in range(command.size):
        rows[0, i], rows[1, i], rows[2, i], rows[3, i] = y, S.x, S.v, p
        for _ in range(n):
            p, is_open = pressed(P, command[i], p, is_open, h)
            S = implicit(P, S, p, extra[i], F_s, h) if P.law == SMOOTH else runge_kutta(P, S, p, extra[i], F_s, h)
            linkage = min(max(linkage, S.x - 0.5 * P.play_m), S.x + 0.5 * P.play_m)
            y = linkage if P.sensor_lag_s <= 0.0 else linkage + (y - linkage) * exp(-h / P.sensor_lag_s)
            if moving and abs(S.v) < 2e-4:
                F_s = max(P.F_c, P.F_s * jitter[stops % jitter.size])
                stops += 1
            moving = abs(S.v) > (2e-4 if moving else 2e-3)
    return rows


@dataclass(frozen=True)
class Dirt:
    """Sensor noise, m; pressure noise, Pa; break-away jitter; quantum, m."""

    noise_m: float = 5e-5
    pressure_pa: float = 0.0
    jitter: float = 0.0
    quantum_m: float = 0.0


CLEAN = Dirt()
DIRTY = Dirt(pressure_pa=300.0, jitter=0.04, quantum_m=0.1016 / 4096)


@dataclass(frozen=True)
class Case:
    """Two recordings of a valve that is not ours, and what is known of it."""

    name: str
    description: str
    hidden: str | None
    """The library's name of what is hidden; None for nothing and for what the library does not have."""
    fit: Recording
    again: Callable[[], Recording]
    """Records once more, by other commands."""
    base: ValveFile
    plant: Plant

    @cached_property
    def test(self) -> Recording:
        """Another recording, made when it is asked for."""
        return self.again()

    @property
    def outside(self) -> bool:
        """Whether what is hidden is no effect of the library: an honest verdict is `unexplained`."""
        return self.hidden is None and not self.name.startswith("nothing")


def recorded(
    plant: Plant,
    command_pa: Series,
    generator: Draw,
    *,
    period_s: float = 0.01,
    dirt: Dirt = CLEAN,
    extra_n: Series | None = None,
    fine_s: float = FINE_S,
) -> Recording:
    """Record a plant's answer: the columns of the contract."""
    before = lead_in(command_pa, LEAD_IN)
    command = np.concatenate([before, command_pa])
    extra = np.zeros(command.size)
    if extra_n is not None:
        extra[before.size :] = extra_n
        extra[: before.size] = extra_n[0]
    jitter = 1.0 + dirt.jitter * generator.standard_normal(997)
    noisy = command + correlated(generator, command.size, period_s / 0.2, dirt.pressure_pa)
    indicated = follow(plant, noisy, extra, jitter, period_s, fine_s)[0, before.size :]
    position_m: Series = indicated + dirt.noise_m * generator.standard_normal(indicated.size)
    if dirt.quantum_m:
        position_m = dirt.quantum_m * np.round(position_m / dirt.quantum_m)
    time_s = np.arange(command_pa.size, dtype=np.float64) * period_s
    return Recording({"time_s": time_s, "command_pa": command_pa, "position_m": position_m})


def correlated(generator: Draw, count: int, rate: float, std: float) -> Series:
    """A first-order autoregression; `rate` is the period over the correlation time."""
    noise = std * generator.standard_normal(count)
    kept = np.exp(-rate)
    for i in range(1, count):
        noise[i] = kept * noise[i - 1] + np.sqrt(1.0 - kept**2) * noise[i]
    return noise


def walk(generator: Draw, count: int, plant: Plant) -> Series:
    """A spring whose zero wanders with the temperature: a smoothed random walk that spans 3 mm."""
    steps = np.convolve(generator.standard_normal(count), np.ones(50) / 50.0, "same")
    path = np.cumsum(steps)
    return np.asarray(plant.k_s * 3e-3 * path / np.ptp(path))


def bursts(generator: Draw, count: int, plant: Plant) -> Series:
    """Cavitation: bursts of 80 ms, two a second, pushing either way with up to 1.5 F_c."""
    force = np.zeros(count)
    shape = np.sin(np.pi * np.arange(1, 9) / 9.0)
    for at in generator.integers(0, count - 8, count // 50):
        force[at : at + 8] += shape * plant.F_c * generator.uniform(0.7, 1.5) * generator.choice([-1.0, 1.0])
    return force


Extra = Callable[[Draw, int, Plant], Series]


@dataclass(frozen=True)
class Kind:
    """What is hidden, the laws it makes sense with, and its effect's name in the library, None outside it."""

    description: str
    hidden: Mapping[str, Any]
    in_library: str | None = None
    extra: Extra | None = None
    dead_samples: int = 0


KINDS: Mapping[str, Kind] = {
    "nothing": Kind("a bare valve", {}),
    "ip_lag": Kind("first-order lag of 60 ms before the actuator", {"lag_s": 0.06}, "ip_lag"),
    "dead_time": Kind("the command acts 50 ms late", {}, "dead_time", dead_samples=5),
    "rate_limit": Kind(
        "filling 120 kPa/s, venting 80 kPa/s", {"filling_pa_per_s": 1.2e5, "venting_pa_per_s": 8e4}, "rate_limit"
    ),
    "preload": Kind("a constant force of 250 N towards closing", {"preload_n": 250.0}, "preload"),
    "spring_hardening": Kind("a cubic spring", {"cubic_n_per_m3": 1.5e6}, "spring_hardening"),
    "quadratic_drag": Kind("drag of 6000 N s^2/m^2", {"drag_ns2_per_m2": 6000.0}, "quadratic_drag"),
    "asymmetric_friction": Kind("friction 15 % up opening, down closing", {"asymmetry": 0.15}, "asymmetric_friction"),
    "position_friction": Kind("friction 60 % higher at full travel", {"growth_over_stroke": 0.6}, "position_friction"),
    "pressure_friction": Kind("friction grows by 4 mN/Pa", {"growth_n_per_pa": 4e-3}, "pressure_friction"),
    "presliding": Kind("the packing yields by 1.5 mm", {"presliding_m": 1.5e-3}, "presliding"),
    "backlash": Kind("play of 1.5 mm in the linkage", {"play_m": 1.5e-3}, "backlash"),
    "sensor_lag": Kind("transmitter lag of 80 ms", {"sensor_lag_s": 0.08}, "sensor_lag"),
    "second_mass": Kind(
        "a second mass of 30 kg on a spring, 4 Hz, shakes the stem",
        {"second_mass_kg": 30.0, "second_stiffness_n_per_m": 2e4, "second_damping_ns_per_m": 60.0},
    ),
    "bent_stem": Kind("friction waves with the position, 40 % every 15 mm", {"bend": 0.4}),
    "warm_spring": Kind("the spring's zero wanders by 3 mm", {}, extra=walk),
    "leaking_relay": Kind(
        "the relay opens only 4 kPa off the command, the actuator leaks 8 %/s in the meantime",
        {"relay_band_pa": 4e3, "relay_leak_per_s": 0.08},
    ),
    "cavitation": Kind("bursts of force, two a second", {}, extra=bursts),
}
LAWS: Mapping[str, Mapping[str, Any]] = {
    "lugre": {"law": LUGRE},
    "elasto_plastic": {"law": ELASTO_PLASTIC},
    "smooth": {"law": SMOOTH, "v_s": 1e-2},
}


CASES = [(kind, law) for kind in KINDS for law in LAWS if (kind, law) != ("presliding", "smooth")]
"""All that make sense: the smooth law has no presliding."""


def case(
    kind: str,
    *,
    law: str = "lugre",
    seed: int = 0,
    duration_s: float = 30.0,
    period_s: float = 0.01,
    dirty: bool = False,
) -> Case:
    """Make a case: a valve near the seed's, drawn by the seed, with what `kind` hides, under a friction law."""
    chosen = KINDS[kind]
    generator = np.random.default_rng([seed, sorted(KINDS).index(kind), sorted(LAWS).index(law)])
    F_c = float(generator.uniform(400.0, 1400.0))
    drawn = {
        "k_s": 52538.0 * generator.uniform(0.85, 1.15),
        "F_v": 612.944 * generator.uniform(0.8, 2.0),
        "F_c": F_c,
        "F_s": F_c * generator.uniform(1.08, 1.3),
        "presliding_m": generator.uniform(5e-5, 1.5e-4),
    }
    plant = Plant(**{**LAWS[law], **drawn, **chosen.hidden})
    base = known(plant, generator)
    count = round(duration_s / period_s) + 1
    dirt = DIRTY if dirty else CLEAN

    def one() -> Recording:
        command_pa = excitation(base.valve, generator, count)
        late = np.concatenate([np.full(chosen.dead_samples, command_pa[0]), command_pa])[:count]
        extra_n = chosen.extra(generator, count, plant) if chosen.extra else None
        recording = recorded(plant, late, generator, period_s=period_s, dirt=dirt, extra_n=extra_n)
        return Recording({**recording.columns, "command_pa": command_pa})

    return Case(f"{kind}, {law}", chosen.description, chosen.in_library, one(), one, base, plant)


def known(plant: Plant, generator: Draw) -> ValveFile:
    """What an engineer knows of it."""
    F_c = plant.F_c * generator.uniform(0.8, 1.25)
    valve = ValveParameters(
        name="not ours",
        mass_kg=plant.m,
        diaphragm_area_m2=plant.A,
        spring_n_per_m=plant.k_s * generator.uniform(0.92, 1.08),
        viscous_ns_per_m=plant.F_v * generator.uniform(0.6, 1.6),
        coulomb_n=F_c,
        static_n=F_c * generator.uniform(1.05, 1.3),
        stribeck_velocity_m_per_s=plant.v_s,
        deadzone_ratio=0.6,
        stroke_m=plant.stroke_m,
    )
    return ValveFile(valve=valve)
