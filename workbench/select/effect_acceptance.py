"""The rule by which an effect is accepted: evidence on what was fitted, and a smaller error on what was held out.

    BIC = n log(2 C / n) + k log n             C soft-L1 cost, k free parameters; the evidence is base less candidate
    reduction, in its standard errors          of the held-out block errors (`block_errors`)

A falling held-out error is needed for an effect; it proves none. What acts in k of n held-out blocks makes it fall by
some sqrt(k) standard errors, however sure, and by no more than 1 - 2^(-k/n), since none counts for more than a factor
of 2. Where the evidence leaves no doubt, and what was left above the noise is gone, one standard error is enough, and
of a fall of more than two it does not matter how small it is. The rule is the same for a balance of forces, where the
blocks are strokes or readings in place of seconds.
"""

from dataclasses import dataclass

import numpy as np

from workbench.fit.fit_result import Fit
from workbench.select.block_errors import NOISE_KNOWN_TO, BlockErrors, relative_error_reduction

LEAST_BIC, LEAST_INDEPENDENT = 10.0, 3.0
"""Of all samples; of independent ones, where the model before leaves something. Else these need as much as all."""
OVERWHELMING_BIC = 10.0 * LEAST_BIC
"""Of independent samples; suspected whatever was held out, for an effect that acts rarely need not show there."""
LEAST_REDUCTION = 0.05
LEAST_STANDARD_ERRORS, AT_THE_FLOOR, COMPLETE = 2.0, 3.0, 1.0
"""More where the error is at the floor: of twenty candidates one falls by two deviations by pure chance. So much, too,
says of a drive that drifts, whose error is one arc, what its independent samples do not. Less where overwhelming
evidence leaves nothing."""


@dataclass(frozen=True, slots=True)
class Gain:
    """How much a candidate is better than its base."""

    bic: float
    held_out: float
    """Relative reduction of the held-out block error."""
    standard_errors: float
    """The same in its own standard errors."""
    independent_share: float
    """Share of the samples that are independent."""
    completes: bool = False
    """Whether the model before leaves more than the noise may be off by, and with the candidate nothing is left."""

    @property
    def independent_bic(self) -> float:
        """What the evidence is worth: by as many samples as are independent."""
        return self.independent_share * self.bic

    @property
    def overwhelming(self) -> bool:
        """Whether the fitted part leaves no doubt, and what was held out does not speak against it."""
        return self.independent_bic > OVERWHELMING_BIC and self.held_out >= 0.0

    def rejection_reason(self, at_floor: bool) -> str:
        """Say what the candidate lacks to be accepted; empty if nothing.

        Args:
            at_floor: whether the error of the model before is at the floor, however what is left hangs on the state.
        """
        least = AT_THE_FLOOR if at_floor else LEAST_STANDARD_ERRORS
        complete = self.completes and self.overwhelming
        least = COMPLETE if complete else least
        however_small = complete and self.standard_errors > LEAST_STANDARD_ERRORS
        if self.bic <= LEAST_BIC:
            return f"may be chance: evidence {self.bic:.3g}, more than {LEAST_BIC:g} needed"
        independent = LEAST_BIC if at_floor else LEAST_INDEPENDENT
        surely_held_out = not at_floor and self.standard_errors > AT_THE_FLOOR
        if self.independent_bic <= independent and not surely_held_out:
            return (
                f"may be chance: neighbouring samples err alike, so evidence {self.bic:.3g} counts for "
                f"{self.independent_bic:.2g}, more than {independent:g} needed"
            )
        if self.held_out <= LEAST_REDUCTION and not however_small:
            way = "falls" if self.held_out >= 0.0 else "rises"
            changes = f"the held-out error {way} by {100 * abs(self.held_out):.2g} %"
            return f"{changes}, a fall of more than {100 * LEAST_REDUCTION:g} % needed"
        if self.standard_errors <= least:
            return (
                f"may be chance: the held-out error falls by {self.standard_errors:.2g} times its own uncertainty, "
                f"more than {least:g} needed"
            )
        return ""


def no_better(first: str) -> str:
    """Say why an effect is refused that comes after another and has not `LEAST_BIC` more evidence."""
    return f"explains no better than {first}, which is tried before it"


def gain(
    base: Fit, candidate: Fit, base_errors: BlockErrors, candidate_errors: BlockErrors, floor_m: float | None = None
) -> Gain:
    """Compare a candidate with its base; the floor, m, if it is known, tells whether anything is left."""
    held_out, standard_errors = relative_error_reduction(base_errors.logs, candidate_errors.logs)
    left = floor_m is not None and base_errors.floors_left(floor_m) > NOISE_KNOWN_TO
    completes = left and candidate_errors.leaves_nothing(floor_m)
    evidence = bic(base) - bic(candidate)
    return Gain(evidence, held_out, standard_errors, candidate_errors.independent_share, completes)


def bic(fit: Fit) -> float:
    """Return the robust Bayesian information criterion: less is better."""
    n = fit.count
    return float(n * np.log(2.0 * max(fit.cost, np.finfo(float).tiny) / n) + len(fit.parameters) * np.log(n))


def log_likelihood_difference(one: Fit, other: Fit) -> float:
    """Return twice the log-likelihood of one fit less that of another, n log(C_other / C_one): BIC without k log n."""
    least = np.finfo(float).tiny
    return float(one.count * np.log(max(other.cost, least) / max(one.cost, least)))
