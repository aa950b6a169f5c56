"""Maximum likelihood: a, b, c, k and their ratios from one or more motions, as exactly as the samples allow.

The measurement is y_i = x(t_i) + ν_i with white ν of standard deviation σ_x. The most likely parameters make

    S(p) = Σ (y_i - g X_g - q X_q - x_0 X_0 - v_0 X_1)^2        p = (ln τ, ln μ), X(p) as in `response`

least. For given p that is a linear problem; for p, Gauss-Newton with the step damped until S falls. The derivatives
by p are differences. At the minimum the covariance of all parameters is s^2 (J'J)^-1, s^2 = S / (n - parameters): the
Cramér-Rao bound with the noise as measured. a, b, c, k and the ratios follow to first order from their gradients.

What a motion knows of its beginning is worth much, for m and F_v are told apart in the first milliseconds. When a held
pressure jumps, and the stem leaves its rest there, it starts at that instant with v_0 = 0 from where it rested, x_0, of
which each sample at rest is a measurement. If samples are missing there, the jump came at one of the periods missed,
give or take the jitter. Where no single jump stands out, the stem breaks away by the drop from F_s to F_c, whose course
(Stribeck, presliding) is no part of this model: then, and when the beginning was not seen, x_0 and v_0 are free.

An earlier result can be the prior of the next: the pull of its information is four more rows of the same least squares.
"""

from dataclasses import dataclass, replace
from math import exp, log

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.motion_segment import MotionSegment
from positioner.estimation.stem_response import responses

