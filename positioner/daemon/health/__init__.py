"""The health of a valve: what wears it, how its friction stands against its baseline, and its NAMUR NE 107 status.

`Health.enter` takes each cycle, cheaply; `condition` judges on request; `HealthKeeper` keeps the counts over restarts.
"""

from positioner.daemon.health.condition import Condition, condition
from positioner.daemon.health.health import Health, HealthSettings
from positioner.daemon.health.keeper import HealthKeeper, Kept
from positioner.daemon.health.record import HealthRecord

__all__ = ["Condition", "Health", "HealthKeeper", "HealthRecord", "HealthSettings", "Kept", "condition"]
