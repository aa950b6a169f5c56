"""Dead time of converter, tubing and bus.

    p(t) = u(t - T)

T dead time, s; u entering pressure, p leaving pressure, Pa. What entered is kept as stretches of straight lines,
(time, value, slope) each, in a ring of STRETCHES; a held command is one stretch. Stretches shorter than
T / (STRETCHES - 1) are joined, so that the ring always reaches back to t - T: a command held for longer than that comes
out exact. A jump comes out at the nearest end of a step; hence T below half a step is none.
"""

from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

STRETCHES = 4096
MEMORY = 2 + 3 * STRETCHES
COUNT, READ = 0, 1
"""Stretches written so far, and which of them was read last."""
TIME, VALUE, SLOPE = 2, 2 + STRETCHES, 2 + 2 * STRETCHES
"""Where the columns of the ring begin."""
LONG_AGO_S = -1e9
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
    """Return p, on the stretch that holds in the middle of the step."""
    if q.dead_time_s <= abs(middle - t):
        return u
    k = stretch_at(middle - q.dead_time_s, z)
    return float(z[VALUE + k] + z[SLOPE + k] * (t - q.dead_time_s - z[TIME + k]))


def stretch_at(time: float, z: Memory) -> int:
    """Return the place in the ring of the stretch that holds at a time, or of the oldest; sought from the last read."""
    newest = int(z[COUNT]) - 1
    oldest = max(0, newest + 1 - STRETCHES)
    k = max(oldest, int(z[READ]))
    while k < newest and z[TIME + (k + 1) % STRETCHES] <= time:
        k += 1
    while k > oldest and z[TIME + k % STRETCHES] > time:
        k -= 1
    z[READ] = k
    return k % STRETCHES


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
