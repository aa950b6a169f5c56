"""From evidence to the probability that the valve sticks, calibrated by loop.

    e = E / sqrt(max(1, X)),    w = sign(e) log(1 + |e|)
    p = 1 / (1 + exp(-(b_0 + b_1 w(PV) + b_2 w(OP))))

E evidence for friction, X what friction explains beyond the disturbance alone, nats: what a wrong model of the process
leaves grows with what there is to explain. PV is asked what it is by the stem, OP what it is once round the loop.

Fitted on drawn loops, each once; on no loop of a plant. From a threshold of p on a loop is called sticking. There at
most 5 % are wrong in a plant of which one loop in five sticks: conformal selection on drawn loops that the numbers are
not from, which takes one more for wrong (Jin and Candes 2023). `python -m benchmarks.loops` prints both.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, exp, log1p, sqrt

import numpy as np


@dataclass(frozen=True, slots=True)
class Witness:
    """What one signal says: evidence for friction against the best other cause, and what friction explains, nats."""

    nats: float = 0.0
    explained: float = 0.0

    @property
    def weight(self) -> float:
        """Evidence that counts: w."""
        scaled = self.nats / sqrt(max(1.0, self.explained))
        return copysign(log1p(abs(scaled)), scaled)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one record says, by its process value and by its output."""

    pv: Witness
    output: Witness


def mean_witness(of: Sequence[Witness]) -> Witness:
    """Return the mean of what witnesses say."""
    return Witness(*np.mean([(each.nats, each.explained) for each in of], axis=0).tolist())


def mean_evidence(records: Sequence[Evidence]) -> Evidence:
    """Return the mean of the evidence of records of one valve: a wrong model of its process errs alike in all."""
    return Evidence(mean_witness([each.pv for each in records]), mean_witness([each.output for each in records]))


@dataclass(frozen=True, slots=True)
class Calibration:
    """The three numbers."""

    constant: float
    of_pv: float
    of_output: float

    def probability(self, evidence: Evidence) -> float:
        """Return p, 0 to 1."""
        logit = self.constant + self.of_pv * evidence.pv.weight + self.of_output * evidence.output.weight
        return 1.0 / (1.0 + exp(-logit))


CALIBRATION = Calibration(constant=-0.31, of_pv=1.59, of_output=1.09)
