"""The valve whose stem is told when it moves: the record has seen it, and sliding friction alone says where to.

    held    v = 0 whatever the forces                                 until the onset of a move
    loose   m v' = F_e - F_v v - F_c sigma, from rest if |F_e| > F_c  to the last sample that the record shows in motion
            once it has been faster than `FAST` v_s by the law of `sim.karnopp`, with Stribeck's term, until it sticks
    after it the stem slides until it stops, and is held again; where the command goes on, by that law: with F_c alone a
            ramp carried it on

x stem position, m; v velocity, m/s; F_e external force, F_c sliding friction, N, with all effects as in `sim.karnopp`.
Static friction has no part in when it moves. What it would have to be is told beside it: with F_s' = g F_s + d what the
effects make of static friction F_s at a place and time,

    L = (|F_e| - d) / g                          static friction, N, that just bears the load of a stem at rest

It was at least L at every sample of a rest, and at most L where the stem broke loose. A stem at rest may be anywhere
within `blur` of where it is held, m: of a rest L is the least there, of a break-away the most. A held stem that would
come to rest again within `UNSEEN` of it gives way, as into a stop: nobody has seen it stay.

Where an effect has moved the stuck stem by more than the blur, what is seen to move has not yet broken loose: it does
so by itself, at F_s by the law of `sim.karnopp`, and its onset tells no load. So it does where it rests within a move,
as in slips that follow each other faster than samples do. Eased, it goes on there at F_c: where the stem is then hangs
smoothly on every parameter, and a search that begins far off is led by that.

What acts on the stem's measured position, a positioner, is fed that: the loop is cut, and a pressure without feedback
is smooth in every parameter.

The file runs as it stands: the bare valve. `sim.kernel` compiles its text after that of `sim.karnopp`.
"""

from math import ceil
from typing import Any, NamedTuple

from sim.karnopp import (
    STUCK,
    Condition,
    Drive,
    Karnopp,
    Stem,
    Vector,
    excess,
    external_force,
    follow,
    friction,
    karnopp,
    pressure,
    read,
    straight,
    unknown,
    write,
)

SHARE = 0.01
"""Of F_s, for the difference that gives g."""
FOREVER_S = 1e9
FAST = 6.0
"""Of v_s: Stribeck's term is gone there, so that static friction makes no difference to a stem that has got there."""
LOOSE_S = 2e-3
"""Longest step of a stem that may slide, s: within a stem's own times it is fast, and has stopped again."""
FAR_M = 1e9
"""Place of a stem that was let go and has left."""
SETTLED_SHARE = 1e-6
"""Of the blur: what an indication moves by in a period once its sensor has come to rest."""
UNSEEN = 6.0
"""Times the blur: a stem that moves by less while it is held is not seen to, `COVERED` of `signals.moves`."""
HELD_N = 1e-9
"""L of a stem that is held and bears nothing: other than 0, which says that it is not."""


class Told(NamedTuple):
    """A stem told when it moves, L, N, the largest while it was at rest, and 1 if it has been fast since then."""

    now: Condition
    load: float
    fast: float
    landed: float
    """Where it came to rest, m: an effect may have moved it since."""
    alone: float
    """1 if it breaks loose by itself within a move: not eased, or moved at rest by an effect, by more than the blur."""


def told_valve(theta: Vector) -> Karnopp:
    """Return the constants of a stem that is told when it moves."""
    free = karnopp(theta)
    return Karnopp(free.per_m, free.A, free.k_s, free.F_v, free.F_c, free.F_s, free.v_s, free.dz, 1.0)


def ordinary(told: Karnopp) -> Karnopp:
    """Return the constants of the same stem that is told nothing."""
    return Karnopp(told.per_m, told.A, told.k_s, told.F_v, told.F_c, told.F_s, told.v_s, told.dz, 0.0)


