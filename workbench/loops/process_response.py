"""PV as the process makes it of a stem: a lag, a dead time, a gain and a disturbance of coloured noise.

    PV(t) = G z(t) + c + d(t),    T dz/dt = x(t - theta) - z        T long against the record's cycle: an integrator
    d(t) = a_1 d(t-1) + ... + a_p d(t-p) + w(t),    w white of variance s^2

G, a and s^2 by maximum likelihood (whitened least squares, twice), T and theta on a grid; the cost is n log s, in nats.
Rivals differ in x alone, have the same disturbance, and are compared at the time scale of the loop.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from workbench.loops.loop_record import Array
from workbench.loops.thresholds import LIMITS

LAGS = (0.0, 0.05, 0.12, 0.3, 0.8, 4.0)
DELAYS = (0.0, 0.05, 0.1, 0.17, 0.25)
"""In cycles of the loop; a quarter of a cycle of delay and a quarter of lag is all that a PI loop leaves a process."""
FINER, LATER = (0.7, 1.0, 1.4), (-0.025, 0.0, 0.025)
"""Factors of the lag, and cycles of delay, about the best."""
TURNS = 2
"""Of gain and disturbance, one given the other."""


@dataclass(frozen=True, slots=True)
class Response:
    """What the process makes of one stem.

    Attributes:
        cost: nats, less is better; infinite where the gain has the wrong sign.
        lag, delay: rows of the comparison, and of the stem.
        gain: of PV a unit of the stem.
    """

    cost: float
    lag: float
    delay: float
    gain: float


@dataclass(frozen=True, slots=True)
class Scale:
    """The rows in which stems are told and PV is compared.

    Attributes:
        cycle: rows of the stem a cycle.
        coarse: of them to a row of the comparison.
    """

    cycle: float
    coarse: int

    @property
    def rows_a_cycle(self) -> float:
        """Rows of the comparison a cycle."""
        return self.cycle / self.coarse


def averaged(values: Array, every: int) -> Array:
    """Return means of each `every` rows of (n, ...)."""
    count = values.shape[0] // every
    return np.asarray(values[: count * every].reshape(count, every, *values.shape[1:]).mean(axis=1))


def disturbance_alone(pv: Array) -> float:
    """Return the cost of PV, (n,), without any process: all of it a disturbance."""
    return float(_coloured((pv - pv.mean())[:, None])[0][0])


def fit_responses(stems: Array, pv: Array, scale: Scale, action: int) -> list[Response]:
    """Return the best response of each of g stems, (m, g), to PV in rows of the comparison, (n,).

    Args:
        stems: in rows of the stem.
        pv: in rows of the comparison.
        scale: how the rows are related.
        action: sign that the gain must have; 0: either.
    """
    lags = [scale.rows_a_cycle * each for each in LAGS]
    delays = sorted({round(scale.cycle * each) for each in DELAYS})
    return _best_of(stems, pv, scale, action, lags, delays)


def refine_responses(stems: Array, pv: Array, scale: Scale, action: int, about: Response) -> list[Response]:
    """Return the best response of each of g stems, (m, g), with lag and delay about those of a response."""
    lags = [about.lag * each for each in FINER] if about.lag else [0.0, 0.02 * scale.rows_a_cycle]
    near = (round(about.delay + each * scale.cycle) for each in LATER)
    return _best_of(stems, pv, scale, action, lags, sorted({max(0, each) for each in near}))


def respond(stem: Array, scale: Scale, lag: float, delay: float) -> Array:
    """Return what the process makes of stems, (m, ...), in rows of the comparison, for a gain of one."""
    shift = round(delay)
    late = np.concatenate([np.repeat(stem[:1], shift, axis=0), stem[: stem.shape[0] - shift]])
    rows = averaged(late, scale.coarse)
    if lag <= 0.0:
        return rows
    pole = float(np.exp(-1.0 / lag))
    return np.asarray(lfilter([1.0 - pole], [1.0, -pole], rows - rows[0], axis=0) + rows[0])


def shaped_cost(shapes: Array, pv: Array, allowed: Callable[[Array], bool]) -> float:
    """Return the cost of PV, (n,), as a sum of responses, (n, q), whose weights, (q,), are allowed; else infinite."""
    centred, target = shapes - shapes.mean(axis=0), pv - pv.mean()
    weights = np.linalg.lstsq(centred, target, rcond=None)[0]
    cost = np.inf
    for _ in range(TURNS):
        whitener = np.concatenate([[1.0], -_coloured((target - centred @ weights)[:, None])[1][0]])
        order = whitener.size - 1
        white = lfilter(whitener, [1.0], centred, axis=0)[order:]
        aim = lfilter(whitener, [1.0], target)[order:]
        white, aim = white - white.mean(axis=0), aim - aim.mean()
        weights = np.linalg.lstsq(white, aim, rcond=None)[0]
        left = aim - white @ weights
        cost = 0.5 * aim.size * float(np.log(left @ left / aim.size + TINY))
    return cost if allowed(weights) else np.inf


TINY = 1e-14
"""Of PV's variance: the digits of a stored number."""


