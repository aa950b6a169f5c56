"""The service round the control core: a bus, a clock, registers, a recorder, a log.

One blocking thread owns the driver and runs `cycle`; the supervisory server and the recorder have threads of their
own. They meet only in immutable snapshots that are replaced whole: the cycle waits for nobody.

    service, end_signals          starts and ends it; what ends it
    assembled_valves              its valves from their files, with all that runs for them; with what each is left
    workers                       processes that share them, where one processor is too little
    cycle, pacing, link           one cycle, when it begins, and the driver with its connection
    cycles_together               one thread that cycles many valves, where none is waited for
    cycle_load                    what the cycles of all valves cost, and how many fit
    first_look                    whether a device's numbers can be what the file takes them for
    backoff                       when to try again what failed, and what to say of it
    snapshot                      what a cycle leaves for the others
    supervisory_registers         what the DCS reads and writes
    experiment_registers          the same of a played experiment
    site_registers, local_switch  the same of events, requests and the switch that locks out; that switch
    service_manager               what systemd is told
    platform_needs                what it needs of a system, and what it goes without
    service_state                 what the service does for a valve: states and transitions
    refinement_process            fits in a process of its own
    recorder, logs                recordings and log lines, written beside the cycle
    recording_compression         closed recordings compressed, in a process of its own
    memory, sole_daemon           what is known of a valve, kept over restarts; that one daemon keeps it
    keeping_thread                one thread that keeps, for all valves
    cycle_statistics, health      how punctual it is; how the valve is (NAMUR NE 107)
    alarms                        who has seen what calls for somebody, by ISA-18.2
    history                       what has happened, written beside the cycle
"""
