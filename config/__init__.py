"""The ground floor: what people write and read, declared once. Imports no other room.

Its files:

    valve_file, slave_file, daemon_file           what a person writes: the valve, the simulated slave, the daemon
    actuators                                     which actuators are simulated and positioned; what others need
    drive                                         the names and units of what a force, torque or current moves
    travel, travel_table                          opening and stem, by the action of air; table [travel]
    data_sheet, valve_changes                     a valve file from a data sheet; another with values set by hand
    extended_valve                                a valve file worked out for the controller
    loading, valve_file_writer, plain_file        reads such a file; writes a valve's; what may be read at all
    file_kinds                                    which of these a file is, where another is asked for
    file_prefix                                   what the names of a valve's files begin with
    json_value                                    a result as JSON has it, which knows no NaN
    toml_editing                                  keys given new values in a text whose comments stay
    whole_file, lock_file                         replaces a file, or fills a folder, whole or not at all; a lock
    device, canopen_device                        table [device], on Modbus and on CANopen
    supervision_table, record_tables              tables [safety] and [supervision]; [recorder] and [history]
    alarm_table, alarm_advice                     table [alarms]; what somebody does about an alarm
    hosts, serial_port, tls_table                 where it is, and how it is secured
    entry_points, bus_plugins, law_names          what other packages bring by entry points; buses; laws
    extras                                        which extra brings what is not installed
    quantities, quantity_map, modbus_map          what a device measures and obeys; where it keeps it; in registers
    register_format                               values in words
    experiment_limits                             what an experiment must stay inside
    registers, codes, roles                       every register and who may write it; every code; the roles
    passwords, role_passwords                     passwords as they are kept, how often one is tried; of the roles
    recording, recording_oddities                 the recording format; what is odd about a recording
    recorder_files                                the files of a daemon's recorder, by their names
    results                                       what results have in common in a notebook
    arguments                                     what the library's functions are given: other kinds are refused
    errors                                        InputError (exit status 2), CommandFailed (1): each one line
"""
