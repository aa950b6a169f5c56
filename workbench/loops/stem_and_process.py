"""PV as a stem and a process make it of the output, and how likely that is: compiled, as a record asks it 2000 times.

    |u - x| <= f_s    the stem rests                                          S = f_s + f_d, J = f_s - f_d
    |u - x| >  f_s    it slips and lands at  x = u - f_d sign(u - x)
    T_1 dy/dt = x(t - theta) - y,    T_2 dz/dt = y - z                        T_1 long against a cycle: an integrator
    PV(t) = G z(t) + c + d(t),    d(t) = a_1 d(t-1) + ... + a_p d(t-p) + w(t),    w white of variance s^2

u output, x stem, both in one unit. After a landing the stem sticks anew (He and others 2007), or slides on behind the
output until that turns (Kano 2004, Choudhury 2005). The output is on record, so no loop is simulated. G, c, a
and s^2 are by maximum likelihood (whitened least squares, twice); the cost is n log s, in nats.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Function = TypeVar("Function", bound=Callable[..., Any])
ORDER = 4
"""Of the autoregressive disturbance: two resonances, an oscillation from outside and its harmonic or a drift."""
TINY = 1e-14
"""Of PV's variance: the digits of a stored number."""
RIDGE = 1e-12
"""Of a response's power: two that are alike have one weight between them, and no division by zero."""
LEAST_MOTION = 0.1
"""Of the output's standard deviation: a stem that moves less explains no PV."""


def compiled(function: Function) -> Function:
    """Return a function compiled on its first call, and kept on disk where a folder may be written."""
    try:
        return cast(Function, numba.njit(cache=True)(function))
    except RuntimeError:  # neither beside the source nor at home
        return cast(Function, numba.njit(function))


@compiled
def rest_positions(output: Array, stiction: float, slip_jump: float, slides_on: bool) -> Array:
    """Return the stem, (m,), of an output, (m,)."""
    breaks, slides = 0.5 * (stiction + slip_jump), 0.5 * (stiction - slip_jump)
    stem = np.empty(output.size)
    rest, way = output[0], 0.0
    for row in range(output.size):
        load = output[row] - rest
        if abs(load) > breaks:
            way = 1.0 if load > 0.0 else -1.0
            rest = output[row] - slides * way
        elif slides_on and way * (load - way * slides) > 0.0:
            rest = output[row] - slides * way
        else:
            way = 0.0
        stem[row] = rest
    return stem


