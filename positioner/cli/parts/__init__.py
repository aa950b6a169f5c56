"""What several commands share.

A command imports from here what it needs when it runs.

    command_finder                              which commands there are, and what an extra would add
    children, simulated_plant, pseudo_line      other commands as processes, a slave and a daemon of them, a serial line
    demo_folder                                 where a demo leaves its files, and whose those there are
    daemon_address, experiment_player           where a daemon is; experiments played on its valve
    valve_test, own_valve                       what tests on the valve share; a valve on a cycle of the command's own
    csv_series, export_arguments, given_names   series, historian's exports, and names of files in messages
    fit_arguments                               what judges, noise, measured pressure; the recordings read so
    loop_arguments                              the columns of a control loop
    model_arguments                             a valve file and effects, checked before the work begins
    diagnose_forces, next_step                  `diagnose` on a bench's recording; what to type after a diagnosis
    extended_valves                             `[law] valve` of a daemon's file, worked out
    config_argument                             which file a command is about
    output_files                                what `--out` and `--json` ask for
    sampling_order                              when a device samples, for `doctor --nudge-pa`
    trial_authority, progress, passing_line     a test certificate authority; progress on a terminal, in one line there
    clone_only                                  what a command finds in a clone of the project alone
    breaking_off                                Ctrl-C during long work: what is known is said
"""
