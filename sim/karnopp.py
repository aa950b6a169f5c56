"""Karnopp's valve with Stribeck friction as a hybrid automaton, and its integration over one step.

    F_e = A p - k_s x + (extra forces)                                        external force, N
    F_f(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2)                              friction while it slides, N
    dz = deadzone_ratio v_s                                                   Karnopp's band, m/s

    STUCK     v = 0                                  until |F_e| > F_s                  -> BREAKING
    BREAKING  m v' = F_e - F_s sigma,  x' = v        until sigma v = dz                 -> SLIP
              (sigma = sign F_e: on the eve of       until sigma F_e <= F_s             -> STUCK, v := 0
              motion, inside the band)
    SLIP      m v' = F_e - F_v v - F_f(v) sigma,     until sigma v = dz, and then
              x' = v  (sigma = sign v)               |F_e| <= F_s                       -> STUCK, v := 0
                                                     sigma F_e < -F_s                   -> BREAKING the other way
                                                     sigma F_e > F_s: viscous friction outweighs the Stribeck
                                                     drop, both laws point at the border -> it creeps at v = sigma dz

In BREAKING a stem on a stiffness K = -dF_e/dx, from an excess E0, with a force that grows at a rate R, is no faster
than E0 / sqrt(K m) + 2 R / K. Where that is less than dz it never slips but breaks and sticks in turn, on a stop some
thousand times a second: over a step that is long to this it creeps, and ends in balance, |F_e| = F_s (`creep`).

x stem position, m; v velocity, m/s; p actuator pressure, Pa; t time, s; the command u, Pa, is held over a period.
A period is cut into equal steps h, and these where the pressure jumps or bends (`straight`). Over a step it goes
straight from its start to its end value; inside it every change of mode is found to h / 2^30, and the motion is
integrated by Bogacki and Shampine's pair of orders 3 and 2, the sub-step halved until the pair agrees on v to
tolerance (|v| + v_s), TOLERANCE unless another is asked for.
The Stribeck slope near v_s grows deviations at up to 0.86 (F_s - F_c) / (m v_s), 7e5 1/s on the seed's valve: there the
sub-steps are some 0.1 us; away from it one sub-step is one step.

Sliding over more than EXPONENTIAL_ANGLE / sqrt(k_s / m) goes by exponential-integrator steps. With
lambda = F_v / m and kappa = k_s / m,

    x'' + lambda x' + kappa x = n,      n = v' + lambda v + kappa x,  a quadratic in time through start, middle and end

is solved exactly, however stiff, by the response g to an impulse (g(0) = 0, g'(0) = 1), h = g' + lambda g, and

    I_0 = (1 - h) / kappa,  I_1 = (1 - (g + lambda I_0) / s) / kappa,  I_2 = (1 - 2 (I_0 + lambda s I_1) / s^2) / kappa
    x(s) = h x + g v + I_0 n_0 + I_1 n_1 + I_2 n_2,     v(s) = -kappa g x + g' v + g n_0 + (I_0 n_1 + 2 I_1 n_2) / s

for n = n_0 + n_1 tau / s + n_2 (tau / s)^2. On the bare valve beyond the Stribeck range n is a straight line: there a
step has no error. The error estimate is what the quadratic term changes of v. Where that is too much, another force may
damp the stem, drive it or stiffen it: lambda = -dv'/dv and kappa = -dv'/dx, there (`linear_at`), are tried before the
sub-step is halved: n then lacks that force too, and is as smooth. Of a stem damped so, steps are exponential down to
DAMPED / lambda.

The file is plain Python and runs as it stands: the bare valve. `sim.kernel` compiles this text, and in place of the
functions at its end, which stand empty here, those that the effects of a valve file fill. All that is compiled must
stand in this file or in an effect's own: a kernel is cached under the digest of these texts.
"""

# ruff: noqa: ARG001 -- an empty place takes what a full one needs.
from math import ceil, cos, exp, nan, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

STUCK = 0
BREAKING = 1
SLIP = 2

