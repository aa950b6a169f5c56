"""How far a response is from measured positions, sample by sample, and what that costs.

    d_i = x_i - y_i                                                    simulated less measured indicated position, m
    r_i = sign(d_i) max(|d_i| - inside, 0) / sigma                     -hopeless <= d_i <= hopeless
    cost = sum_i s^2 (sqrt(1 + (r_i / s)^2) - 1)                       soft L1 of scale s

inside is half a quantum where a sensor rounds, else 0. A measured position that is not a number is not compared; a
simulated one that is not is hopeless. The cost only grows along a response, which is given up where it is no longer
below a limit: what is compared with a best so far mostly shows early that it is worse.

The file runs as it stands: the bare valve. `sim.kernel` compiles its text after that of `sim.karnopp`.
"""

from math import sqrt
from typing import NamedTuple

from sim.karnopp import (
    STUCK,
    Condition,
    Vector,
    read,
    respond,
    write,
)

AT_ONCE = 64
"""Periods after which the cost is looked at."""


class Judge(NamedTuple):
    """By what a response is compared."""

    sigma_m: float
    inside_m: float
    hopeless_m: float
    scale: float
    limit: float


def compare(shown: Vector, measured: Vector, judge: Vector, errors: Vector, cost: Vector) -> None:
    """Write r of each position shown into errors, and add what they cost to cost[0]; judge as `Judge`."""
    sigma, inside, hopeless = judge[0], judge[1], judge[2]
    per_scale, square = 1.0 / judge[3], judge[3] * judge[3]
    total = cost[0]
    for i in range(len(shown)):
        apart = shown[i] - measured[i]
        if measured[i] != measured[i]:
            errors[i] = apart
            continue
        if not apart < hopeless:
            apart = hopeless
        elif apart < -hopeless:
            apart = -hopeless
        if inside > 0.0:
            outside = max(abs(apart) - inside, 0.0)
            apart = outside if apart > 0.0 else -outside
        r = apart / sigma
        errors[i] = r
        in_scales = r * per_scale
        total += square * (sqrt(1.0 + in_scales * in_scales) - 1.0)
    cost[0] = total


def misfit(
    theta: Vector,
    state: Vector,
    commands: Vector,
    periods: Vector,
    longest_step: float,
    tolerance: float,
    shots: Vector,
    path: Vector,
    measured: Vector,
    judge: Vector,
    errors: Vector,
    cost: Vector,
) -> None:
    """Hold each command for its period in turn, as `respond`, and compare what is shown, the start first.

    Before the period of a row of shots, its first entry, the stem is put at rest to where its second is shown. The path
    is room for what is simulated at once, (5, AT_ONCE + 1).
    """
    begin, known, shot = 0, 0, 0
    while True:
        end = min(begin + AT_ONCE, len(commands))
        if shot < len(shots):
            end = min(end, int(shots[shot, 0]))
        respond(theta, state, commands[begin:end], periods[begin:end], longest_step, tolerance, path)
        rows = slice(begin + known, end + 1)
        compare(path[4, known : end - begin + 1], measured[rows], judge, errors[rows], cost)
        if end == len(commands) or cost[0] >= judge[4]:
            return
        if shot < len(shots) and end == int(shots[shot, 0]):
            put_back(state, shots[shot, 1])
            shot += 1
        begin, known = end, 1


def put_back(state: Vector, shown: float) -> None:
    """Put the stem at rest to where a position is shown."""
    now = read(state)
    write(state, Condition(now.t, now.x + shown - now.indicated, 0.0, now.p, STUCK, 0.0, shown))
