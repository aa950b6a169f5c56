"""From evidence to the probability that the valve sticks, calibrated by loop.

    p = 1 / (1 + exp(-(b_0 + b_1 q log(1 + E))))

E evidence for friction, nats (0 where it is negative); q its share of all that the output explains of PV, 0 to 1: a
small share of much is what a wrong model of the process leaves. Fitted on drawn loops, each counted once, half of them
sticking; `python -m benchmarks.loops --calibrate` prints the numbers.
"""

from dataclasses import dataclass
from math import exp, log1p

import numpy as np

from workbench.loops.loop_record import Array


@dataclass(frozen=True, slots=True)
class Calibration:
    """The two numbers."""

    constant: float
    of_evidence: float

    def probability(self, evidence: float, share: float) -> float:
        """Return p, 0 to 1."""
        weighted = self.constant + self.of_evidence * share * log1p(max(evidence, 0.0))
        return 1.0 / (1.0 + exp(-weighted))


CALIBRATION = Calibration(constant=-1.84, of_evidence=2.42)


def calibrate(evidence: Array, share: Array, sticks: Array) -> Calibration:
    """Return the calibration of n loops, (n,) each; `sticks` is 1 or 0. By Newton's method, weakly regularised."""
    features = np.column_stack([np.ones(evidence.size), share * np.log1p(np.maximum(evidence, 0.0))])
    weights = np.zeros(2)
    penalty = np.diag([0.0, 0.05])
    for _ in range(50):
        found = 1.0 / (1.0 + np.exp(-np.clip(features @ weights, -30.0, 30.0)))
        slope = features.T @ (sticks - found) - penalty @ weights
        curvature = (features * (found * (1.0 - found))[:, None]).T @ features + penalty
        weights = weights + np.linalg.solve(curvature, slope)
    return Calibration(*weights.tolist())