TOLERANCE = 1e-5
"""Of one sub-step on the velocity, relative to |v| + v_s, where nothing else is asked for."""
MOST_SUBSTEPS, MOST_MODE_CHANGES = 100_000, 1000
"""Of one step, beyond which there is no answer (NaN): no stem is so stiff;"""
BORNE = 1e-6
"""but one that is borne to so much of F_s is at rest: out of a damped stop it breaks loose and sticks ever less."""
SHORTEST_SUBSTEP = 2.0**-20
"""Sub-step, in steps, that is taken whatever its error: a kink of a force is passed there."""
EXPONENTIAL_ANGLE = 0.15
"""Angle, rad, of the undamped stem from which a sub-step is exponential: below it the pair is cheaper, and the closed
form cancels."""
OTHER, DAMPED = 0.1, 0.5
"""Difference of damping, of that tried, that is worth another trial; lambda s from which a sub-step is exponential
then."""
FIRST_CHANGE = 0.2
"""Change of v, in |v| + v_s, that the first sub-step in the Stribeck range is made for: longer ones are refused."""
BISECTIONS = 30
NINTH = 1.0 / 9.0
NEGLIGIBLE = 40.0
"""(v / v_s)^2 beyond which exp(-(v / v_s)^2) < 5e-18 is lost in the rounding of F_c."""
CREEP_ANGLE = 2.0 * pi
"""Angle, rad, of the undamped stem in a step from which one that gives way is in balance at the end: once round. On a
stop it turns through 15 in 2 ms, on its spring alone through 2 in 10 ms."""
BREAKAWAY_FACTOR = 1.0 + 1e-10
"""F_s at break-away, in F_s at the end of a creep. Were they one, a stem pressed on a stop would creep for ever."""
DIFFERENCE_M = 1e-7
"""Half-width of the central difference that gives the stiffness -dF_e/dx."""
DIFFERENCE_V = 1e-3
"""Of |v| + v_s, for the difference that gives the damping -dv'/dv."""
BALANCINGS = 6
"""Corrections of a pressure until it balances forces that depend on it."""

MEMORY = 7
"""Where the effects' memories begin in the state vector, after the Condition."""
BASE_PARAMETERS = 8
"""Entries of the parameter vector that are the base model's; the effects' follow."""


class Karnopp(NamedTuple):
    """The base model's constants."""

    per_m: float
    A: float
    k_s: float
    F_v: float
    F_c: float
    F_s: float
    v_s: float
    dz: float
    told: float
    """1 of a stem that is told when it moves (`sim.told`), else 0: static friction has no part in that then."""


class Stem(NamedTuple):
    """Time, stem position and velocity, actuator pressure."""

    t: float
    x: float
    v: float
    p: float


class Drive(NamedTuple):
    """The pressure over one step: p + slope tau at t + tau."""

    t: float
    p: float
    slope: float


class Condition(NamedTuple):
    """The valve's state without the effects' memories: time, stem, pressure, mode, indicated position."""

    t: float
    x: float
    v: float
    p: float
    mode: int
    sigma: float
    indicated: float


def karnopp(theta: Vector) -> Karnopp:
    """Read the base model from the parameter vector: m, A, k_s, F_v, F_c, F_s, v_s, deadzone_ratio first."""
    return Karnopp(1.0 / theta[0], theta[1], theta[2], theta[3], theta[4], theta[5], theta[6], theta[7] * theta[6], 0.0)


