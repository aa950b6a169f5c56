"""Estimation: what the valve's parameters and its friction are, from the samples of its motion.

`Identification` takes a sample and gives `Estimates`; `accept` decides which of them are applied. Needs numpy only;
time comes in with the samples.

    online, sample_window, estimates, acceptance    sample by sample; the estimates; whether they replace those in use
    algebraic, weighted_least_squares, validity     the seed's identifier, with weights; what is uncertain or unphysical
    derivatives, friction_estimator                 velocity and acceleration; what the acceleration leaves for friction
    motion_detector, running_noise                  does the stem move; the noise of its sensor
    recording_estimates, batch                      from a whole recording: find its motions, fit them, check the fit
    segmentation, motion_segment                    the motions in a record; one of them
    record_consistency                              is the whole record that of the valve fitted to a part of it
    likelihood, likelihood_search                   the fit by maximum likelihood: result and search
    motion_preparation, linear_problem              its rows and its least squares
    stem_response, array                            the stem's exact response, which is fitted; the type of all arrays
    landings                                        the static law, from where slides end in rest
    refiner, passive_identification                 who runs a fit; from ordinary moves, one after another
    breakaway_force                                 F_s/A
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
