"""Dead time of converter, tubing and bus.

    p(t) = u(t - T)

T dead time, s; u entering pressure, p leaving pressure, Pa. What entered is kept as stretches of straight lines,
(time, value, slope) each, in a ring of STRETCHES; a held command is one stretch. Stretches shorter than
T / (STRETCHES - 1) are joined, so that the ring always reaches back to t - T: a command held for longer than that comes
out exact. A step ends where a jump comes out, and at bends that are not too near.
"""

from math import inf
from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

STRETCHES = 4096
MEMORY = 2 + 3 * STRETCHES
STEP_S = inf
COUNT, READ = 0, 1
"""Stretches written so far, and which of them was read last."""
TIME, VALUE, SLOPE = 2, 2 + STRETCHES, 2 + 2 * STRETCHES
"""Where the columns of the ring begin."""
LONG_AGO_S = -1e9
NO_TIME_S = 1e-9
"""A stretch that lasts no longer is over."""
JUMP = 1e-9
"""Share of the pressure by which it has jumped, and is not merely rounded."""
BEND = 1e-4
"""Share of the pressure that a bend must be off a straight line to end a step: what follows a ramp bends at every step,
if only by rounding."""
MOST_CUTS = 8
"""Of what is left of a step a bend cuts off no less than this part. Behind a lag the end of a step is a bend, which
comes out T later and would end another step there, and so on without end."""
COMPLAINT = "air supply or leak"
LOOKS = "Everything is late by the same time: after each change of the command nothing happens for T, then all of it."
CONFOUNDED = {
    "ip_lag": "the first moments after a step: the dead time answers not at all, the lag at once",
    "sensor_lag": "the shape of a slip: the dead time leaves it as it is, the lag rounds it",
}


class Parameters(NamedTuple):
    """T."""

    dead_time_s: Annotated[
        float, Parameter("dead time", 0.0, 5.0, off=0.0, starts=(0.003, 0.01, 0.03, 0.1, 0.3), guess="delay")
    ]


def start(t: float, signal: float, z: Memory) -> None:
    """Held since long ago."""
    z[COUNT] = 1.0
    z[READ] = 0.0
    z[TIME] = t + LONG_AGO_S
    z[VALUE] = signal
    z[SLOPE] = 0.0


def straight(u: float, h: float, t: float, q: Parameters, z: Memory) -> float:
    """Until a jump comes out, or a bend, but for bends that would cut the step too finely."""
    T, newest = q.dead_time_s, int(z[COUNT]) - 1
    if T <= NO_TIME_S:
        return h
    k = stretch_at(t - T + NO_TIME_S, z)
    while k < newest:
        here, after = k % STRETCHES, (k + 1) % STRETCHES
        lasts = z[TIME + after] - (t - T)
        if lasts >= h - NO_TIME_S:
            return h
        if jumps(z[VALUE + after], z[TIME + after], here, z):
            return float(lasts)
        if lasts * MOST_CUTS >= h and bends(z[SLOPE + after] - z[SLOPE + here], lasts, h, u):
            return float(lasts)
        k += 1
    here = k % STRETCHES
    cuts = jumps(u, t, here, z) or (h <= MOST_CUTS * T and bends(z[SLOPE + here], T, h, u))
    return T if cuts and h - NO_TIME_S > T else h


def jumps(value: float, t: float, here: int, z: Memory) -> bool:
    """Return whether a value is not that to which a stretch goes on."""
    apart = abs(value - z[VALUE + here] - z[SLOPE + here] * (t - z[TIME + here]))
    return bool(apart > JUMP * max(abs(value), abs(z[VALUE + here])))


def bends(change: float, lasts: float, h: float, u: float) -> bool:
    """Return whether a slope that changes within a step takes it off the straight line from its begin to its end."""
    return bool(abs(change) * lasts * (h - lasts) > BEND * h * abs(u))


def pressure(u: float, t: float, middle: float, q: Parameters, z: Memory) -> float:
    """Return p, on this side of a jump; u, back along the newest stretch, where that is not written yet."""
    T = q.dead_time_s
    if T <= NO_TIME_S:
        return u
    if abs(middle - t) >= T:
        return float(u - T * z[SLOPE + (int(z[COUNT]) - 1) % STRETCHES])
    k = stretch_at(t - T + (NO_TIME_S if middle > t else -NO_TIME_S), z) % STRETCHES
    return float(z[VALUE + k] + z[SLOPE + k] * (t - T - z[TIME + k]))


def stretch_at(time: float, z: Memory) -> int:
    """Return which stretch holds at a time, or the oldest; sought from the last one read."""
    newest = int(z[COUNT]) - 1
    oldest = max(0, newest + 1 - STRETCHES)
    k = max(oldest, int(z[READ]))
    while k < newest and z[TIME + (k + 1) % STRETCHES] <= time:
        k += 1
    while k > oldest and z[TIME + k % STRETCHES] > time:
        k -= 1
    z[READ] = k
    return k


def advance(t: float, before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Write down what enters: go on with the newest stretch, join the step to it, or begin another."""
    k = (int(z[COUNT]) - 1) % STRETCHES
    slope = (after - before) / h
    age = t - z[TIME + k]
    if slope == z[SLOPE + k] and before == z[VALUE + k] + slope * age:
        return
    if age < q.dead_time_s / (STRETCHES - 1):
        z[SLOPE + k] = (after - z[VALUE + k]) / (age + h)
        return
    k = (k + 1) % STRETCHES
    z[COUNT] += 1.0
    z[TIME + k] = t
    z[VALUE + k] = before
    z[SLOPE + k] = slope


def inverse(q: Parameters) -> Inverse:
    """Wait it out."""
    return Inverse(dead_time_s=q.dead_time_s)
