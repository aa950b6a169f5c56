"""The valve where samples lie farther apart than a slide lasts: no inertia, a step a sample.

    STUCK   x stays, but where an effect makes it yield               until |F_e| > F_s on the pressure's way
    SLIP    s F_e(x, p) = F_f(v) + F_v v,   v = (dx/dp) p'             until v = v_l, where it lands
    v_l     d/dv (F_f(v) + F_v v) = 0, F_f(v) = F_c + (F_s - F_c) exp(-(v / v_s)^2): below v_l friction rises as the
            stem slows down, which holds it at once

x stem position, m; v velocity, m/s; p actuator pressure, Pa, and p' its rate, Pa/s; s direction; F_e external force, N,
friction and all effects as in `sim.karnopp`. A stem that breaks away goes to where the forces balance at v_l, as the
bare stem answers a step; but for a slide under way at the end of a step, its own times are no part of it, nor is an
overshoot. It then follows the pressure, or where that moves too slowly for v_l sticks and slips again.

The pressure path shows its values and rates at both ends of the step, exact for one lag, rate limit or dead time. Of a
pressure that approaches its end as behind a lag, p is a straight line over p', so that it lands at

    p_l = p_0 + (p_1 - p_0) (p'_0 - p'_l) / (p'_0 - p'_1),    p'_l = v_l / (dx/dp)

A stem that breaks away under a slower one leaps D ahead, and goes on with the pressure meanwhile, at u = p' dx/dp,

    v(t) = u + (D / T - u) exp(-t / T),   T = F_v / k_s,   until v = v_l: for T log((D / T - u) / (v_l - u))

Behind a positioner the stem feeds back on the pressure. There a period is cut into steps so short that the pressure is
a straight line over each, p'_0 = p'_1, and a jump, which no sample sees under way, is over at once. So it is along a
measured pressure, of which the ends of parts of a sample are given.

Where a step is told which way the stem went, because the pressure between samples is not known, the stem lands in that
direction at the pressure of the step's end, or stays.

The file runs as it stands: the bare valve. `sim.kernel` compiles its text after that of `sim.karnopp`.
"""

# ruff: noqa: ARG001 -- an empty place takes what a full one needs.
from math import ceil, exp, log
from typing import Any, NamedTuple

from sim.karnopp import (
    SLIP,
    STUCK,
    Condition,
    Karnopp,
    Stem,
    Vector,
    excess,
    external_force,
    friction,
    impulse,
    karnopp,
    read,
    remember,
    sensor,
    settle,
    unknown,
    write,
)

FREE, FED_BACK, ALONG = 2.0, 3.0, 4.0
"""What a step is told where the stem decides itself, where the pressure hangs on it besides, and where the pressure
goes evenly to what is commanded; else the direction in which it went, -1, 0 or 1."""
SLOWEST, FASTEST, SPEEDS = 1e-3, 300.0, 64
"""In Stribeck velocities: where v_l is sought, and on how many points first."""
GOLDEN = 0.6180339887498949
NARROWINGS = 24
BALANCED_N, LEAST_M = 1e-7, 1e-13
"""A force, and a distance, that are none."""
DOUBLINGS, ROUNDS = 40, 60
MOST_SLIPS = 1000
"""Slips in one step, after which the stem follows the pressure."""
MOMENT = 1e-4
"""Of a step, over which the pressure's rate at its ends is seen."""
SEEN_M = 1e-8
"""Of a jump, that is still under way at a step's end."""
GONE = 1e-9
"""Of a rate at a step's start: at its end none."""
SLIDING_TIMES = 2.0
"""F_v / k_s, the sum of the slide's times: a straight line that lasts so long is late by as much as the slide."""


class Way(NamedTuple):
    """The pressure over one step: values, Pa, and rates, Pa/s, at its ends."""

    p0: float
    rate0: float
    p1: float
    rate1: float


def push(valve: Karnopp, sigma: float, speed: float, t: float, x: float, p: float, q: Any, z: Any) -> float:
    """Force, N, on a stem that slides at a speed in direction sigma, friction taken off."""
    stem = Stem(t, x, sigma * speed, p)
    F_c, F_s = friction(valve.F_c, valve.F_s, sigma, stem, q, z)
    w = speed / valve.v_s
    return sigma * external_force(valve, stem, q, z) - F_c - (F_s - F_c) * exp(-w * w) - valve.F_v * speed