MOST_ROWS = 8000
"""A longer motion is averaged in blocks. A block of length T_b shifts μ by T_b^2/24: with 8000 of them nothing."""
START_ROWS = 300
"""Rows of the search for a start, in blocks that grow from the beginning, where m and F_v are told apart."""
LARGEST_ROUNDS = 40
CONVERGED = 1e-3
"""A step of this many standard deviations is the last."""
DEGENERATE = 1e-8
"""Share of the largest singular value below which a direction is unknown, as g and q are apart after a single jump: of
all that explain the motion equally well the smallest is taken, whose g and q share it."""
_DIFFERENCE = 1e-6
_DAMPING = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Damping ratios ζ = τ / (2 sqrt μ) from which the search starts."""
_PERIODS = 7
CLEAR = 0.05
"""A jump of the pressure stands out when every other near it is a smaller share of it."""
LEAST_MASS = log(1e-6)
"""ln of the least μ / τ^2: with m/F_v a millionth of F_v/k_s the mass is nothing."""
HOPELESS = 1e8
"""Damping beyond which there is nothing left to gain."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known beforehand of (ln τ, ln μ, g, q): a mean (4), and a root R (4, 4) of the information R'R / σ_x^2.

    R may be singular: what it does not know, it does not pull at.
    """

    mean: Array
    root: Array


@dataclass(frozen=True, slots=True)
class LikelihoodFit:
    """The most likely parameters.

    Attributes:
        p: ln τ, ln μ, g in m/Pa, q in m.
        covariance: of p, 4 x 4; as good as infinite where nothing is known.
        root: R, 4 x 4, of the information about p that beginnings leave, R'R / σ_x^2; as in `Prior`.
        residual_std_m: of the positions.
        count: samples used.
        correlation: of neighbouring residuals: how much they are not white, in standard deviations of it.
        leverage: largest share that a single sample has in what is known of ln μ.
        start_s: when each motion began.
        jumps: how many of the motions were begun by a jump of the pressure.
    """

    p: Array
    covariance: Array
    root: Array
    residual_std_m: float
    count: int
    correlation: float
    leverage: float
    start_s: tuple[float, ...]
    jumps: int

    @property
    def theta(self) -> Array:
        """Return a in 1/s, b in 1/s^2, c in m/(s^2 Pa), k in m/s^2, b/c in Pa/m, k/c in Pa."""
        tau, mu = np.exp(self.p[:2]).tolist()
        g, q = self.p[2:].tolist()
        return np.array([-tau / mu, -1 / mu, g / mu, q / mu, -1 / g, q / g])

    @property
    def theta_covariance(self) -> Array:
        """Return the covariance of `theta`, 6 x 6, to first order."""
        a, b, c, k, slope, friction = self.theta.tolist()
        g = float(self.p[2])
        gradient = np.array(
            [
                [a, -a, 0.0, 0.0],
                [0.0, -b, 0.0, 0.0],
                [0.0, -c, -b, 0.0],
                [0.0, -k, 0.0, -b],
                [0.0, 0.0, -slope / g, 0.0],
                [0.0, 0.0, -friction / g, 1 / g],
            ]
        )
        return np.asarray(gradient @ self.covariance @ gradient.T)


@dataclass(frozen=True, slots=True)
class Motion:
    """A stretch made ready: `time_s` and `pressure_pa` have the start in front, N + 1; the others N rows."""

    direction: int
    time_s: Array
    pressure_pa: Array
    position_m: Array
    weight: Array
    """Square roots of the samples in each row."""
    rest_m: float
    rest_count: int
    free_velocity: bool
    held: bool
    free_start: "FreeStart | None" = None


@dataclass(frozen=True, slots=True)
class FreeStart:
    """Between which instants a motion began.

    In a gap of held pressure the commands that were missed came one period after another, give or take the jitter:
    `expected` is the likeliest of them, a share of the interval, and `weight` the noise in m over its uncertainty.
    """

    earliest_s: float
    latest_s: float
    expected: float = 0.0
    weight: float = 0.0

    def placed(self, motion: Motion, offset: float) -> Motion:
        """Return the motion begun at a share 0 to 1 of the interval."""
        time_s = motion.time_s.copy()
        time_s[0] = self.earliest_s + offset * (self.latest_s - self.earliest_s)
        return replace(motion, time_s=time_s)


def fit_motions(
    segments: list[MotionSegment],
    *,
    held: bool,
    guess: Array | None = None,
    prior: Prior | None = None,
    near: Array | None = None,
) -> LikelihoodFit | None:
    """Fit all stretches together.

    Args:
        stretches: motions of one direction each.
        held: whether the pressure is held between the samples; else it is linear.
        guess: (ln τ, ln μ) to start from, beside those of the search.
        prior: what is known beforehand.
        near: (ln τ, ln μ) near enough to need no search.

    Returns:
        The fit; None when the samples are fewer than the unknowns, or carry no motion.
    """
    motions = [_ready(each, _jump(each, held), held) for each in segments]
    if sum(len(each.position_m) for each in motions) < 6 + 2 * len(motions):
        return None
    start = near if near is not None else _searched(motions, guess, prior)
    if start is None:
        return None
    placed = [_in_a_gap(each, motion, start) for each, motion in zip(segments, motions, strict=True)]
    p = np.append(start, [each.free_start.expected for each in placed if each.free_start is not None])
    return _judged(placed, _settled(placed, p, prior), prior)


def _jump(segment: MotionSegment, held: bool) -> int | None:
    """Return the sample after which the pressure's jump set the stem in motion; None when no one jump stands out."""
    if segment.begins == 0 or not held:
        return None
    around = slice(segment.earliest, segment.begins + 3)
    jumps = np.abs(np.diff(segment.pressure_pa[around]))
    order = np.argsort(-jumps, kind="stable")
    if len(jumps) == 0 or (len(jumps) > 1 and jumps[order[1]] > CLEAR * jumps[order[0]]) or jumps[order[0]] == 0:
        return None
    return segment.earliest + int(order[0])


def _ready(segment: MotionSegment, jump: int | None, held: bool, rows: int = MOST_ROWS) -> Motion:
    """Put a stretch into rows, from the jump that set it in motion, or else from where it surely moves."""
    from_rest = jump is not None
    first = jump + 1 if jump is not None else (segment.begins + 2 if segment.begins else 0)
    time_s = segment.time_s[first:]
    pressure_pa = segment.pressure_pa[first:]
    position_m = segment.position_m[first:]
    rest = segment.position_m[segment.rests_from : first] if from_rest else position_m[:0]
    start_s, start_pa = float(segment.time_s[max(0, first - 1)]), float(segment.pressure_pa[max(0, first - 1)])
    weight = np.ones(len(time_s))
    if len(time_s) > rows:
        edges = _edges(len(time_s), rows, growing=False)
        weight = np.diff(np.append(edges, len(time_s))).astype(np.float64)
        coarse_s = np.add.reduceat(time_s, edges) / weight
        pressure_pa = _mean_pressure(start_s, start_pa, time_s, pressure_pa, coarse_s, held)
        position_m = np.add.reduceat(position_m, edges) / weight
        time_s = coarse_s
    if not from_rest:
        start_s -= 1e-9 * float(time_s[-1] - start_s)  # the first sample is a row like the others
    count = _counted(rest, position_m)
    return Motion(
        direction=segment.direction,
        time_s=np.append(start_s, time_s),
        pressure_pa=np.append(start_pa, pressure_pa),
        position_m=position_m,
        weight=np.sqrt(weight),
        rest_m=float(rest.mean()) if count else 0.0,
        rest_count=count,
        free_velocity=not from_rest,
        held=held,
    )


