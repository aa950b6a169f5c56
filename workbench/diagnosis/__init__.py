"""What a recording says that a valve lacks, and whether that can be promised.

Its files:

    diagnosis, diagnosis_json                     puts it together; the same as JSON
    diagnosis_thresholds                          every number by which it decides
    verdict, verdict_sentence                     what follows, and how it is said
    judged_landings                               how many landings a verdict rests on, where nothing else is judged
    error_before_fit                              what the file leaves before anything is fitted
    doubt, doubts                                 what a verdict is asked before it is believed: a check a file
    moved_parameters                              what the file's own effects are by the recording
    kept_mass                                     what another mass than the valve file's would leave
    measured_pressure                             what the stem is from the measured pressure on
    command_or_pressure                           whether the measured pressure is what drives the stem
    pressure_scale                                whether the measured pressure is on the command's scale
    imitating_effect                              whether a form without a name does better than what was named
    positioner_or_packing                         what holds a stem behind its positioner
    extension, extension_json                     adds what was found; the same as JSON
    extension_journal                             what was added when, and why
"""
