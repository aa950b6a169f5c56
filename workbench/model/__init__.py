"""The model held against a record.

Its files:

    free_run                  simulates it whole, on the command alone
    told_run                  simulates it told when the stem moves, by the record's own moves
    slow_segments             a record as it is simulated without inertia
    initial_state             where a segment begins, and the pressure that nobody told
    lead                      what was commanded before a segment, for a pressure path that remembers
    simulation_regime         with inertia, without, or landing by landing: by how far apart the samples are
    command_between_samples   whether the command changed between them, by where slides end
    pressure_between_samples  what the measured pressure is between them
    search_coordinates        the coordinates of a fit
"""
