"""What one cycle leaves for the others: replaced whole, never changed."""

from dataclasses import dataclass

from positioner.control.controller_memory import Decision
from positioner.control.sample import Sample
from positioner.history.entries import Event


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The last sample and what was decided on it."""

    sample: Sample
    decision: Decision
    event: Event | None = None
    """The newest of the valve's history, if it has one."""
