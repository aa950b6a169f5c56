"""Several records of one valve taken together, by the mean of their evidence.

One record with a set-point step tells more than ten at rest; which it was need not be known beforehand. The evidence
does not add: what the model of the process has wrong is the same in each record. S is the median of the records, each
weighted by its evidence; its interval holds 95 % of that weight, of the lower ends and of the upper ones.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np

from workbench.loops.calibration import CALIBRATION, mean_evidence
from workbench.loops.causes import Size
from workbench.loops.loop_diagnosis import LoopDiagnosis
from workbench.loops.loop_thresholds import LIMITS


@dataclass(frozen=True, slots=True)
class Joint:
    """What records of one valve say together.

    Attributes:
        name: of the loop.
        records: how many were compared; those that are insufficient are left out.
        probability: that the valve sticks; None where all are insufficient.
        size: apparent stiction; None where no record has evidence.
    """

    name: str
    records: int
    probability: float | None
    size: Size | None

    @property
    def sentence(self) -> str:
        """The whole in one line."""
        of = f"{self.name}, {self.records} records together"
        if self.probability is None:
            return f"{of}: insufficient"
        if self.probability < LIMITS.sticks_probability or self.size is None:
            return f"{of}: not called sticking (probability {100 * self.probability:.0f} %)"
        sticks = f"{of}: the valve sticks ({min(99.0, 100 * self.probability):.0f} %)"
        return f"{sticks}: apparent stiction {self.size.said} % of the output"


def together(found: Sequence[LoopDiagnosis]) -> Joint:
    """Return what records of one valve say together."""
    told = [(each.causes.friction.size, each.evidence) for each in found if each.causes]
    name = found[0].record.name
    if not told:
        return Joint(name, 0, None, None)
    evidence = mean_evidence([each for _, each in told])
    sized = [(astuple(size), each.pv.nats) for size, each in told if each.pv.nats > 0.0]
    size = None
    if sized:
        sizes, weights = zip(*sized, strict=True)
        columns = zip(np.transpose(sizes), (0.5, 0.025, 0.975), strict=True)
        size = Size(*(float(np.quantile(of, at, weights=weights, method="inverted_cdf")) for of, at in columns))
    return Joint(name, len(told), CALIBRATION.probability(evidence), size)
