"""What an experiment must stay inside, whoever designs or plays it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ExperimentLimits:
    """Pa, Pa/s, s for the approach and the sequence, m of stem travel."""

    minimum_pa: float
    maximum_pa: float
    rate_pa_per_s: float
    longest_s: float
    low_m: float
    high_m: float
