"""What one cycle leaves for the others: replaced whole, never changed."""

from dataclasses import dataclass

from positioner.control.controller_memory import Decision
from positioner.control.sample import Sample


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The last sample and what was decided on it."""

    sample: Sample
    decision: Decision
