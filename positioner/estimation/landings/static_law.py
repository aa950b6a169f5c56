"""The static law of a valve from its landings, each direction for itself.

    p_j = κ x_j + φ_up + e_j       after a slide upward          κ = k_s/A,  φ_up   = (F_c,up + F_0)/A
    p_j = κ x_j - φ_down + e_j     after a slide downward                    φ_down = (F_c,down - F_0)/A

Three unknowns θ, least squares with Huber's weights, for a slide that ended under a moving pressure is an outlier. A
stuck stem that gave way in its packing is no slide: it did not go as far as the law says.
The residuals say how well the law holds: with n landings,

    s^2 = max(Σ e^2 / (n - 3), (κ σ_x)^2, (κ 2e-4 stroke)^2)
    cov θ = s^2 (X' W X)^-1,    deviations times t(n - 3) / 3

which is the Cramér-Rao bound of white residuals, widened so that three deviations are 99.7 % for few landings, too.
Where stems creep behind a slow pressure they all stick short of the balance (`stem_at_rest`), and no residual shows it:
the median m of by how much they may, of the direction in which it is more, is a deviation of the friction in either,
however many landings:

    var φ_up += (κ m)^2,   var φ_down += (κ m)^2
A stem that swings past its balance has its landings on the law with their balances (`overshoot.py`).
The friction of the seed's symmetric model is φ = (φ_up + φ_down)/2; what that model calls impossible is the offset

    (φ_up - φ_down)/2        0 without preload and with the same friction both ways
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from math import inf, isfinite, nan, sqrt
from statistics import median

import numpy as np
import numpy.typing as npt

from config.codes import Refusal
from positioner.estimation.acceptance import Ratios
from positioner.estimation.array import Array
from positioner.estimation.estimates import Estimate, no_estimate
from positioner.estimation.landings.change_point import FINEST
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import LocalBalance
from positioner.estimation.landings.overshoot import balanced, swing_of

FEWEST_LANDINGS, FEWEST_EACH = 5, 2
"""Landings in all, and in each direction."""
LARGEST_RELATIVE_STD = 0.05
"""Of κ."""
LARGEST_SHIFT = 0.01
"""Of the stroke: by which a deviation of φ may shift where a slide lands."""
LARGEST_RESIDUAL = 0.05
"""Of the stroke: landings that miss the law by more, as a standard deviation, lie on no straight line."""
HUBER, ROUNDS = 2.0, 6
"""Deviations beyond which a landing counts less."""
DEVIATIONS = 3.0
MIDDLE = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Of the stroke: where it is asked how far the landings are bent."""
LEAST_SHIFT = 2e-3
"""Of the stroke: two laws nearer to each other than this agree, and a shift of the landings counts as none."""


@dataclass(frozen=True, slots=True)
class StaticLaw:
    """κ, φ_up and φ_down as estimates, and how the landings lie about them.

    Attributes:
        slope: κ = k_s/A, Pa/m.
        up: φ_up, Pa.
        down: φ_down, Pa.
        slides: the landings that it was taken from.
        residual_m: standard deviation of where a slide lands about the law, m: of the landings, or what a valve bent as
            they are (`local_balance`) does over the middle of the travel, whichever is more.
        covariance: of (κ, φ_up, φ_down); (3, 3).
        swing: ρ, share of its way by which the stem swings past its balance and sticks there; 0: it does not.
    """

    slope: Estimate
    up: Estimate
    down: Estimate
    slides: tuple[SlideOutcome, ...]
    residual_m: float
    covariance: Array
    swing: float = 0.0

    @property
    def landings(self) -> int:
        """Number of landings that it was taken from."""
        return len(self.slides)

    @property
    def valid(self) -> bool:
        """Whether the law may be used."""
        return self.slope.valid

    @property
    def reason(self) -> Refusal:
        """Why it may not, or `Refusal.VALID`."""
        return self.slope.reason

    @property
    def ratios(self) -> Ratios:
        """What the control laws need: b/c, k/c and the offset."""
        up, down = self.up.value, self.down.value
        return Ratios.of(self.slope.value, up, down)

    @property
    def offset(self) -> Estimate:
        """(φ_up - φ_down)/2, Pa, which the seed's model takes for 0."""
        if not isfinite(self.slope.std):
            return no_estimate(self.reason)
        gradient = np.array((0.0, 0.5, -0.5))
        std = sqrt(max(0.0, float(gradient @ self.covariance @ gradient)))
        return Estimate((self.up.value - self.down.value) / 2, std, self.reason)

    def contradicts(self, ratios: Ratios, stroke_m: float) -> bool:
        """Whether ratios land elsewhere than the stem did: beyond three deviations, amid the landings of a direction.

        There, at their weighted mean, the law is known best, and lies no farther off the ratios than a landing does.
        Of a direction in which they know no friction they say nothing.
        """
        if not self.valid:
            return False
        theta = np.array((self.slope.value, self.up.value, self.down.value))
        theirs = np.array((-ratios.b_over_c, ratios.friction_pa(1), ratios.friction_pa(-1)))
        for direction in {1, -1} - {ratios.directions.unseen}:
            row = np.array((0.0, float(direction > 0), -float(direction < 0)))
            row[0] = -float(row @ self.covariance[0]) / self.covariance[0, 0]
            shift_pa = abs(float(row @ (theta - theirs)))
            std_pa = sqrt(float(row @ self.covariance @ row))
            if shift_pa > max(DEVIATIONS * std_pa, LEAST_SHIFT * stroke_m * self.slope.value):
                return True
        return False


