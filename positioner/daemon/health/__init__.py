"""The health of a valve: what wears it, how its friction stands against its baseline, and its NAMUR NE 107 status.

`Health.enter` takes each cycle, cheaply; `condition` judges on request; `HealthKeeper` keeps the counts over restarts.
"""

from positioner.daemon.health.health_file import HealthRecord
from positioner.daemon.health.health_keeper import HealthKeeper, Kept
from positioner.daemon.health.ne107 import Condition, condition
from positioner.daemon.health.valve_health import Health, HealthSettings

__all__ = ["Condition", "Health", "HealthKeeper", "HealthRecord", "HealthSettings", "Kept", "condition"]
