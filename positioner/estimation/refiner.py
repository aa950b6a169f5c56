"""The refinement of an identification: a job goes out, its result comes back, at once or some cycles later.

The control core hands a job to a `Refiner` and asks at each sample whether the result is there. In virtual time it is
computed by `InProcessRefiner`; the daemon has a process of its own for it (`positioner.daemon.refinement_process`), for
a fit of some tens of milliseconds has no place in a cycle of one.
"""

from dataclasses import dataclass
from typing import Protocol

from positioner.estimation.array import Array
from positioner.estimation.batch import BatchResult, BatchSettings, identify
from positioner.estimation.linear_problem import Prior


@dataclass(frozen=True, slots=True)
class RefinementJob:
    """Samples to identify the valve from, (N,) each, SI units; see `batch.identify`."""

    time_s: Array
    position_m: Array
    pressure_pa: Array
    settings: BatchSettings
    prior: Prior | None = None

    def run(self) -> BatchResult:
        """Run it."""
        return identify(self.time_s, self.position_m, self.pressure_pa, self.settings, self.prior)


class Refiner(Protocol):
    """One job at a time."""

    def submit(self, job: RefinementJob) -> bool:
        """Take a job; False when there is one under way, or nobody to do it."""

    def collect(self) -> BatchResult | None:
        """Return the result, once; None when there is none (yet)."""

    @property
    def pending(self) -> bool:
        """Whether a result is still to come."""


class InProcessRefiner:
    """Runs the job in the calling thread."""

    def __init__(self) -> None:
        self._result: BatchResult | None = None

    def submit(self, job: RefinementJob) -> bool:
        """Run a job."""
        self._result = job.run()
        return True

    def collect(self) -> BatchResult | None:
        """Return its result, once."""
        result, self._result = self._result, None
        return result

    @property
    def pending(self) -> bool:
        """Whether a result waits to be collected."""
        return self._result is not None
