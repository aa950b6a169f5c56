"""From evidence to the probability that the valve sticks, calibrated by loop.

    e = E / sqrt(max(1, X)),    p = 1 / (1 + exp(-(b_0 + b_1 sign(e) log(1 + |e|) + b_2 r)))

E evidence for friction, X what friction explains of PV beyond the disturbance alone, nats: what a wrong model of the
process leaves grows with what there is to explain. r, 0 to 1, is how far OP and PV are out of phase (Horch 1999): a
stem that rests parts them, while proportional action, and a process that follows at once, hold them together.

Fitted on drawn loops and on loops of plants with labels, each set counted as much as the other, each loop once;
`python -m benchmarks.loops --calibrate --data FOLDER` prints the numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, exp, log1p, sqrt

import numpy as np

from workbench.loops.loop_record import Array


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one record says.

    Attributes:
        nats: for friction against the best other cause.
        explained: what friction explains beyond the disturbance alone, nats.
        out_of_phase: of OP and PV, 0 to 1.
    """

    nats: float
    explained: float
    out_of_phase: float

    @property
    def weight(self) -> float:
        """Evidence that counts: sign(e) log(1 + |e|)."""
        scaled = self.nats / sqrt(max(1.0, self.explained))
        return copysign(log1p(abs(scaled)), scaled)


def mean_evidence(records: Sequence[Evidence]) -> Evidence:
    """Return the mean of the evidence of records of one valve: a wrong model of its process errs alike in all."""
    return Evidence(*np.mean([(each.nats, each.explained, each.out_of_phase) for each in records], axis=0).tolist())


@dataclass(frozen=True, slots=True)
class Calibration:
    """The three numbers."""

    constant: float
    of_weight: float
    of_phase: float

    def probability(self, evidence: Evidence) -> float:
        """Return p, 0 to 1."""
        logit = self.constant + self.of_weight * evidence.weight + self.of_phase * evidence.out_of_phase
        return 1.0 / (1.0 + exp(-logit))


CALIBRATION = Calibration(constant=-1.77, of_weight=1.82, of_phase=2.43)


def calibrate(loops: Sequence[Evidence], sticks: Array, weights: Array) -> Calibration:
    """Return the calibration of n loops; `sticks`, (n,), is 1 or 0. By Newton's method, weakly regularised."""
    features = np.array([(1.0, each.weight, each.out_of_phase) for each in loops])
    found = np.zeros(3)
    penalty = np.diag([0.0, 0.05, 0.05])
    for _ in range(50):
        says = 1.0 / (1.0 + np.exp(-np.clip(features @ found, -30.0, 30.0)))
        slope = features.T @ (weights * (sticks - says)) - penalty @ found
        curvature = (features * (weights * says * (1.0 - says))[:, None]).T @ features + penalty
        found = found + np.linalg.solve(curvature, slope)
    return Calibration(*found.tolist())
