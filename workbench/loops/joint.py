"""Several records of one valve taken together, by the mean of their evidence.

One record with a set-point step tells more than ten at rest; which it was need not be known beforehand. The evidence
does not add: what the model of the process has wrong is the same in each record. S is the median of the records, each
weighted by its evidence; its interval holds 95 % of that weight, and no less than one record's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.loops.calibration import CALIBRATION, mean_evidence
from workbench.loops.loop_diagnosis import LoopDiagnosis
from workbench.loops.thresholds import LIMITS


@dataclass(frozen=True, slots=True)
class Joint:
    """What records of one valve say together.

    Attributes:
        name: of the loop.
        records: how many were compared; those that are insufficient are left out.
        probability: that the valve sticks; None where all are insufficient.
        stiction_pct, low_pct, high_pct: apparent stiction and its 95 % interval; None where no record has evidence.
    """

    name: str
    records: int
    probability: float | None
    stiction_pct: tuple[float, float, float] | None

    @property
    def sentence(self) -> str:
        """The whole in one line."""
        of = f"{self.name}, {self.records} records together"
        if self.probability is None:
            return f"{of}: insufficient"
        if self.probability < LIMITS.sticks_probability or self.stiction_pct is None:
            return f"{of}: not called sticking (probability {100 * self.probability:.0f} %)"
        size, low, high = self.stiction_pct
        return (
            f"{of}: the valve sticks ({min(99.0, 100 * self.probability):.0f} %): "
            f"apparent stiction {size:.2g} % of the output ({low:.2g} to {high:.2g})"
        )


def together(found: Sequence[LoopDiagnosis]) -> Joint:
    """Return what records of one valve say together."""
    told = [(each.causes.friction.stiction_pct, each.evidence) for each in found if each.causes]
    name = found[0].record.name
    if not told:
        return Joint(name, 0, None, None)
    evidence = mean_evidence([each for _, each in told])
    sized = [(stiction_pct, each.pv.nats) for stiction_pct, each in told if each.pv.nats > 0.0]
    size = None
    if sized:
        sizes, weights = np.array(sorted(sized)).T
        place = np.cumsum(weights) / weights.sum()
        low, middle, high = (float(sizes[int(np.searchsorted(place, at))]) for at in (0.025, 0.5, 0.975))
        factor = float(np.exp(LIMITS.least_interval))
        size = (middle, min(low, middle / factor), max(high, middle * factor))
    return Joint(name, len(told), CALIBRATION.probability(evidence), size)