@compiled
def respond(stem: Array, coarse: int, lag: float, second: float, delay: int) -> Array:
    """Return what a process of gain one makes of a stem, (m,), in means of `coarse` rows; lags and delay in rows."""
    response = np.empty(stem.size // coarse)
    kept = np.exp(-1.0 / lag) if lag > 0.0 else 0.0
    kept_second = np.exp(-1.0 / second) if second > 0.0 else 0.0
    inner, level, total = stem[0], stem[0], 0.0
    for row in range(response.size * coarse):
        inner = kept * inner + (1.0 - kept) * stem[max(0, row - delay)]
        level = kept_second * level + (1.0 - kept_second) * inner
        total += level
        if (row + 1) % coarse == 0:
            response[row // coarse] = total / coarse
            total = 0.0
    return response


@compiled
def _product(first: Array, second: Array, first_lag: int, second_lag: int) -> float:
    """Return the product of two signals, (n,), each some rows late, from row p on."""
    total = 0.0
    for row in range(ORDER, first.size):
        total += first[row - first_lag] * second[row - second_lag]
    return total


@compiled
def _weigh(shapes: Array, target: Array, weights: Array) -> None:
    """Put into the weights, (q,), those by which shapes, (q, n), make a target, (n,), with the least squares."""
    count = weights.size
    normal = np.empty((count, count))
    for first in range(count):
        weights[first] = _product(shapes[first], target, 0, 0)
        for second in range(count):
            normal[first, second] = _product(shapes[first], shapes[second], 0, 0)
        normal[first, first] += TINY + RIDGE * normal[first, first]
    weights[:] = np.linalg.solve(normal, weights)


@compiled
def _leave(shapes: Array, target: Array, weights: Array, left: Array) -> None:
    """Put into `left`, (n,), what weighted shapes leave of a target."""
    for row in range(target.size):
        left[row] = target[row]
        for each in range(weights.size):
            left[row] -= weights[each] * shapes[each, row]


@compiled
def _colour(values: Array, coefficients: Array) -> None:
    """Put into the coefficients, (p,), the autoregression of a signal, (n,)."""
    normal, trace = np.empty((ORDER, ORDER)), TINY
    for first in range(ORDER):
        coefficients[first] = _product(values, values, 0, first + 1)
        for second in range(ORDER):
            normal[first, second] = _product(values, values, first + 1, second + 1)
        trace += 1e-9 * normal[first, first]
    for each in range(ORDER):
        normal[each, each] += trace
    coefficients[:] = np.linalg.solve(normal, coefficients)


@compiled
def _whiten(values: Array, coefficients: Array, white: Array) -> None:
    """Put into `white`, (n,), the shocks of a signal, from row p on, less their mean."""
    total = 0.0
    for row in range(ORDER, values.size):
        white[row] = values[row]
        for each in range(ORDER):
            white[row] -= coefficients[each] * values[row - 1 - each]
        total += white[row]
    for row in range(ORDER, values.size):
        white[row] -= total / (values.size - ORDER)


@compiled
def cost_of(shapes: Array, pv: Array) -> tuple[float, Array]:
    """Return the cost of PV, (n,), as a sum of responses, (q, n), and their weights, (q,); of none: a disturbance."""
    count = shapes.shape[0]
    target, centred, white = pv - pv.mean(), np.empty(shapes.shape), np.zeros(shapes.shape)
    for each in range(count):
        centred[each] = shapes[each] - shapes[each].mean()
    weights, coefficients = np.zeros(count), np.zeros(ORDER)
    left, aim = np.zeros(pv.size), np.zeros(pv.size)
    _weigh(centred, target, weights)
    for _ in range(2):  # the weights, given the disturbance, given the weights
        _leave(centred, target, weights, left)
        _colour(left, coefficients)
        _whiten(target, coefficients, aim)
        for each in range(count):
            _whiten(centred[each], coefficients, white[each])
        _weigh(white, aim, weights)
    _leave(white, aim, weights, left)
    rows = pv.size - ORDER
    return 0.5 * rows * np.log(_product(left, left, 0, 0) / rows + TINY), weights


@compiled
def _spread(values: Array) -> float:
    centred = values - values.mean()
    return np.sqrt(_product(centred, centred, 0, 0))  # type: ignore[no-any-return]


@compiled
def costs_of_stems(
    output: Array,
    pv: Array,
    coarse: int,
    stiction: Array,
    slip_jump: Array,
    slides_on: Flags,
    lags: Array,
    delays: npt.NDArray[np.int64],
    action: int,
) -> tuple[Array, Array]:
    """Return the costs and gains of g stems with l lags and d delays, (g, l, d) each.

    A gain against the controller's `action` (0: either will do) would be the controller's own law read backwards, PV
    told from the OP that it made: the best that is allowed is then none.

    Args:
        output: (m,), in rows of the stem.
        pv: (n,), in rows of the comparison, each `coarse` of the stem's.
        stiction, slip_jump, slides_on: of the stems, (g,).
        lags: first and second of each process, (l, 2), rows of the stem.
        delays: (d,), likewise.
        action: sign that the gain must have.
    """
    alone = cost_of(np.zeros((0, pv.size)), pv)[0]
    costs = np.full((stiction.size, lags.shape[0], delays.size), alone)
    gains = np.zeros_like(costs)
    for each in range(stiction.size):
        stem = rest_positions(output, stiction[each], slip_jump[each], slides_on[each])
        if _spread(stem) < LEAST_MOTION * _spread(output):
            continue
        for at_lag in range(lags.shape[0]):
            for at_delay in range(delays.size):
                response = respond(stem, coarse, lags[at_lag, 0], lags[at_lag, 1], delays[at_delay])
                cost, weights = cost_of(response.reshape((1, response.size)), pv)
                if weights[0] * action >= 0.0:
                    costs[each, at_lag, at_delay], gains[each, at_lag, at_delay] = cost, weights[0]
    return costs, gains
