"""The control core: a pure function of what it remembers, one sample and what the DCS asks for.

`controller.step` reads top to bottom: supervise, follow the reference, identify, choose the state, command. It
never reads a clock, sleeps, writes a file or touches a socket, so the same code runs in virtual time, lockstep and
real time.

    controller, controller_memory               one step, what it remembers and decides
    settings, requests, sample                  what it is given, once and in each cycle
    identifying                                 when the estimators run, and when what they found is applied
    supervision, states, reference              who commands, S0 to S3, the reference and its last change
    monitors                                    conditions of stem, command and cycle that must not last
    balance_law                                 the seed's law: the pressure that balances spring and friction
    breakaway_law, breakaway_memory             the law for small moves: the course of a move
    slide_law, slide_memory                     the law of slides: nothing, one or two
    move_law, move_memory                       the law that chooses the move: nothing, a pulse, a slide or two
    reference_course                            does the reference rest, or take back what would be corrected
    slide_balance                               where a slide lands, and how margins go over the travel
    slide_margins, margins_over_travel          how far a slide must be sent to break the stem loose, as learnt
    slide_inverse                               what the law of slides takes from an extended valve
    pressure_path                               lead against a slow pressure of an extended valve, and its arrival
    cutoffs                                     beside a stop: the stem is pressed onto it
    conventional_law                            PI on position, to compare the others with
    law_memory                                  the law with a memory that is in force, whichever it is
    pulse, pulse_trial, pulse_following         what a pulse does, which to give and learn from, one in progress
    valve_knowledge, restoration                what is known of a valve, as data; is it still true after a restart
    rest_detector                               where the stem rests
    excitation                                  S3: which excitation is under way, and when it ends
    sine_excitation, staircase_excitation       a sine, or a staircase of slides
    permissives                                 what permits S3 and an experiment, and what its end does
    played_experiment                           a sequence that the DCS consents to: what it may, how it ends
"""
