"""Dead time of converter, tubing and bus.

    p(t) = u(t - T)

T dead time, s; u entering pressure, p leaving pressure, Pa. What entered is kept as stretches of straight lines,
(time, value, slope) each, in a ring of STRETCHES; a held command is one stretch. Stretches shorter than
T / (STRETCHES - 1) are joined, so that the ring always reaches back to t - T: a command held for longer than that comes
out exact. A step ends where one stretch follows another.
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
NONE_S = 1e-6
"""A dead time that is none: steps behind a lag end after one dead time each, and a search may go towards none."""
LOOKS = "Everything is late by the same time: after each change of the command nothing happens for T, then all of it."
CONFOUNDED = {
    "ip_lag": "the first moments after a step: the dead time answers not at all, the lag at once",
    "sensor_lag": "the shape of a slip: the dead time leaves it as it is, the lag rounds it",
}


class Parameters(NamedTuple):
    """T."""

    dead_time_s: Annotated[float, Parameter("dead time", 0.0, 5.0, off=0.0, starts=(0.003, 0.01, 0.03, 0.1, 0.3))]


def start(t: float, signal: float, z: Memory) -> None:
    """Held since long ago."""
    z[COUNT] = 1.0
    z[READ] = 0.0
    z[TIME] = t + LONG_AGO_S
    z[VALUE] = signal
    z[SLOPE] = 0.0


def straight(u: float, h: float, t: float, q: Parameters, z: Memory) -> float:
    """Until the stretch that comes out ends; the newest one's successor begins now if u does not go on with it."""
    T = q.dead_time_s
    if T <= NONE_S:
        return h
    k = stretch_at(t - T + NO_TIME_S, z)
    here, lasts = k % STRETCHES, h
    if k < int(z[COUNT]) - 1:
        lasts = z[TIME + (k + 1) % STRETCHES] - (t - T)
    elif u != z[VALUE + here] + z[SLOPE + here] * (t - z[TIME + here]):
        lasts = T
    return float(lasts) if lasts < h - NO_TIME_S else h


def pressure(u: float, t: float, middle: float, q: Parameters, z: Memory) -> float:
    """Return p, of the stretch that comes out amid the step; u where that is not written down yet."""
    T = q.dead_time_s
    if max(NONE_S, abs(middle - t)) >= T:
        return u
    k = stretch_at(middle - T, z) % STRETCHES
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
