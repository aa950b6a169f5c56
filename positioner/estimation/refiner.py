"""Who refines: a job goes out, its result comes back, at once or some cycles later.

The control core hands a job to a `Refiner` and asks at each sample whether the result is there. In virtual time it is
computed `InPlace`; the daemon has a process of its own for it (`positioner.daemon.refinement_process`), for a fit of
some tens of milliseconds has no place in a cycle of one.
"""

from dataclasses import dataclass
from typing import Protocol

from positioner.estimation.array import Array
from positioner.estimation.batch import Recorded, RecordSettings, identify
from positioner.estimation.likelihood import Prior


@dataclass(frozen=True, slots=True)
class Job:
    """Samples to identify the valve from; see `recorded.identify`."""

    time_s: Array
    position_m: Array
    pressure_pa: Array
    settings: RecordSettings
    prior: Prior | None = None

    def done(self) -> Recorded:
        """Do it."""
        return identify(self.time_s, self.position_m, self.pressure_pa, self.settings, self.prior)


class Refiner(Protocol):
    """One job at a time."""

    def submit(self, job: Job) -> bool:
        """Take a job; False when there is one under way, or nobody to do it."""

    def collect(self) -> Recorded | None:
        """Return the result, once; None when there is none (yet)."""

    @property
    def pending(self) -> bool:
        """Whether a result is still to come."""


class InPlace:
    """Does the job where it is called."""

    def __init__(self) -> None:
        self._result: Recorded | None = None

    def submit(self, job: Job) -> bool:
        """Do it."""
        self._result = job.done()
        return True

    def collect(self) -> Recorded | None:
        """Return what came out of it, once."""
        result, self._result = self._result, None
        return result

    @property
    def pending(self) -> bool:
        """Whether a result waits to be collected."""
        return self._result is not None