def landing_speed(valve: Karnopp, t: float, x: float, p: float, q: Any, z: Any) -> float:
    """v_l, m/s."""
    ratio: float = (FASTEST / SLOWEST) ** (1.0 / SPEEDS)
    best, most = SLOWEST * valve.v_s, push(valve, 1.0, SLOWEST * valve.v_s, t, x, p, q, z)
    speed = best
    for _ in range(SPEEDS):
        speed *= ratio
        here = push(valve, 1.0, speed, t, x, p, q, z)
        if here > most:
            best, most = speed, here
    low, high = best / ratio, best * ratio
    for _ in range(NARROWINGS):
        one, other = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        if push(valve, 1.0, one, t, x, p, q, z) > push(valve, 1.0, other, t, x, p, q, z):
            high = other
        else:
            low = one
    return 0.5 * (low + high)


def balanced(valve: Karnopp, sigma: float, speed: float, t: float, x: float, p: float, q: Any, z: Any) -> float:
    """Return the x nearest to this one at which nothing pushes; this one if there is none. As the Illinois method."""
    a, f_a = x, push(valve, sigma, speed, t, x, p, q, z)
    step = sigma * f_a / valve.k_s
    b = a + step
    f_b = push(valve, sigma, speed, t, b, p, q, z)
    for _ in range(DOUBLINGS):
        if f_a * f_b <= 0.0 or abs(f_b) <= BALANCED_N:
            break
        step *= 2.0
        a, f_a = b, f_b
        b = a + step
        f_b = push(valve, sigma, speed, t, b, p, q, z)
    if f_a * f_b > 0.0 and abs(f_b) > BALANCED_N:
        return x
    moved = 0
    for _ in range(ROUNDS):
        if abs(f_b) <= BALANCED_N or abs(b - a) <= LEAST_M:
            break
        c = b - f_b * (b - a) / (f_b - f_a)
        f_c = push(valve, sigma, speed, t, c, p, q, z)
        if f_c * f_b < 0.0:
            a, f_a, moved = b, f_b, 0
        else:
            f_a *= 0.5 if moved > 0 else 1.0
            moved = 1
        b, f_b = c, f_c
    return b


def breaks(valve: Karnopp, begin: Stem, end: Stem, q: Any, z: Any) -> float:
    """Return the share of the way from one place at rest to another at which the stem breaks away; above 1 if not."""
    late = excess(valve, end, q, z)
    early = excess(valve, begin, q, z)
    if early > 0.0:
        return 0.0
    if late <= 0.0:
        return FREE
    low, high = 0.0, 1.0
    moved = 0
    for _ in range(ROUNDS):
        middle = high - late * (high - low) / (late - early)
        there = excess(valve, between(begin, end, middle), q, z)
        if abs(there) <= BALANCED_N or high - low <= GONE:
            return middle
        if there > 0.0:
            high, late = middle, there
            early *= 0.5 if moved > 0 else 1.0
            moved = 1
        else:
            low, early = middle, there
            late *= 0.5 if moved < 0 else 1.0
            moved = -1
    return high


def between(begin: Stem, end: Stem, share: float) -> Stem:
    """Return the stem at a share of the way from one place at rest to another."""
    return Stem(
        begin.t + share * (end.t - begin.t),
        begin.x + share * (end.x - begin.x),
        0.0,
        begin.p + share * (end.p - begin.p),
    )


def passed(x0: float, h: float, stem: Stem, q: Any, z: Any, indicated: float) -> float:
    """Carry the memories at the stem and of the sensor over a part of a step; return what is indicated then."""
    if h <= 0.0:
        return indicated
    remember(x0, h, stem, q, z)
    _, indicated = sensor(x0, stem.x, h, stem, q, z)
    return indicated


def landed(
    valve: Karnopp, x0: float, h: float, stem: Stem, speed: float, q: Any, z: Any, indicated: float
) -> tuple[float, float]:
    """Let a slide that took h end in rest; return x and what is indicated."""
    sliding = Stem(stem.t, stem.x, speed, stem.p)
    settle(valve, sliding, q, z)
    indicated = passed(x0, h, sliding, q, z, indicated)
    x, _ = settle(valve, stem, q, z)
    return x, indicated


