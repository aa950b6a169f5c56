"""The control core: a pure function of what it remembers, one sample and what the DCS asks for.

`controller.step` reads top to bottom: supervise, follow the reference, identify, choose the state, command. It
never reads a clock, sleeps, writes a file or touches a socket, so the same code runs in virtual time, lockstep and
real time.

    controller, controller_memory               one step, what it remembers and decides
    keyword_records                             how a record is made: by name
    settings, requests, sample                  what it is given, once and in each cycle
    identifying                                 when the estimators run, and when what they found is applied
    supervision, states, reference              who commands, is the DCS there; S0 to S3; the reference
    monitors, rest_band                         conditions that must not last; where a stem rests by what is known
    laws                                        the laws, a folder each: what commands in S1 and S2
    pressure_clamp                              the one clamp: what is not finite is not commanded
    pressure_lead                               lead against a slow pressure of an extended valve, and its arrival
    travel                                      from the DCS's signal to the reference: characteristic, ramp, cut-offs
    unseen_direction                            by steps in a direction whose friction is not known
    valve_knowledge, restored_knowledge         what is known of a valve, as data; is it still true after a restart
    excitation                                  S3: which excitation is under way, and when it ends
    sine_excitation, staircase_excitation       a sine, or a staircase of slides
    permissives                                 what permits S3 and an experiment, and what its end does
    played_experiment                           a sequence that the DCS consents to: what it may, how it ends
"""