def levels(valve: Karnopp, direction: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return F_c and F_s, N, with all effects, in a direction of (impending) motion; F_c twice where it is told."""
    F_c, F_s = friction(valve.F_c, valve.F_s, direction, stem, q, z)
    return F_c, F_c if valve.told > 0.0 else F_s


def stem_at(drive: Drive, tau: float, x: float, v: float) -> Stem:
    """Return the stem at (x, v), tau into the step."""
    return Stem(drive.t + tau, x, v, drive.p + drive.slope * tau)


def external_force(valve: Karnopp, stem: Stem, q: Any, z: Any) -> float:
    """F_e, N."""
    return valve.A * stem.p - valve.k_s * stem.x + force(0.0, stem, q, z)


def stiffness_at(valve: Karnopp, stem: Stem, q: Any, z: Any) -> float:
    """-dF_e/dx, N/m, with all effects."""
    ahead = external_force(valve, Stem(stem.t, stem.x + DIFFERENCE_M, stem.v, stem.p), q, z)
    behind = external_force(valve, Stem(stem.t, stem.x - DIFFERENCE_M, stem.v, stem.p), q, z)
    return (behind - ahead) / (2.0 * DIFFERENCE_M)


def excess(valve: Karnopp, stem: Stem, q: Any, z: Any) -> float:
    """|F_e| - F_s, N, but for BREAKAWAY_FACTOR: positive when the stuck stem breaks away."""
    F_e = external_force(valve, stem, q, z)
    direction = 1.0 if F_e > 0.0 else -1.0
    _, F_s = levels(valve, direction, stem, q, z)
    return direction * F_e - BREAKAWAY_FACTOR * F_s


def acceleration(valve: Karnopp, mode: int, sigma: float, stem: Stem, q: Any, z: Any) -> float:
    """v', m/s^2, by the law of the mode."""
    F_e = external_force(valve, stem, q, z)
    F_c, F_s = levels(valve, sigma, stem, q, z)
    if mode == BREAKING:
        return (F_e - F_s * sigma) * valve.per_m
    w = stem.v / valve.v_s
    F_f = F_c
    if w * w < NEGLIGIBLE:
        F_f = F_c + (F_s - F_c) * exp(-w * w)
    return (F_e - F_f * sigma - valve.F_v * stem.v) * valve.per_m


def margin(valve: Karnopp, mode: int, sigma: float, stem: Stem, q: Any, z: Any) -> float:
    """How far the moving mode is from its end; negative when it is over."""
    if mode == SLIP:
        return sigma * stem.v - valve.dz
    F_e = external_force(valve, stem, q, z)
    _, F_s = levels(valve, sigma, stem, q, z)
    return min(valve.dz - sigma * stem.v, sigma * F_e - F_s)


def bogacki_shampine(
    valve: Karnopp,
    mode: int,
    sigma: float,
    drive: Drive,
    tau: float,
    s: float,
    x: float,
    v: float,
    a: float,
    q: Any,
    z: Any,
) -> tuple[float, float, float, float]:
    """Take one sub-step s from (x, v) with v' = a; return x, v, v' at its end and the pair's difference in v."""
    v2 = v + 0.5 * s * a
    a2 = acceleration(valve, mode, sigma, stem_at(drive, tau + 0.5 * s, x + 0.5 * s * v, v2), q, z)
    v3 = v + 0.75 * s * a2
    a3 = acceleration(valve, mode, sigma, stem_at(drive, tau + 0.75 * s, x + 0.75 * s * v2, v3), q, z)
    x1 = x + s * NINTH * (2.0 * v + 3.0 * v2 + 4.0 * v3)
    v1 = v + s * NINTH * (2.0 * a + 3.0 * a2 + 4.0 * a3)
    a1 = acceleration(valve, mode, sigma, stem_at(drive, tau + s, x1, v1), q, z)
    return x1, v1, a1, s * 0.125 * NINTH * abs(5.0 * a - 6.0 * a2 - 8.0 * a3 + 9.0 * a1)


class Linear(NamedTuple):
    """What is linear of a slide, x'' + lambda x' + kappa x = n."""

    damping: float
    """lambda, 1/s."""
    kappa: float
    """1/s^2."""


class Response(NamedTuple):
    """Of x'' + lambda x' + kappa x = n: g, g', h of an impulse after s; I_0, I_1, I_2 of n = 1, tau / s, its square."""

    g: float
    slope: float
    h: float
    I_0: float
    I_1: float
    I_2: float


def impulse(damping: float, kappa: float, s: float) -> tuple[float, float]:
    """Return g and g' after s, of lambda and kappa."""
    half = 0.5 * damping
    square = half * half - kappa
    if square > 0.0:
        root = sqrt(square)
        slow, fast = exp((root - half) * s), exp(-(root + half) * s)
        g = 0.5 * (slow - fast) / root
        return g, 0.5 * (slow + fast) - half * g
    root = sqrt(-square)
    decay = exp(-half * s)
    g = decay * (sin(root * s) / root if root > 0.0 else s)
    return g, decay * cos(root * s) - half * g


def response(damping: float, kappa: float, s: float, g: float, slope: float) -> Response:
    """Complete g and g' after s."""
    per_kappa, per_s = 1.0 / kappa, 1.0 / s
    h = slope + damping * g
    I_0 = (1.0 - h) * per_kappa
    I_1 = (1.0 - (g + damping * I_0) * per_s) * per_kappa
    return Response(g, slope, h, I_0, I_1, (1.0 - 2.0 * (I_0 * per_s + damping * I_1) * per_s) * per_kappa)


def linear_at(valve: Karnopp, sigma: float, stem: Stem, a: float, q: Any, z: Any) -> Linear:
    """Return lambda and kappa, there, of a sliding stem with v' = a; what drives or loosens it is left to n.

    A negative lambda, as in the Stribeck range, would grow over a step beyond all numbers.
    """
    dv, dx = sigma * DIFFERENCE_V * (abs(stem.v) + valve.v_s), sigma * DIFFERENCE_M
    faster = acceleration(valve, SLIP, sigma, Stem(stem.t, stem.x, stem.v + dv, stem.p), q, z)
    farther = acceleration(valve, SLIP, sigma, Stem(stem.t, stem.x + dx, stem.v, stem.p), q, z)
    kappa = (a - farther) / dx
    own = valve.k_s * valve.per_m
    return Linear(max((a - faster) / dv, 0.0), kappa if kappa > OTHER * own else own)


def unlike(there: Linear, tried: Linear) -> bool:
    """Whether what is linear there is worth another trial."""
    damped = abs(there.damping - tried.damping) > OTHER * abs(tried.damping)
    return damped or abs(there.kappa - tried.kappa) > OTHER * tried.kappa


def shorter(shortest: float, there: Linear) -> float:
    """Return the sub-step, s, from which one is exponential, with what is linear there."""
    shortest = min(shortest, EXPONENTIAL_ANGLE / sqrt(there.kappa))
    return min(shortest, DAMPED / there.damping) if there.damping > 0.0 else shortest


def exponential_step(
    valve: Karnopp,
    linear: Linear,
    sigma: float,
    drive: Drive,
    tau: float,
    s: float,
    x: float,
    v: float,
    a: float,
    q: Any,
    z: Any,
) -> tuple[float, float, float, float]:
    """Slide over s from (x, v) with v' = a; return x, v, v' at its end and what the quadratic term changes of v."""
    damping, kappa = linear
    g, slope = impulse(damping, kappa, 0.5 * s)
    half = response(damping, kappa, 0.5 * s, g, slope)
    # Twice the half is the whole.
    whole = response(damping, kappa, s, g * (half.h + slope), slope * slope - kappa * g * g)
    n0 = a + damping * v + kappa * x
    x2 = half.h * x + g * v + half.I_0 * n0
    v2 = slope * v - kappa * g * x + g * n0
    a2 = acceleration(valve, SLIP, sigma, stem_at(drive, tau + 0.5 * s, x2, v2), q, z)
    n2 = a2 + damping * v2 + kappa * x2
    per_s = 1.0 / s
    x3 = whole.h * x + whole.g * v + whole.I_0 * n0 + whole.I_1 * 2.0 * (n2 - n0)
    v3 = whole.slope * v - kappa * whole.g * x + whole.g * n0 + whole.I_0 * per_s * 2.0 * (n2 - n0)
    a3 = acceleration(valve, SLIP, sigma, stem_at(drive, tau + s, x3, v3), q, z)
    n3 = a3 + damping * v3 + kappa * x3
    bend = n0 - 2.0 * n2 + n3
    x1 = x3 + (2.0 * whole.I_2 - whole.I_1) * bend
    change = (4.0 * whole.I_1 - whole.I_0) * per_s * bend
    v1 = v3 + change
    return x1, v1, acceleration(valve, SLIP, sigma, stem_at(drive, tau + s, x1, v1), q, z), abs(change)


def wait(
    valve: Karnopp, drive: Drive, tau: float, h: float, x: float, sigma: float, q: Any, z: Any
) -> tuple[float, float, int, float]:
    """Hold the stuck stem until it breaks away or the step ends, or let it creep; return tau, x, mode, sigma."""
    at_end = excess(valve, stem_at(drive, h, x, 0.0), q, z)
    if not at_end > 0.0:
        return h, x, STUCK, sigma + unknown(at_end)
    begun = max(excess(valve, stem_at(drive, tau, x, 0.0), q, z), 0.0)
    crept = creep(valve, stem_at(drive, h, x, 0.0), h - tau, begun, at_end, q, z)
    if crept != 0.0:
        return h, x + crept, STUCK, sigma
    late = h
    if begun > 0.0:
        late = tau
    else:
        early = tau
        for _ in range(BISECTIONS):
            middle = 0.5 * (early + late)
            if excess(valve, stem_at(drive, middle, x, 0.0), q, z) > 0.0:
                late = middle
            else:
                early = middle
    way = 1.0 if external_force(valve, stem_at(drive, late, x, 0.0), q, z) > 0.0 else -1.0
    return late, x, BREAKING, way + unknown(sigma)


def creep(valve: Karnopp, stem: Stem, s: float, begun: float, at_end: float, q: Any, z: Any) -> float:
    """Return by how much, m, a stuck stem gives way within s without leaving the band; 0 of one that breaks loose.

    Its excess is `begun` at the beginning and `at_end` at the end, N, where it stays.
    """
    K = stiffness_at(valve, stem, q, z)
    if not K * valve.per_m * s * s > CREEP_ANGLE * CREEP_ANGLE:
        return 0.0
    fastest = begun * sqrt(valve.per_m / K) + 2.0 * (at_end - begun) / (K * s)
    if not fastest < valve.dz:
        return 0.0
    crept = at_end / K if external_force(valve, stem, q, z) > 0.0 else -at_end / K
    left = excess(valve, Stem(stem.t, stem.x + crept, 0.0, stem.p), q, z)
    return crept if abs(left) < BORNE * valve.F_s else 0.0


def move(
    valve: Karnopp,
    mode: int,
    sigma: float,
    drive: Drive,
    tau: float,
    h: float,
    x: float,
    v: float,
    tolerance: float,
    q: Any,
    z: Any,
) -> tuple[float, float, float, bool]:
    """Integrate until the moving mode is over or the step ends; return tau, x, v and whether the mode is over."""
    a = acceleration(valve, mode, sigma, stem_at(drive, tau, x, v), q, z)
    s = h - tau
    if v * v < NEGLIGIBLE * valve.v_s * valve.v_s and abs(a) * s > FIRST_CHANGE * (abs(v) + valve.v_s):
        s = max(FIRST_CHANGE * (abs(v) + valve.v_s) / abs(a), SHORTEST_SUBSTEP * s)
    linear = Linear(valve.F_v * valve.per_m, valve.k_s * valve.per_m)
    shortest_exponential = EXPONENTIAL_ANGLE / sqrt(linear.kappa)
    tried = 0
    while tau < h:
        tried += 1
        if tried > MOST_SUBSTEPS:
            return h, nan, nan, False
        exponential = mode == SLIP and s > shortest_exponential
        if exponential:
            x1, v1, a1, error = exponential_step(valve, linear, sigma, drive, tau, s, x, v, a, q, z)
        else:
            x1, v1, a1, error = bogacki_shampine(valve, mode, sigma, drive, tau, s, x, v, a, q, z)
        allowed = tolerance * (abs(v1) + valve.v_s)
        if error > allowed and s > SHORTEST_SUBSTEP * h:
            there = linear_at(valve, sigma, stem_at(drive, tau, x, v), a, q, z) if exponential else linear
            if unlike(there, linear):
                linear, shortest_exponential = there, shorter(shortest_exponential, there)
            else:
                s *= 0.5
            continue
        if margin(valve, mode, sigma, stem_at(drive, tau + s, x1, v1), q, z) < 0.0:
            if exponential:
                s *= 0.5
                continue
            s, x1, v1 = end_of_mode(valve, mode, sigma, drive, tau, s, x, v, a, q, z)
            return min(tau + s, h), x1, v1, True
        tau = h if s >= h - tau else tau + s
        x, v, a = x1, v1, a1
        if error < 0.1 * allowed:
            s *= 2.0
        s = min(s, h - tau)
    return h, x, v, False


def end_of_mode(
    valve: Karnopp,
    mode: int,
    sigma: float,
    drive: Drive,
    tau: float,
    s: float,
    x: float,
    v: float,
    a: float,
    q: Any,
    z: Any,
) -> tuple[float, float, float]:
    """Find the sub-step after which the mode is just over, to s / 2^30; return it with x and v there.

    By false position as in the Illinois method: an end that stays twice counts for half.
    """
    closest = s * 0.5**BISECTIONS
    early, late = 0.0, s
    x1, v1, _, _ = bogacki_shampine(valve, mode, sigma, drive, tau, late, x, v, a, q, z)
    left = max(margin(valve, mode, sigma, stem_at(drive, tau, x, v), q, z), 0.0)
    right = margin(valve, mode, sigma, stem_at(drive, tau + late, x1, v1), q, z)
    moved = 0
    for _ in range(2 * BISECTIONS):
        if late - early <= 2.0 * closest:
            break
        middle = early + (late - early) * left / (left - right)
        middle = min(max(middle, early + closest), late - closest)
        x2, v2, _, _ = bogacki_shampine(valve, mode, sigma, drive, tau, middle, x, v, a, q, z)
        between = margin(valve, mode, sigma, stem_at(drive, tau + middle, x2, v2), q, z)
        if between < 0.0:
            late, right, x1, v1 = middle, between, x2, v2
            left *= 0.5 if moved > 0 else 1.0
            moved = 1
        else:
            early, left = middle, between
            right *= 0.5 if moved < 0 else 1.0
            moved = -1
    return late, x1, v1


def after_slip(valve: Karnopp, sigma: float, stem: Stem, q: Any, z: Any) -> tuple[int, float, float]:
    """Return mode, sigma and v of a sliding stem that has slowed down to the band."""
    if excess(valve, stem, q, z) <= 0.0:
        return STUCK, 0.0, 0.0
    if sigma * external_force(valve, stem, q, z) < 0.0:
        return BREAKING, -sigma, stem.v
    return SLIP, sigma, sigma * valve.dz


def step(
    valve: Karnopp,
    drive: Drive,
    h: float,
    x: float,
    v: float,
    mode: int,
    sigma: float,
    tolerance: float,
    held: bool,
    q: Any,
    z: Any,
) -> tuple[float, float, int, float]:
    """Carry the stem over one step; return x, v, mode, sigma at its end. Where it is held it stays once it is stuck."""
    tau, changes = 0.0, 0
    while tau < h and not (held and mode == STUCK):
        changes += 1
        if changes > MOST_MODE_CHANGES:
            left = excess(valve, stem_at(drive, tau, x, 0.0), q, z)
            return (x, 0.0, STUCK, 0.0) if abs(left) < BORNE * valve.F_s else (nan, nan, SLIP, sigma)
        if mode == STUCK:
            tau, x, mode, sigma = wait(valve, drive, tau, h, x, sigma, q, z)
            continue
        tau, x, v, over = move(valve, mode, sigma, drive, tau, h, x, v, tolerance, q, z)
        if over and mode == SLIP:
            mode, sigma, v = after_slip(valve, sigma, stem_at(drive, tau, x, v), q, z)
            if mode == SLIP:
                x += v * (h - tau)
                tau = h
        elif over and sigma * v >= valve.dz:
            mode = SLIP
        elif over:
            mode, sigma, v = STUCK, 0.0, 0.0
    return x, v, mode, sigma


def settle(valve: Karnopp, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Let the motion place have its say at the end of a step; return x, v."""
    stiffness = stiffness_at(valve, stem, q, z)
    return motion(stem.x, stem.v, external_force(valve, stem, q, z), stiffness, stem, q, z)


def rest(theta: Vector, state: Vector, time: float, position: float, command: float) -> None:
    """Set the state: at rest at a position, the command held for so long that the pressure path has settled."""
    p = start_pressure(command, Stem(time, position, 0.0, command), theta, state)
    stem = Stem(time, position, 0.0, p)
    indicated = start_stem(position, external_force(karnopp(theta), stem, theta, state), stem, theta, state)
    write(state, Condition(time, position, 0.0, p, STUCK, 0.0, indicated))


def begin(theta: Vector, state: Vector, time: float, shown: float, velocity: float, command: float) -> None:
    """Set the state: a sensor shows this position, at this velocity.

    The pressure is the nearest to the command, long held, with which the forces are in balance.
    """
    valve, x = karnopp(theta), shown
    p = valve.k_s * x / valve.A
    rest(theta, state, time, x, p)
    for _ in range(BALANCINGS):
        before = p
        p = equilibrium(valve, command, Stem(time, x, velocity, p), theta, state)
        rest(theta, state, time, x, p)
        off = shown - read(state).indicated
        if off == 0.0 and p == before:
            break
        x += off
    if velocity != 0.0:
        now = read(state)
        sigma = 1.0 if velocity > 0.0 else -1.0
        write(state, Condition(now.t, now.x, velocity, now.p, SLIP, sigma, now.indicated))


def equilibrium(valve: Karnopp, command: float, stem: Stem, q: Any, z: Any) -> float:
    """Return the pressure, Pa, nearest to a command with which the forces are in balance, those of effects as at p.

    At rest |A p - k_s x + F| <= F_s; in motion A p = k_s x - F + F_v v + F_c sign v.
    """
    middle = valve.k_s * stem.x + valve.F_v * stem.v - force(0.0, stem, q, z)
    if stem.v != 0.0:
        sigma = 1.0 if stem.v > 0.0 else -1.0
        F_c, _ = friction(valve.F_c, valve.F_s, sigma, stem, q, z)
        return (middle + sigma * F_c) / valve.A
    _, closing = friction(valve.F_c, valve.F_s, -1.0, stem, q, z)
    _, opening = friction(valve.F_c, valve.F_s, 1.0, stem, q, z)
    return min(max(command, (middle - closing) / valve.A), (middle + opening) / valve.A)


def follow(
    valve: Karnopp,
    drive: Drive,
    s: float,
    x: float,
    v: float,
    p: float,
    mode: int,
    sigma: float,
    tolerance: float,
    held: bool,
    q: Any,
    z: Any,
) -> tuple[float, float, int, float, float]:
    """Carry stem, memories and sensor over s (s), in which the pressure goes straight, to p; return x, v, mode, sigma
    and the indicated position at its end. A stem that is held stays once it is stuck.
    """
    x0 = x
    x, v, mode, sigma = step(valve, drive, s, x, v, mode, sigma, tolerance, held, q, z)
    x, v = settle(valve, Stem(drive.t + s, x, v, p), q, z)
    if v == 0.0:
        mode = STUCK
    stem = Stem(drive.t + s, x, v, p)
    remember(x0, s, stem, q, z)
    _, indicated = sensor(x0, x, s, stem, q, z)
    return x, v, mode, sigma, indicated


def carry(
    valve: Karnopp,
    now: Condition,
    command: float,
    duration: float,
    longest_step: float,
    tolerance: float,
    q: Any,
    z: Any,
) -> Condition:
    """Carry the valve over a duration (s) with the command (Pa) held, in equal steps of at most longest_step (s)."""
    t, x, v, p, mode, sigma, indicated = now
    n = 1 if duration <= longest_step else ceil(duration / longest_step - 1e-6)
    h = duration / n
    for i in range(n):
        t0, left = t + i * h, h
        while True:
            _, s = straight(command, left, Stem(t0, x, v, p), q, z)
            p0, p = pressure(command, command, s, Stem(t0, x, v, p), q, z)
            drive = Drive(t0, p0, (p - p0) / s)
            x, v, mode, sigma, indicated = follow(valve, drive, s, x, v, p, mode, sigma, tolerance, False, q, z)
            if not s < left:  # nothing cuts a step: LLVM then sees that there is no loop
                break
            t0 += s
            left -= s
    off = unknown(sigma + excess(valve, Stem(t + duration, x, v, p), q, z))
    return Condition(t + duration, x + off, v, p, mode, sigma, indicated + off)


def unknown(value: float) -> float:
    """Return 0, or NaN where a force, or a direction by it, is no finite number: nobody can say where such a stem is.

    What is compared with NaN is not greater: without this the stem would count as one that friction holds. The NaN goes
    by way of sigma, for through x each step of a stuck stem would wait for the one before: half the speed.
    """
    return 0.0 * value


def respond(
    theta: Vector,
    state: Vector,
    commands: Vector,
    periods: Vector,
    longest_step: float,
    tolerance: float,
    path: Vector,
) -> None:
    """Hold each command for its period in turn; write t, p, x, v, indicated into the rows of path, the start first."""
    valve, now = karnopp(theta), read(state)
    for i in range(len(commands) + 1):
        if i > 0:
            now = carry(valve, now, commands[i - 1], periods[i - 1], longest_step, tolerance, theta, state)
        path[0, i] = now.t
        path[1, i] = now.p
        path[2, i] = now.x
        path[3, i] = now.v
        path[4, i] = now.indicated
    write(state, now)


def read(state: Vector) -> Condition:
    """Read the state vector."""
    return Condition(state[0], state[1], state[2], state[3], int(state[4]), state[5], state[6])


def write(state: Vector, now: Condition) -> None:
    """Write the state vector; the memories are in it already."""
    state[0], state[1], state[2], state[3], state[4], state[5], state[6] = now


# The places, empty: each hands on what enters it first. Effects read their parameters from q, which is theta, and keep
# their memories in z, the state.


def start_pressure(u: float, stem: Stem, q: Any, z: Any) -> float:
    """Set the memories of the pressure path for a long held command; return the actuator pressure."""
    return u


def start_stem(y: float, F_e: float, stem: Stem, q: Any, z: Any) -> float:
    """Set the memories at the stem and of the sensor for a stem at rest; return the indicated position."""
    return y


def straight(u: float, h: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return the actuator pressure, and for how long, at most h, it goes straight with the command held."""
    return u, h


def pressure(start: float, end: float, h: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return the actuator pressure at the start and at the end of a step; the command is held."""
    return start, end


def force(F: float, stem: Stem, q: Any, z: Any) -> float:
    """Add the extra forces on the stem, N."""
    return F


def friction(F_c: float, F_s: float, direction: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return the Coulomb and static levels, N, that hold here and in this direction of (impending) motion."""
    return F_c, F_s


def motion(x: float, v: float, F_e: float, stiffness: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return where the stem is, and how fast, at the end of a step."""
    return x, v


def remember(x0: float, h: float, stem: Stem, q: Any, z: Any) -> None:
    """Carry the memories at the stem over a step that began at x0."""


def sensor(start: float, end: float, h: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return the indicated position at the start and at the end of a step."""
    return start, end