def _counted(rest: Array, moving: Array) -> int:
    """Return for how many samples those at rest stand: rounded to one code they are one."""
    if len(rest) < 2:
        return len(rest)
    noise = float(np.median(np.abs(np.diff(moving, 3)))) / 3 if len(moving) > 6 else 0.0
    return len(rest) if float(rest.std()) >= 0.3 * noise else 1


def _edges(count: int, rows: int, *, growing: bool) -> "np.typing.NDArray[np.int64]":
    if not growing:
        return np.arange(0, count, -(-count // rows), dtype=np.int64)
    later = np.geomspace(rows // 3, count - 1, rows).astype(np.int64)
    return np.unique(np.concatenate((np.arange(rows // 3, dtype=np.int64), later)))


def _mean_pressure(
    start_s: float, start_pa: float, time_s: Array, pressure_pa: Array, at_s: Array, held: bool
) -> Array:
    """Return the pressure for coarser instants: held, the means between them; linear, the values there."""
    times = np.append(start_s, time_s)
    if not held:
        return np.asarray(np.interp(at_s, times, np.append(start_pa, pressure_pa)))
    integral = np.append(0.0, np.cumsum(np.diff(times) * pressure_pa))
    at = np.append(0.0, np.interp(at_s, times, integral))
    return np.asarray(np.diff(at) / np.diff(np.append(start_s, at_s)))


def _columns(motion: Motion, p: Array) -> Array:
    """Return X_g, X_q, X_0 and, if free, X_1 (N + 1, 3 or 4), weighted; the last row is the rest's."""
    X_g, X_q, X_0, X_1 = responses(
        motion.time_s, motion.pressure_pa, motion.direction, exp(p[0]), exp(p[1]), held=motion.held
    )
    shown = (X_g, X_q, X_0, X_1) if motion.free_velocity else (X_g, X_q, X_0)
    rows: Array = np.zeros((len(motion.position_m) + 1, len(shown)))
    for number, column in enumerate(shown):
        rows[:-1, number] = column[1:] * motion.weight
    rows[-1, 2] = motion.rest_count**0.5
    return rows


def _measured(motion: Motion) -> Array:
    return np.append(motion.position_m * motion.weight, motion.rest_m * motion.rest_count**0.5)


@dataclass(frozen=True, slots=True)
class _System:
    """The linear problem at some p: columns [g, q, beginnings], what they should give, scales of the columns."""

    columns: Array
    measured: Array
    scale: Array

    def solved(self) -> tuple[Array, float]:
        """Return the most likely linear parameters and the sum of squares left."""
        whole = np.column_stack((self.columns / self.scale, self.measured))
        R: Array = np.asarray(np.linalg.qr(whole, mode="r"))
        found = np.linalg.lstsq(R[:-1, :-1], R[:-1, -1], rcond=DEGENERATE)[0]
        left = R[:, -1] - R[:, :-1] @ found
        return found / self.scale, float(left @ left)


def _placed(motions: list[Motion], p: Array) -> list[Motion]:
    """Return the motions begun when p[2:] says."""
    offsets = iter(p[2:].tolist())
    return [each if each.free_start is None else each.free_start.placed(each, next(offsets)) for each in motions]


def _system(motions: list[Motion], p: Array, prior: Prior | None) -> _System:
    blocks = [_columns(each, p) for each in _placed(motions, p)]
    starts = [each.free_start for each in motions if each.free_start is not None]
    rows = sum(len(each) for each in blocks) + len(starts) + (4 if prior is not None else 0)
    columns: Array = np.zeros((rows, 2 + sum(each.shape[1] - 2 for each in blocks)))
    measured: Array = np.zeros(rows)
    row, column = 0, 2
    for motion, block in zip(motions, blocks, strict=True):
        height, width = len(block), block.shape[1]
        columns[row : row + height, :2] = block[..., :2]
        columns[row : row + height, column : column + width - 2] = block[..., 2:]
        measured[row : row + height] = _measured(motion)
        row, column = row + height, column + width - 2
    for start, offset in zip(starts, p[2:].tolist(), strict=True):
        measured[row] = start.weight * (start.expected - offset)
        row += 1
    if prior is not None:
        columns[row:, :2] = prior.root[:, 2:]
        measured[row:] = prior.root @ prior.mean - prior.root[:, :2] @ p[:2]
    scale = np.sqrt((columns**2).sum(axis=0))
    return _System(columns, measured, np.where(scale > 0, scale, 1.0))


def _searched(motions: list[Motion], guess: Array | None, prior: Prior | None) -> Array | None:
    """Return the best (ln τ, ln μ) of a coarse grid, of the guess and of the prior."""
    if prior is not None:
        return np.array(prior.mean[:2])
    thin = [_thinned(each) for each in motions]
    longest = max(float(each.time_s[-1] - each.time_s[0]) for each in motions)
    shortest = min(float(np.median(np.diff(each.time_s))) for each in motions)
    tries = [
        np.array([log(2 * damping * period), log(period * period)])
        for period in np.geomspace(max(shortest / 2, 1e-4 * longest), longest / 4, _PERIODS).tolist()
        for damping in _DAMPING
    ]
    if guess is not None and np.isfinite(guess).all():
        tries.append(guess)
    found = [(_physical(*_system(thin, p, None).solved()), p) for p in tries]
    best, p = min(found, key=lambda each: each[0])
    return p if np.isfinite(best) else None


def _physical(linear: Array, left: float) -> float:
    """Return the sum of squares; infinite when pressure would close the valve."""
    return left if linear[0] > 0 else float("inf")


def _thinned(motion: Motion) -> Motion:
    count = len(motion.position_m)
    if count <= START_ROWS:
        return motion
    edges = _edges(count, START_ROWS // 2, growing=True)
    number = np.diff(np.append(edges, count)).astype(np.float64)
    time_s, start_s = motion.time_s[1:], float(motion.time_s[0])
    coarse_s = np.add.reduceat(time_s, edges) / number
    pressure_pa = _mean_pressure(
        start_s, float(motion.pressure_pa[0]), time_s, motion.pressure_pa[1:], coarse_s, motion.held
    )
    return replace(
        motion,
        time_s=np.append(start_s, coarse_s),
        pressure_pa=np.append(motion.pressure_pa[0], pressure_pa),
        position_m=np.add.reduceat(motion.position_m, edges) / number,
        weight=np.sqrt(np.add.reduceat(motion.weight**2, edges)),
    )


def _settled(motions: list[Motion], p: Array, prior: Prior | None) -> Array:
    """Return (ln τ, ln μ, starts) at the minimum near p: Gauss-Newton, the step damped until the sum falls."""
    damping = 1e-3
    unknown = len(p)
    system = _system(motions, p, prior)
    linear, left = system.solved()
    for _ in range(LARGEST_ROUNDS):
        R = _linearised(motions, p, system, linear, prior)
        size = np.linalg.norm(R[:, -1 - unknown : -1], axis=0)
        improved = None
        while improved is None and damping < HOPELESS:
            damped = np.zeros((unknown, R.shape[1]))
            damped[:, -1 - unknown : -1] = np.diag(damping**0.5 * size)
            tried_p = _within(p, _solved(np.vstack((R, damped)))[-unknown:])
            tried = _system(motions, tried_p, prior)
            found, remaining = tried.solved()
            if _physical(found, remaining) <= left:
                improved = tried
            else:
                damping *= 10
        if improved is None:
            break
        dof = max(1, len(system.measured) - system.columns.shape[1] - unknown)
        converged = float(np.abs((tried_p - p) * size).max()) <= CONVERGED * (left / dof) ** 0.5
        p, system, linear, left = tried_p, improved, found, remaining
        damping = max(damping / 10, 1e-12)
        if converged:
            break
    return p


def _within(p: Array, step: Array) -> Array:
    """Return p after a step, of which no time constant follows more than e^2, and no start leaves its interval."""
    moved = p + np.clip(step, -2.0, 2.0)
    moved[1] = max(moved[1], 2 * moved[0] + LEAST_MASS)
    moved[2:] = np.clip(moved[2:], 0.0, 1.0 - 2 * _DIFFERENCE)
    return moved


def _linearised(motions: list[Motion], p: Array, system: _System, linear: Array, prior: Prior | None) -> Array:
    """Return the triangle R of [scaled linear columns, derivatives by p, what is left to explain]."""
    return np.asarray(np.linalg.qr(_tangent(motions, p, system, linear, prior), mode="r"))


def _leverage(tangent: Array, number: int) -> float:
    """Return the largest share of a row in the information about a column that all the other columns leave."""
    others = np.linalg.qr(np.delete(tangent, number, axis=1))[0]
    left = tangent[:, number] - others @ (others.T @ tangent[:, number])
    left -= others @ (others.T @ left)
    power = float(left @ left)
    return float((left**2).max()) / power if power > 0 else 1.0


def _root(tangent: Array, order: list[int], scale: Array) -> Array:
    """Return the root of the information about the four parameters, the others eliminated."""
    others = np.delete(tangent, order, axis=1)
    R = np.asarray(np.linalg.qr(np.column_stack((others, tangent[:, order] * scale)), mode="r"))
    return R[-4:, -4:]


def _tangent(motions: list[Motion], p: Array, system: _System, linear: Array, prior: Prior | None) -> Array:
    """Return [scaled linear columns, derivatives by p, what is left to explain], a row per sample."""
    modelled = system.columns @ linear - system.measured
    slopes = np.empty((len(modelled), len(p)))
    for number in range(len(p)):
        moved = p.copy()
        moved[number] += _DIFFERENCE
        near = _system(motions, moved, prior)
        slopes[:, number] = (near.columns @ linear - near.measured - modelled) / _DIFFERENCE
    return np.column_stack((system.columns / system.scale, slopes, -modelled))


def _solved(R: Array) -> Array:
    return np.asarray(np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=1e-15)[0])


def _in_a_gap(segment: MotionSegment, motion: Motion, p: Array) -> Motion:
    """Return the motion begun at the likeliest of the commands that a gap may hide; as it is when there is no gap."""
    if motion.free_velocity:
        return motion
    first = int(np.searchsorted(segment.time_s, motion.time_s[0], side="right"))
    free = FreeStart(float(segment.time_s[first - 1]), float(segment.time_s[first]))
    steps = np.diff(segment.time_s)
    period_s, gap_s = float(np.median(steps)), free.latest_s - free.earliest_s
    missed = round(gap_s / period_s)
    if missed < 2:
        return motion
    thin = _thinned(motion)
    tries = [free.placed(thin, each / missed) for each in range(missed)]
    sums = [_system([each], _settled([each], p[:2], None), None).solved()[1] for each in tries]
    likeliest = int(np.argmin(sums))
    if likeliest == 0:
        return motion
    jitter_s = 1.4826 * float(np.median(np.abs(steps - period_s))) / 2**0.5
    noise_m = (sums[likeliest] / max(1, len(thin.position_m) - 5)) ** 0.5
    weight = noise_m * gap_s / max(jitter_s, 1e-3 * period_s)
    return replace(motion, free_start=replace(free, expected=likeliest / missed, weight=weight))


def _judged(motions: list[Motion], p: Array, prior: Prior | None) -> LikelihoodFit:
    """Return the fit at the minimum with its covariance."""
    system = _system(motions, p, prior)
    linear, _ = system.solved()
    tangent = _tangent(motions, p, system, linear, prior)[:, :-1]
    R = np.asarray(np.linalg.qr(tangent, mode="r"))
    residuals = (system.measured - system.columns @ linear)[: -4 if prior is not None else None]
    dof = max(1, len(residuals) - (0 if prior is not None else R.shape[1]))
    variance = float(residuals @ residuals) / dof
    order = [R.shape[1] - len(p), R.shape[1] - len(p) + 1, 0, 1]
    scale = np.concatenate((system.scale, np.ones(len(p))))[order]
    covariance = variance * _inverse_information(R)[np.ix_(order, order)] / np.outer(scale, scale)
    return LikelihoodFit(
        p=np.append(p[:2], linear[:2]),
        covariance=covariance,
        root=_root(tangent, order, scale),
        residual_std_m=variance**0.5,
        count=sum(len(each.position_m) for each in motions),
        correlation=_correlation(residuals),
        leverage=_leverage(tangent, order[1]),
        start_s=tuple(float(each.time_s[0]) for each in _placed(motions, p)),
        jumps=sum(not each.free_velocity for each in motions),
    )


def _inverse_information(R: Array) -> Array:
    """Return (R'R)^-1; what carries no information at all gets a variance as good as infinite."""
    _, sizes, rotation = np.linalg.svd(R)
    sizes = np.maximum(sizes, 1e-14 * sizes[0])
    return np.asarray((rotation.T / sizes**2) @ rotation)


def _correlation(residuals: Array) -> float:
    """Return the correlation of neighbours times sqrt(n): beyond some four the residuals are not white."""
    power = float(residuals @ residuals)
    return float(residuals[1:] @ residuals[:-1]) / power * len(residuals) ** 0.5 if power > 0 else 0.0
