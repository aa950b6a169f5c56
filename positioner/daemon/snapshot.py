"""What one cycle leaves for the others: replaced whole, never changed."""

from typing import NamedTuple

from config.codes import Fault, Quality
from positioner.control.controller_memory import Decision
from positioner.control.sample import Sample
from positioner.history.entries import Event


class Snapshot(NamedTuple):
    """The last sample and what was decided on it."""

    sample: Sample
    decision: Decision
    event: Event | None = None
    """The newest of the valve's history, if it has one."""

    def stalled(self) -> "Snapshot":
        """Return what is true where no cycle has come since for too long: what the next will find, a stall."""
        decision = self.decision
        found = decision._replace(fault=decision.fault or Fault.STALLED)
        return self._replace(sample=self.sample._replace(quality=Quality.LOST), decision=found)
