"""Tests that move the valve, and what they show: programs for played experiments, with their figures and verdicts.

For the instrument technician: docs/tests-on-the-valve.md. A test knows nothing of who plays it: a running daemon's
registers, a cycle of the command's own, or virtual time. It needs numpy alone.

    program                         what is played, within what, and what came of it
    valve_test_thresholds           every number by which tests are paced and judged, with its reason
    own_cycle                       programs on a cycle that this process turns itself
    ramps                           slow ramps: lines, ends, and what they are at no rate
    signature                       the valve signature: friction, spring rate, bench set, seat load, bands
    breakout                        where a stem at rest breaks loose, and where it is back
    partial_stroke, credit          the partial stroke test; the credit that it may claim
    continuous_stroke               break-away friction in operation, by a command that creeps
    small_steps                     dead band, resolution and step response, by small steps
    air_rates                       how fast the actuator fills and vents; whether it has air
    commissioning                   from commands and a reading alone to what a daemon's file needs
    outcome                         figures, verdicts by their codes, picture; how they show themselves
    as_found_report                 as found and as left of a valve, as HTML or PDF
    kept_records                    as found, as left, factory: kept, and what has changed since
"""