def lands_at(
    way: Way, p_b: float, v0: float, v1: float, mean: float, leap: float, v_l: float, sliding_s: float
) -> float:
    """Return the pressure, Pa, of the landing of a stem that slides from p_b on.

    Speeds, and the way that it leaps ahead, in the slide's direction; sliding_s is T.
    """
    if v0 > v_l and v1 > GONE * v0:
        p_l = way.p0 + (way.p1 - way.p0) * (v0 - v_l) / (v0 - v1)
        if (p_l - p_b) * (way.p1 - p_b) > 0.0:
            return min(max(p_l, min(p_b, way.p1)), max(p_b, way.p1))
    elif v0 > v_l:
        return way.p1
    jumps = way.rate0 == 0.0 and way.rate1 == 0.0
    if mean > v_l or jumps:
        return way.p1
    share = (p_b - way.p0) / (way.p1 - way.p0)
    u, ahead = v0 + (v1 - v0) * share, leap / sliding_s if sliding_s > 0.0 else 0.0
    if u >= v_l or ahead <= v_l:
        return p_b
    rate = way.rate0 + (way.rate1 - way.rate0) * share
    p_l = p_b + rate * sliding_s * log((ahead - u) / (v_l - u))
    return min(max(p_l, min(p_b, way.p1)), max(p_b, way.p1))


def unfinished(valve: Karnopp, age: float) -> tuple[float, float]:
    """Return the share of a jump that is still to come so long after it began, and by how much less than in the long
    run a stem then lags behind a place that moves at 1 m/s, m; of the bare stem's own times."""
    damping, kappa = valve.F_v * valve.per_m, valve.k_s * valve.per_m
    g, slope = impulse(damping, kappa, age)
    share = slope + damping * g
    return share, share * damping / kappa - g


def left(way: Way, p: float, h: float) -> float:
    """Return how much of a step h, s, is left when the pressure comes to p: behind a lag, or straight."""
    share = (p - way.p0) / (way.p1 - way.p0)
    there = way.rate0 + (way.rate1 - way.rate0) * share
    if way.rate1 * way.rate0 > 0.0 and abs(way.rate1) > GONE * abs(way.rate0) and abs(there / way.rate1 - 1.0) > 1e-6:
        return min(max((way.p1 - p) * log(there / way.rate1) / (there - way.rate1), 0.0), h)
    return h * (1.0 - share)


def told_step(
    valve: Karnopp, now: Condition, told: float, p: float, h: float, v_l: float, slide_s: float, q: Any, z: Any
) -> Condition:
    """Carry the stem over a step of which the direction is known, and the pressure at its end."""
    t, x, _, _, _, _, indicated = now
    slides_s = 0.0
    if told != 0.0:
        slides_s = min(slide_s, h)
        x1 = balanced(valve, told, v_l, t + h, x, p, q, z)
        x, indicated = landed(valve, x, slides_s, Stem(t + slides_s, x1, 0.0, p), told * v_l, q, z, indicated)
    x, _ = settle(valve, Stem(t + h, x, 0.0, p), q, z)
    indicated = passed(x, h - slides_s, Stem(t + h, x, 0.0, p), q, z, indicated)
    return Condition(t + h, x, 0.0, p, STUCK, 0.0, indicated)


class Loose(NamedTuple):
    """A stem that slides, in a direction, from a time in its step, s, a place, m, and a pressure, Pa, on."""

    tau: float
    x: float
    p: float
    sigma: float


class Slide(NamedTuple):
    """Where a slide has come to: whether it is over, its time in the step, s, x, v, p and what is indicated."""

    over: bool
    tau: float
    x: float
    v: float
    p: float
    indicated: float