def _best_of(
    stems: Array, pv: Array, scale: Scale, action: int, lags: Sequence[float], delays: Sequence[int]
) -> list[Response]:
    best: Array | None = None
    for delay in delays:
        for lag in lags:
            cost, gain = _costs(respond(stems, scale, lag, delay), pv, action)
            now = np.stack([cost, np.full(cost.size, lag), np.full(cost.size, float(delay)), gain], axis=1)
            best = now if best is None else np.where((now[:, 0] < best[:, 0])[:, None], now, best)
    assert best is not None
    return [Response(*row) for row in best.tolist()]


def _costs(responses: Array, pv: Array, action: int) -> tuple[Array, Array]:
    """Return the cost and the gain of each of g responses, (n, g)."""
    centred, target = responses - responses.mean(axis=0), (pv - pv.mean())[:, None]
    power = (centred * centred).sum(axis=0)
    gain = (centred * target).sum(axis=0) / np.maximum(power, TINY)
    cost = np.full(gain.size, np.inf)
    for _ in range(TURNS):
        shocks = _coloured(target - gain * centred)[1]
        white, aim = _whitened(centred, shocks), _whitened(np.broadcast_to(target, centred.shape), shocks)
        gain = (white * aim).sum(axis=0) / np.maximum((white * white).sum(axis=0), TINY)
        left = aim - gain * white
        cost = 0.5 * left.shape[0] * np.log((left * left).mean(axis=0) + TINY)
    refused = (power < TINY * responses.shape[0]) | (gain * action < 0.0)
    return np.where(refused, np.inf, cost), gain


def _coloured(values: Array) -> tuple[Array, Array]:
    """Return cost and coefficients, (g, p), of autoregressions of signals, (n, g)."""
    order, count = LIMITS.disturbance_order, values.shape[0]
    past = np.stack([values[order - lag : count - lag] for lag in range(1, order + 1)], axis=-1)
    normal = np.einsum("ngp,ngq->gpq", past, past, optimize=True)
    normal += (1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + TINY) * np.eye(order)
    right = np.einsum("ngp,ng->gp", past, values[order:], optimize=True)
    found = np.linalg.solve(normal, right[..., None])[..., 0]
    left = values[order:] - np.einsum("ngp,gp->ng", past, found, optimize=True)
    return 0.5 * left.shape[0] * np.log((left * left).mean(axis=0) + TINY), found


def _whitened(values: Array, found: Array) -> Array:
    order, count = found.shape[1], values.shape[0]
    white = values[order:].copy()
    for lag in range(1, order + 1):
        white -= found[:, lag - 1] * values[order - lag : count - lag]
    return np.asarray(white - white.mean(axis=0))