def no_static_law(reason: Refusal, slides: tuple[SlideOutcome, ...] = ()) -> StaticLaw:
    """Return a law without values, for a reason."""
    nothing = no_estimate(reason)
    return StaticLaw(nothing, nothing, nothing, slides, nan, np.full((3, 3), inf))


def columns(landings: Sequence[SlideOutcome], stroke_m: float) -> tuple[Array, Array]:
    """Return X, (n, 3), with positions in strokes so that its columns are of one size, and p, (n,), Pa."""
    x = np.array([each.position_m for each in landings])
    up = np.array([float(each.direction > 0) for each in landings])
    return np.column_stack((x / stroke_m, up, up - 1.0)), np.array([each.command_pa for each in landings])


def static_law(landings: Sequence[SlideOutcome], stroke_m: float) -> StaticLaw:
    """Return the static law of landings, or why there is none.

    Args:
        landings: slides that ended in rest.
        stroke_m: full travel, m.
    """
    ups = sum(each.direction > 0 for each in landings)
    if len(landings) < FEWEST_LANDINGS or min(ups, len(landings) - ups) < FEWEST_EACH:
        return no_static_law(Refusal.LANDINGS_TOO_FEW, tuple(landings))
    X, p = columns(landings, stroke_m)
    slid = _slides(landings, X, p, stroke_m)
    slides = tuple(compress(landings, slid.tolist()))
    ups, kept = sum(each.direction > 0 for each in slides), len(slides)
    if kept < FEWEST_LANDINGS or min(ups, kept - ups) < FEWEST_EACH:
        return no_static_law(Refusal.LANDINGS_TOO_FEW, slides)
    swing, swing_std = swing_of(slides, X[slid], p[slid], stroke_m)
    ways = np.array([(each.position_m - each.from_m) / stroke_m for each in slides])
    balances = tuple(balanced(each, swing) for each in slides)
    X, p = columns(balances, stroke_m)
    if np.linalg.matrix_rank(X, tol=1e-3) < 3:
        return no_static_law(Refusal.ILL_CONDITIONED, slides)
    theta, weights = _huber(X, p)
    residual_pa = p - X @ theta
    free = kept - 3
    finest = max(FINEST, swing_std * sqrt(float(ways @ ways) / kept), max(each.std_m for each in landings) / stroke_m)
    seen_pa = finest * abs(theta[0])
    s = max(sqrt(float(residual_pa @ residual_pa) / free), seen_pa)
    scale = np.diag((1 / stroke_m, 1.0, 1.0))
    covariance = scale @ np.linalg.inv(X.T @ (weights[:, None] * X)) @ scale * (s * t_of_three_deviations(free)) ** 2
    slope, up_pa, down_pa = (scale @ theta).tolist()
    covariance += np.diag((0.0, 1.0, 1.0)) * (slope * _short_m(slides)) ** 2
    std = np.sqrt(np.diag(covariance))
    reason = _refusal(slope, up_pa + down_pa, std, s, stroke_m)
    bent_pa = _bent_by_pa(Ratios.of(slope, up_pa, down_pa), balances, stroke_m)
    return StaticLaw(
        slope=Estimate(slope, float(std[0]), reason),
        up=Estimate(up_pa, float(std[1]), reason),
        down=Estimate(down_pa, float(std[2]), reason),
        slides=slides,
        residual_m=max(s, bent_pa) / abs(slope) if slope else inf,
        covariance=covariance,
        swing=swing,
    )