def held(
    valve: Karnopp, t: float, tau: float, h: float, x: float, way: Way, p: float, q: Any, z: Any, indicated: float
) -> tuple[bool, Loose, float]:
    """Hold the stuck stem until it breaks away or the step ends; return whether it has, where, what is indicated."""
    x0 = x
    x, _ = settle(valve, Stem(t + tau, x, 0.0, p), q, z)
    begin, x1 = Stem(t + tau, x, 0.0, p), x
    if p != way.p1:
        x1, _ = settle(valve, Stem(t + h, x, 0.0, way.p1), q, z)
    end = Stem(t + h, x1, 0.0, way.p1)
    share = breaks(valve, begin, end, q, z)
    if share > 1.0:
        return False, Loose(h, x1, way.p1, 0.0), passed(x0, h - tau, end, q, z, indicated)
    stem = between(begin, end, share)
    if stem.p != p:
        rested = max(0.0, h - left(way, stem.p, h) - tau)
        indicated = passed(x0, rested, stem, q, z, indicated)
        tau += rested
    sigma = 1.0 if external_force(valve, stem, q, z) > 0.0 else -1.0
    return True, Loose(tau, stem.x, stem.p, sigma), indicated


def slid(
    valve: Karnopp,
    t: float,
    h: float,
    loose: Loose,
    way: Way,
    v_l: float,
    slide_s: float,
    at_once: bool,
    q: Any,
    z: Any,
    shown: float,
) -> Slide:
    """Let a loose stem slide until it lands or the step ends; `shown` is what was indicated as it began.

    A jump takes its own time, unless it is over `at_once`.
    """
    tau, x, p, sigma = loose
    at_p = balanced(valve, sigma, v_l, t + tau, x, p, q, z)
    if sigma * (at_p - x) < 0.0:
        at_p = x
    share, less_s = (0.0, 0.0) if at_once else unfinished(valve, h - tau)
    behind = (at_p - x) * share
    p_l, v1, at_end = p, 0.0, at_p
    if sigma * (way.p1 - p) > 0.0:
        at_end = balanced(valve, sigma, v_l, t + h, at_p, way.p1, q, z)
        slope = (at_end - at_p) / (way.p1 - p)
        v0, v1 = sigma * way.rate0 * slope, sigma * way.rate1 * slope
        mean, leap = sigma * (at_end - at_p) / max(h - tau, GONE * h), sigma * (at_p - x)
        p_l = lands_at(way, p, v0, v1, mean, leap, v_l, slide_s / SLIDING_TIMES)
    if v1 > v_l or abs(behind) > SEEN_M:
        speed = max(v1, v_l)
        behind -= sigma * speed * less_s
        x1 = balanced(valve, sigma, speed, t + h, at_end, way.p1, q, z) - behind
        stem = Stem(t + h, x1, sigma * speed, way.p1)
        settle(valve, stem, q, z)
        return Slide(False, h, x1, stem.v, way.p1, passed(x, h - tau, stem, q, z, shown))
    lasts = min(slide_s, h - tau)
    if p_l != p:
        lasts = max(lasts, h - left(way, p_l, h) - tau)
    x1 = at_p if p_l == p else balanced(valve, sigma, v_l, t + tau + lasts, at_p, p_l, q, z)
    x1, shown = landed(valve, x, lasts, Stem(t + tau + lasts, x1, 0.0, p_l), sigma * v_l, q, z, shown)
    return Slide(True, tau + lasts, x1, 0.0, p_l, shown)


def free_step(
    valve: Karnopp, now: Condition, way: Way, h: float, v_l: float, slide_s: float, at_once: bool, q: Any, z: Any
) -> Condition:
    """Carry the stem over a step: it sticks, breaks away, follows and lands as often as the pressure makes it."""
    t, x, indicated = now.t, now.x, now.indicated
    tau, p = 0.0, way.p0
    sliding, loose = now.mode == SLIP, Loose(0.0, x, way.p0, now.sigma)
    for _ in range(MOST_SLIPS):
        began_m, was_sliding = x, sliding
        if not sliding:
            broke, loose, indicated = held(valve, t, tau, h, x, way, p, q, z, indicated)
            if not broke:
                return Condition(t + h, loose.x, 0.0, way.p1, STUCK, 0.0, indicated)
        slide = slid(valve, t, h, loose, way, v_l, slide_s, at_once, q, z, indicated)
        tau, x, p, indicated, sliding = slide.tau, slide.x, slide.p, slide.indicated, False
        if not slide.over:
            return Condition(t + h, x, slide.v, way.p1, SLIP, loose.sigma, indicated)
        if abs(x - began_m) <= LEAST_M and p == loose.p and not was_sliding:
            break
    stem = Stem(t + h, x, 0.0, way.p1)
    return Condition(t + h, x, 0.0, way.p1, STUCK, 0.0, passed(x, h - tau, stem, q, z, indicated))


