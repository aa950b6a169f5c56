"""The service round the control core: a bus, a clock, registers, a recorder, a log.

One blocking thread owns the driver and runs `cycle`; the supervisory server and the recorder have threads of their
own. They meet only in immutable snapshots that are replaced whole: the cycle waits for nobody.
"""
