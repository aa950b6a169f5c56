"""Passive identification: a valve that ages, identified from its ordinary moves.

A move of the DCS is some tens of milliseconds of motion between two rests. Alone it says little of m and F_v, much of
q = -F_c/k_s: the stem comes to rest where g u + q σ is. So each move is fitted with what was known before it as the
prior (`likelihood`): the posterior is the next prior, a Kalman filter whose measurement is a whole motion. Between two
moves Δt apart the parameters may have walked,

    std of the change = w sqrt(Δt)      w: 0.3 % of q, 0.01 % of g, 0.05 for 100 s of ln τ and ln μ

so that friction drifting by 3 % a minute is followed and the spring is not bent to explain it. One move knows only
g u + q σ where it ended; the information is carried as its root, which may be singular, so that two moves of different
ends or directions separate g and q. What is published is valid by the same rules as everywhere: information is the
gate, not the clock.
"""

from dataclasses import dataclass, replace

import numpy as np

from positioner.estimation.estimates import Directions
from positioner.estimation.likelihood import LikelihoodFit
from positioner.estimation.linear_problem import Prior

WALK_PER_SQRT_S = np.array([5e-3, 5e-3, 1e-4, 3e-3])
"""Of ln τ and ln μ; of g and q as shares."""
OUTLIER = 3.0
"""Residuals so many times those of the moves before are an outlier, no move of this valve."""
FORGETTING = 0.1
"""Weight of a move in what is known of the noise."""


@dataclass(frozen=True, slots=True)
class MovesPosterior:
    """What is known after the moves up to now, when the last of them ended, and which way they went."""

    fit: LikelihoodFit
    time_s: float
    directions: Directions

    def prior(self, time_s: float) -> Prior:
        """Return what is known at a later time: (H^-1 + Q)^-1 = H - H (H + Q^-1)^-1 H, for H may be singular."""
        noise_m, elapsed_s = self.fit.residual_std_m, max(time_s - self.time_s, 1e-3)
        size = np.concatenate((np.ones(2), np.abs(self.fit.p[2:])))
        root = self.fit.root * size
        H = root.T @ root
        steady = np.diag(noise_m**2 / (WALK_PER_SQRT_S**2 * elapsed_s))
        H = H - H @ np.linalg.solve(H + steady, H)
        powers, axes = np.linalg.eigh((H + H.T) / 2)
        return Prior(self.fit.p, (np.sqrt(np.maximum(powers, 0.0))[:, None] * axes.T) / size)


def posterior_after(
    posterior: MovesPosterior | None, fit: LikelihoodFit, time_s: float, directions: Directions
) -> MovesPosterior | None:
    """Return what is known after a move, or what was known when the move does not inform."""
    if not (np.isfinite(fit.p).all() and np.isfinite(fit.root).all()):
        return posterior
    if posterior is None:
        return MovesPosterior(fit, time_s, directions)
    if fit.residual_std_m > OUTLIER * posterior.fit.residual_std_m:
        return posterior
    noise_m = (1 - FORGETTING) * posterior.fit.residual_std_m + FORGETTING * fit.residual_std_m
    return MovesPosterior(replace(fit, residual_std_m=noise_m), time_s, posterior.directions | directions)