def load(valve: Karnopp, stem: Stem, blur: float, breaks: bool, q: Any, z: Any) -> float:
    """L, N, within the blur: the least that a rest bore, or the most with which the stem breaks loose."""
    F_e = external_force(valve, stem, q, z)
    direction = 1.0 if F_e > 0.0 else -1.0
    farther = direction * external_force(valve, Stem(stem.t, stem.x + direction * blur, 0.0, stem.p), q, z)
    nearer = direction * external_force(valve, Stem(stem.t, stem.x - direction * blur, 0.0, stem.p), q, z)
    least, most = min(abs(F_e), farther, nearer), max(abs(F_e), farther, nearer)
    if least <= 0.0 and not breaks:
        return 0.0
    F_e = direction * (most if breaks else least)
    more = SHARE * valve.F_s
    _, F_s = friction(valve.F_c, valve.F_s, direction, stem, q, z)
    _, F_m = friction(valve.F_c, valve.F_s + more, direction, stem, q, z)
    g = (F_m - F_s) / more
    return valve.F_s + (direction * F_e - F_s) / g if g > 0.0 else valve.F_s


def gives_way(free: Karnopp, stem: Stem, blur: float, q: Any, z: Any) -> bool:
    """Whether a stem at rest breaks loose and stops again before anybody sees it, as in a stop."""
    F_e = external_force(free, stem, q, z)
    direction = 1.0 if F_e > 0.0 else -1.0
    F_c, F_s = friction(free.F_c, free.F_s, direction, stem, q, z)
    if abs(F_e) <= F_s:
        return False
    there = Stem(stem.t, stem.x + direction * UNSEEN * blur, 0.0, stem.p)
    return direction * external_force(free, there, q, z) <= F_c


def carried(
    valve: Karnopp,
    now: Condition,
    command: float,
    duration: float,
    longest_step: float,
    tolerance: float,
    held: bool,
    landed: float,
    alone: float,
    fast: float,
    seen: float,
    seen_rate: float,
    blur: float,
    place: float,
    q: Any,
    z: Any,
) -> Told:
    """Carry the valve over a duration (s) with the command (Pa) held; L is the largest in it of a stem at rest.

    At rest is, too, what is let go and not farther than `blur` from its `place`, m: so little nobody has seen.

    A pressure path that obeys the stem is fed `seen`, m, and its rate, m/s; NaN: the simulated stem.
    """
    t, x, v, p, mode, sigma, indicated = now
    fed = seen == seen  # noqa: PLR0124 -- NaN is unlike itself
    rests = held and mode == STUCK
    slow = not rests and fast == 0.0
    longest = FOREVER_S if rests and not fed else min(longest_step, LOOSE_S) if slow else longest_step
    free = ordinary(valve)
    n = 1 if duration <= longest else ceil(duration / longest - 1e-6)
    h = duration / n
    most = 0.0
    for i in range(n):
        t0, left = t + i * h, h
        while left > 0.0:
            there = seen + seen_rate * (t0 - t) if fed else x
            _, s = straight(command, left, Stem(t0, there, v, p), q, z)
            p0, p = pressure(command, command, s, Stem(t0, there, v, p), q, z)
            rested = mode == STUCK
            if rested or abs(x - place) <= blur:
                most = max(most, load(valve, Stem(t0, x, 0.0, p0), blur, not held, q, z))
            stays = held and not (rested and gives_way(free, Stem(t0 + s, x, 0.0, p), blur, q, z))
            crept = rested and abs(x - landed) > blur
            alone = 1.0 if crept else alone
            law = free if crept or fast > 0.0 or held != stays else valve
            drive = Drive(t0, p0, (p - p0) / s)
            x, v, mode, sigma, indicated = follow(law, drive, s, x, v, p, mode, sigma, tolerance, stays, q, z)
            if mode == STUCK:
                fast = 0.0 if held else fast * alone
            elif abs(v) > FAST * valve.v_s:
                fast = 1.0
            if not (rested and mode == STUCK) or held != stays:
                landed = x
            t0 += s
            left -= s
            if mode == STUCK and held and not (rested and p == p0):
                most = max(most, load(valve, Stem(t0, x, v, p), blur, False, q, z))
    off = unknown(sigma + excess(valve, Stem(t + duration, x, v, p), q, z))
    return Told(Condition(t + duration, x + off, v, p, mode, sigma, indicated + off), most, fast, landed, alone)