def _short_m(slides: Sequence[SlideOutcome]) -> float:
    """Return how far short of their balances slides may have stuck, m."""
    return max(median(each.short_m for each in slides if each.direction == s) for s in (1, -1))


def _bent_by_pa(ratios: Ratios, slides: tuple[SlideOutcome, ...], stroke_m: float) -> float:
    """Return how far the landings are bent away from the straight law over the middle of the travel, Pa.

    A standard deviation, of the direction in which it is more: landings may crowd where the law holds.
    """
    if ratios.b_over_c >= 0.0:
        return 0.0
    balance = LocalBalance(ratios=ratios, landings=slides, stroke_m=stroke_m)
    off_pa = [[balance.bent_by_pa(x * stroke_m, s) for x in MIDDLE] for s in (1, -1)]
    return max(sqrt(sum(each**2 for each in one) / len(one)) for one in off_pa)


def _slides(landings: Sequence[SlideOutcome], X: Array, p: Array, stroke_m: float) -> npt.NDArray[np.bool_]:
    """Return which landings end a slide, not a giving way of the packing that holds the stem: (n,).

    A slide goes as far as the law says, by half or twice, give or take how far landings lie off the law.
    """
    way = np.array([float(each.direction) for each in landings])
    from_m = np.array([each.from_m for each in landings])
    went_m = way * (X[:, 0] * stroke_m - from_m)
    slides = np.ones(p.size, dtype=bool)
    for _ in range(ROUNDS):
        if np.count_nonzero(slides) < FEWEST_LANDINGS or np.linalg.matrix_rank(X[slides], tol=1e-3) < 3:
            return slides
        theta, _weights = _huber(X[slides], p[slides])
        per_m = theta[0] / stroke_m
        if per_m <= 0:
            return slides
        off_m = DEVIATIONS * 1.4826 * float(np.median(np.abs(p - X @ theta)[slides])) / per_m
        to_go_m = way * ((p - X[:, 1:] @ theta[1:]) / per_m - from_m)
        now = (went_m > 0.5 * to_go_m - off_m) & (went_m < 2.0 * to_go_m + off_m)
        if (now == slides).all():
            break
        slides = now
    return slides


def _huber(X: Array, p: Array) -> tuple[Array, Array]:
    """Return theta by least squares with Huber's weights, and these weights; the scale is the median deviation."""
    weights: Array = np.ones(p.size)
    theta, used = np.zeros(3), weights
    for _ in range(ROUNDS):
        used, root = weights, np.sqrt(weights)
        theta = np.asarray(np.linalg.lstsq(root[:, None] * X, root * p)[0])
        off = np.abs(p - X @ theta)
        scale = 1.4826 * float(np.median(off)) * sqrt(p.size / (p.size - 3))
        weights = np.minimum(1.0, HUBER * max(scale, 1e-9) / np.maximum(off, 1e-9))
    return theta, used


def t_of_three_deviations(free: int) -> float:
    """Return the quantile of Student's t that 3 is of the normal distribution, over 3 (Cornish and Fisher)."""
    z = DEVIATIONS
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return float(z + sum(term / free**power for power, term in enumerate(terms, 1))) / z


def _refusal(slope: float, friction: float, std: Array, residual_pa: float, stroke_m: float) -> Refusal:
    if slope <= 0:
        return Refusal.B_OVER_C_NOT_NEGATIVE
    if friction <= 0:
        return Refusal.K_OVER_C_NOT_NEGATIVE
    if residual_pa > LARGEST_RESIDUAL * slope * stroke_m:
        return Refusal.LANDINGS_NOT_STRAIGHT
    allowed = np.array((LARGEST_RELATIVE_STD * slope, *(2 * [LARGEST_SHIFT * slope * stroke_m])))
    # κ and φ are known together: what counts is the law in the middle of the travel.
    return Refusal.VALID if std[0] <= allowed[0] and (std[1:] <= 2 * allowed[1:]).all() else Refusal.TOO_UNCERTAIN
