"""Estimation: what the valve's parameters and its friction are, from the samples of its motion.

`Identification` takes a sample and gives `Estimates`; `accept` decides which of them are applied. Needs numpy only;
time comes in with the samples.
"""

from config.codes import Refusal
from positioner.estimation.acceptance import Applied, Ratios, accept
from positioner.estimation.estimates import Estimate, Estimates, no_estimates
from positioner.estimation.online import Identification, IdentificationSettings

__all__ = [
    "Applied",
    "Estimate",
    "Estimates",
    "Identification",
    "IdentificationSettings",
    "Ratios",
    "Refusal",
    "accept",
    "no_estimates",
]