def alike(k: int, commands: Vector, held: Vector, indicated: Vector, blur: float) -> int:
    """Return the period after the last that goes on as the k-th: held throughout, the command the same, and at rest."""
    end = k + 1
    if k == 0 or held[k] < 1.0 or abs(indicated[k] - indicated[k - 1]) > SETTLED_SHARE * blur:
        return end
    while end < len(commands) and held[end] >= 1.0 and commands[end] == commands[k]:
        end += 1
    return end


def goes_on(k: int, commands: Vector, now: Condition) -> float:
    """Return 1 of a stem that still slides while its command changes, else 0."""
    return 1.0 if k > 0 and now.mode != STUCK and commands[k] != commands[k - 1] else 0.0


def unsay(loads: Vector, k: int) -> None:
    """Take back what was told up to a period to have broken it loose: it crept."""
    while k >= 0 and loads[k] > 0.0:
        loads[k] = 0.0
        k -= 1


def tell(
    theta: Vector,
    state: Vector,
    commands: Vector,
    periods: Vector,
    held: Vector,
    seen: Vector,
    longest_step: float,
    tolerance: float,
    blur: float,
    alone: float,
    indicated: Vector,
    loads: Vector,
) -> None:
    """Hold each command for its period in turn, the stem for a share of it; write what is indicated, m, (periods + 1,).

    Seen is what a pressure path that obeys the stem is fed, m, (periods + 1,); NaN: the simulated stem. Alone: 1 where
    what rests within a move breaks loose by itself, 0 where it is eased.
    Shares, (periods,), from 0, loose throughout, to 1, held throughout. Loads, (2, periods): L, N, of the stem held in
    a period, and where it was let go in it; 0 where it was not.

    A stem that stays held under the same command is carried at once to its end, if what it shows has come to rest: L is
    convex between, and greatest at one of the ends.
    """
    valve, now, fast = told_valve(theta), read(state), 0.0
    place, landed = FAR_M, now.x
    indicated[0] = now.indicated
    k, n = 0, len(commands)
    while k < n:
        share = held[k]
        loads[0, k], loads[1, k] = 0.0, 0.0
        command, rests_s, slides_s = commands[k], share * periods[k], (1.0 - share) * periods[k]
        rate = (seen[k + 1] - seen[k]) / periods[k]
        fed = seen[k]
        end = k + 1
        if rests_s > 0.0:
            if now.mode == STUCK and not seen[k] == seen[k]:  # noqa: SIM201 -- NaN is unlike itself
                end = alike(k, commands, held, indicated, blur)
                for j in range(k + 1, end):
                    rests_s += periods[j]
            fast = max(fast, goes_on(k, commands, now))
            here = carried(
                *(valve, now, command, rests_s, longest_step, tolerance, True, landed, alone),
                *(fast, fed, rate, blur, FAR_M, theta, state),
            )
            now, fast, landed, alone = here.now, here.fast, here.landed, here.alone
            for j in range(k, end):
                loads[0, j], loads[1, j], indicated[j + 1] = max(here.load, HELD_N), 0.0, now.indicated
            place = now.x if now.mode == STUCK else FAR_M
        if slides_s > 0.0:
            still = abs(now.x - place) <= blur and abs(now.x - landed) <= blur
            fed += rate * rests_s
            here = carried(
                *(valve, now, command, slides_s, longest_step, tolerance, False, landed, alone),
                *(fast, fed, rate, blur, place, theta, state),
            )
            now, fast, landed, alone = here.now, here.fast, here.landed, here.alone
            if still:
                loads[1, k] = max(here.load, loads[0, k], HELD_N)
            if abs(now.x - place) > blur:
                place = FAR_M
            if now.mode == STUCK and abs(now.x - landed) > blur:
                unsay(loads[1], k)
        k = end
        indicated[k] = now.indicated
    write(state, now)
