"""Which effect is missing.

Its files:

    diagnosis, diagnosis_json                     puts it together; the same as JSON
    effect_search, effect_candidates              the library refitted step by step; one step
    forward_selection, candidate_table            shared with the balance of forces; what was tried, shown
    effect_acceptance, block_errors               the rule by which an effect is accepted; its statistics
    pressure_errors                               how far a fit's pressure is off the measured one
    knife_edges                                   held-out slips that are narrowly mistimed, by name
    verdict, verdict_sentence                     what follows, and how it is said
    judged_landings                               how many landings a verdict rests on, where nothing else is judged
    equivalence                                   what no recording tells apart
    moved_parameters                              what the file's own effects are by the recording
    kept_mass                                     what another mass than the valve file's would leave
    measured_pressure                             what the stem is from the measured pressure on
    positioner_or_packing                         what holds a stem behind its positioner
    tangent_preview                               the quick first ranking
    experiment, experiment_design                 the input that tells rivals apart: off a menu, or designed
    discrimination                                rivals told apart by one experiment after another
    rival_race                                    the rivals weighed against each other in all recordings so far
    slip_evidence                                 what slips say of a rival: balances, whatever came between
    slip_promise                                  what the slips of an experiment promise to say
    residual_structure                            the meter of what is unexplained
    rest_errors                                   whether slides end where the model says
    extension, extension_json                     adds what was found; the same as JSON
    extension_journal                             what was added when, and why
"""
