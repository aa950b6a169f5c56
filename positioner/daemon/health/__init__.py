"""The health of a valve: what wears it, how its friction stands against its baseline, and its NAMUR NE 107 status.

`Health.enter` takes each cycle, cheaply; `ne107_condition` gives the status on request; `HealthKeeper` stores the
counts over restarts.

    valve_health                            all of it, cycle by cycle
    travel_accumulator, stiction_index      how far and how often the stem went; how often it did not
    ne107                                   status and causes
    valve_conditions                        what is looked at once a second: limits, tests that are due, another spring
    friction_alarms, e_detector             friction and stiction, by tests that keep a promise about false alarms
    daily_figures                           how it is used, day by day: histograms, ends, course, leak, supply, air
    position_limits                         limits of the opening, with dead band and delay
    health_keeper, health_file              logs the status, stores the counts
"""

from positioner.daemon.health.health_file import HealthRecord
from positioner.daemon.health.health_keeper import HealthKeeper, StoredHealth
from positioner.daemon.health.ne107 import Ne107Condition, ne107_condition
from positioner.daemon.health.valve_health import Health, HealthSettings

__all__ = [
    "Health",
    "HealthKeeper",
    "HealthRecord",
    "HealthSettings",
    "Ne107Condition",
    "StoredHealth",
    "ne107_condition",
]
