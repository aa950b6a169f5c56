"""Dead time of converter, tubing and bus.

    p(t) = u(t - T)

T dead time, s; u entering pressure, p leaving pressure, Pa. What entered is kept as stretches of straight lines,
(time, value, slope) each, in a ring of STRETCHES; a held command is one stretch. Stretches shorter than
T / (STRETCHES - 1) are joined, so that the ring always reaches back to t - T: a command held for longer than that comes
out exact. In a step during which one stretch follows another, p is held at its mean.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

STRETCHES = 4096
MEMORY = 2 + 3 * STRETCHES
STEP_S = 2e-3
COUNT, READ = 0, 1
"""Stretches written so far, and which of them was read last."""
TIME, VALUE, SLOPE = 2, 2 + STRETCHES, 2 + 2 * STRETCHES
"""Where the columns of the ring begin."""
LONG_AGO_S = -1e9
NO_TIME = 1e-6
"""Of half a step: a stretch that reaches no farther into it does not count."""
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


def pressure(u: float, t: float, middle: float, q: Parameters, z: Memory) -> float:
    """Return p, its mean over the step if that is of more than one stretch."""
    T, half = q.dead_time_s, abs(middle - t)
    if T <= 0.0:
        return u
    begins, ends, written = middle - half - T, middle + half - T, middle - half
    k = stretch_at(begins + NO_TIME * half, z)
    until = z[TIME + (k + 1) % STRETCHES] if k < int(z[COUNT]) - 1 else written
    if until >= ends - NO_TIME * half:
        k %= STRETCHES
        return float(z[VALUE + k] + z[SLOPE + k] * (t - T - z[TIME + k]))
    return mean(begins, ends, written, k, u, z)


def mean(begins: float, ends: float, written: float, k: int, u: float, z: Memory) -> float:
    """Return the mean of what entered between two times, from the k-th stretch on; after what is written, u."""
    area, time = u * max(0.0, ends - written), begins
    while time < min(ends, written):
        until = min(ends, written)
        if k < int(z[COUNT]) - 1:
            until = min(until, float(z[TIME + (k + 1) % STRETCHES]))
        here = k % STRETCHES
        area += (until - time) * (z[VALUE + here] + z[SLOPE + here] * (0.5 * (time + until) - z[TIME + here]))
        time = until
        k += 1
    return area / (ends - begins)


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