def way_of(command: float, h: float, stem: Stem, q: Any, z: Any) -> Way:
    """Carry the pressure path over a step with the command held."""
    moment = MOMENT * h
    t, x, v, _ = stem
    p0, early = pressure_ends(command, command, moment, stem, q, z)
    _, late = pressure_ends(command, command, h - 2.0 * moment, Stem(t + moment, x, v, early), q, z)
    _, p1 = pressure_ends(command, command, moment, Stem(t + h - moment, x, v, late), q, z)
    return Way(p0, (early - p0) / moment, p1, (p1 - late) / moment)


def straight_way(command: float, h: float, stem: Stem, q: Any, z: Any) -> Way:
    """Carry a pressure path that the stem feeds back on over a step, short enough for a straight line."""
    p0, p1 = pressure_ends(command, command, h, stem, q, z)
    return line(p0, p1, h)


def line(p0: float, p1: float, h: float) -> Way:
    """Return the way of a pressure that goes evenly."""
    rate = (p1 - p0) / h
    return Way(p0, rate, p1, rate)


def over_period(
    valve: Karnopp,
    now: Condition,
    command: float,
    duration: float,
    told: float,
    longest_step: float,
    v_l: float,
    slide_s: float,
    q: Any,
    z: Any,
) -> Condition:
    """Carry the valve over a duration, s, with the command, Pa, held, in equal steps of at most longest_step, s."""
    begin, p = now, now.p
    n = 1 if duration <= longest_step else ceil(duration / longest_step - 1e-6)
    h = duration / n
    fed_back = told == FED_BACK
    for k in range(n):
        t = begin.t + k * h
        stem = Stem(t, now.x, now.v, p)
        if told == ALONG:
            way = line(p, p + (command - p) / (n - k), h)
        elif fed_back:
            way = straight_way(command, h, stem, q, z)
        else:
            way = way_of(command, h, stem, q, z)
        p = way.p1
        if told >= FREE:
            here = Condition(t, now.x, now.v, way.p0, now.mode, now.sigma, now.indicated)
            now = free_step(valve, here, way, h, v_l, slide_s, fed_back, q, z)
    if told < FREE:
        now = told_step(valve, begin, told, p, duration, v_l, slide_s, q, z)
    x = now.x + unknown(excess(valve, Stem(now.t, now.x, now.v, now.p), q, z))
    return Condition(now.t, x, now.v, now.p, now.mode, now.sigma, now.indicated + (x - now.x))


def glide(
    theta: Vector,
    state: Vector,
    commands: Vector,
    periods: Vector,
    told: Vector,
    longest_step: float,
    path: Vector,
) -> None:
    """Hold each command for its period in turn; write t, p, x, v, indicated into the rows of path, the start first.

    `told` says of each period whether the stem is free (FREE, FED_BACK, ALONG), or the direction in which it went. It
    is cut into equal steps of at most longest_step, s: one, but where effects of the pressure path with a memory follow
    each other, or the stem feeds back on it.
    """
    valve, now, q, z = karnopp(theta), read(state), theta, state
    v_l = landing_speed(valve, now.t, now.x, now.p, q, z)
    slide_s = SLIDING_TIMES * valve.F_v / valve.k_s
    for i in range(len(commands) + 1):
        if i > 0:
            now = over_period(
                valve, now, commands[i - 1], periods[i - 1], told[i - 1], longest_step, v_l, slide_s, q, z
            )
        path[0, i] = now.t
        path[1, i] = now.p
        path[2, i] = now.x
        path[3, i] = now.v
        path[4, i] = now.indicated
    write(state, now)


# The place, empty.


def pressure_ends(start: float, end: float, h: float, stem: Stem, q: Any, z: Any) -> tuple[float, float]:
    """Return the actuator pressure of both instants, the start's and the end's, with the command held."""
    return start, end
