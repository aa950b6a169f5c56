"""The refinement of an identification: a job goes out, its result comes back, at once or some cycles later.

What the control core wants refined it leaves in its memory. Who keeps that hands it to a `Refiner`, and tells the core
at each sample how the refinement stands: so the core asks nobody. In virtual time a job is computed by
`InProcessRefiner`; the daemon has a process of its own for it (`positioner.daemon.refinement_process`), for a fit of
some tens of milliseconds has no place in a cycle of one.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

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


class Refinement(NamedTuple):
    """How the refinement stands at a sample."""

    result: BatchResult | None = None
    """Of the last job, once."""
    pending: bool = False
    """Whether one is still to come."""

    @classmethod
    def of(cls, refiner: "Refiner") -> "Refinement":
        """Return how it stands with a refiner."""
        return cls(result=refiner.collect(), pending=refiner.pending)


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
