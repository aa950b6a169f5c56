"""Fixtures for the tests of other projects (`positioner[pytest]`): a valve, a daemon and a bad wire as processes.

What pytest loads runs in somebody else's process, where `config` or `sim` may be a package of theirs: it imports the
standard library, pytest and this room alone. All that is ours runs in child processes, for which ours come first.

Its files:

    plugin                       the fixtures: `valve_slave`, `positioner_daemon`, `fault_proxy`
    handles                      what a test holds of each
    site_files                   the files that they are given
    child_process                a process of ours: its ready line, questions to it, its end
    tied                         in a child: be a module, and end with whoever started it
    agent                        in a child: asks a device or a daemon for a test
    fault_proxy, wire_faults     in a child: a wire for Modbus TCP that is spoilt on demand; how
"""
