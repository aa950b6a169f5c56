"""Which effect is missing: the library refitted, and the rule by which one is added.

Its files:

    effect_search, effect_candidates              the library refitted step by step; one step
    forward_selection, candidate_table            shared with the balance of forces; what was tried, shown
    effect_acceptance, block_errors               the rule by which an effect is accepted; its statistics
    selection_thresholds                          every number by which something is decided here, with its reason
    pressure_errors                               how far a fit's pressure is off the measured one
    pressure_scatter                              what the noise of a measured pressure moves a stem by: of the floor
    equivalence                                   what no recording tells apart
    tangent_preview                               the quick first ranking
    separating_experiment                         the input that tells rivals apart, off a menu
    residual_structure                            the meter of what is unexplained
"""
