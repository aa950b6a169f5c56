"""What the law uses of the identifications: estimated and applied are two things."""

from dataclasses import dataclass

from positioner.control.law import Ratios
from positioner.estimation.bookkeeping import Applied, accept
from positioner.estimation.estimate import Estimates, Reason


@dataclass(frozen=True, slots=True)
class Adoption:
    """What became of the identifications: the estimates in use, how many were refused and why the last one was."""

    applied: Applied
    refusals: int = 0
    refusal: Reason = Reason.VALID

    @property
    def ratios(self) -> Ratios | None:
        """What the law uses, None before there is anything."""
        applied = self.applied
        return Ratios(applied.b_over_c.value, applied.k_over_c.value) if applied.law_ready else None

    def consider(self, estimates: Estimates) -> "Adoption":
        """Return what is in use once an identification has ended: a bad one never replaces a good one."""
        applied, refusal = accept(self.applied, estimates)
        if refusal in (Reason.VALID, Reason.NOT_ASKED):
            return Adoption(applied, self.refusals)
        return Adoption(applied, self.refusals + 1, refusal)
