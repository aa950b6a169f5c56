"""The health of a valve: what wears it, how its friction stands against its baseline, and its NAMUR NE 107 status.

`Health.enter` takes each cycle, cheaply; `ne107_condition` gives the status on request; `HealthKeeper` stores the
counts over restarts.
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
