"""The rule by which an effect is accepted: evidence on what was fitted, and on what was held out.

    evidence = sum_j n_j log(s_j^2 / s_j'^2) - sum_i c_i' + sum_i c_i
                                               of base and candidate ('): s_j^2 mean square residual of the j-th kind,
                                               motion, landings, rests, break-aways, of which n_j are independent; at
                                               least the noise's
    c_i = max(log n, 2 log(w_i / (sqrt(2 pi) d_i)))
                                               what a free parameter costs: n landings and break-aways; of an effect's
                                               w_i the range and d_i the deviation of its coordinate (Occam factor,
                                               MacKay 1992): one that is known to a part in a million was sought at a
                                               million places
    held-out evidence = sum_j n_j log(s_j^2 / s_j'^2)
                                               of what was held out, the valve as it was fitted: nothing is taken off,
                                               for nothing was fitted there

Both must say that the effect is there. What acts seldom may not act in what was held out: with overwhelming evidence,
and nothing held out that speaks against it, an effect is suspected. The rule is the same for a balance of forces, where
blocks of strokes or readings are what is independent.
"""

from dataclasses import dataclass
from math import log

from workbench.fit.fit_result import Fit, Terms
from workbench.select.block_errors import BlockErrors
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True)
class Gain:
    """How much a candidate is better than its base."""

    bic: float
    """Evidence on what was fitted."""
    held_out: float
    """Relative reduction of the held-out rms error."""
    held_out_evidence: float
    least: float = SELECTION.least_evidence
    """Evidence that is needed."""

    @property
    def overwhelming(self) -> bool:
        """Whether the fitted part leaves no doubt, and what was held out does not speak against it."""
        return self.bic > SELECTION.overwhelming_evidence and self.held_out_evidence >= 0.0

    @property
    def rejection_reason(self) -> str:
        """What the candidate lacks to be accepted; empty if nothing."""
        if self.bic < -self.least:
            return f"the fitted part speaks against it: evidence {self.bic:.3g}, more than {self.least:g} needed"
        if self.bic <= self.least:
            return f"may be chance: evidence {self.bic:.3g}, more than {self.least:g} needed"
        if self.held_out_evidence <= SELECTION.least_held_out:
            return (
                f"the held-out part does not show it: evidence {self.held_out_evidence:.3g} there, "
                f"more than {SELECTION.least_held_out:g} needed"
            )
        return ""


def no_better(first: str) -> str:
    """Say why an effect is refused that comes after another and has not the least evidence more."""
    return f"explains no better than {first}, which is tried before it"


def gain(
    base: Fit,
    candidate: Fit,
    base_errors: BlockErrors,
    candidate_errors: BlockErrors,
    least: float = SELECTION.least_evidence,
) -> Gain:
    """Compare a candidate with its base; so much evidence is needed at least."""
    return Gain(
        evidence_for(candidate, base),
        1.0 - candidate_errors.test_rmse_m / base_errors.test_rmse_m,
        2.0 * candidate_errors.held_out.nats_above(base_errors.held_out),
        least,
    )


def evidence_for(one: Fit, other: Fit) -> float:
    """Return the evidence for a fit against another of the same record.

    2 (log-likelihood of one less the other's) - (the cost of its parameters less the other's): kind by kind the
    likelihood of `workbench.fit.fit_result.Terms`.
    """
    return 2.0 * one.terms.nats_above(other.terms) - (_cost(one) - _cost(other))


def promise(terms: Terms, other: Terms, more: int) -> float:
    """Return the most evidence that a likelihood may come to by so many more parameters, whose deviations are open."""
    return 2.0 * terms.nats_above(other) - more * _log_events(terms)


def _cost(fit: Fit) -> float:
    """Return what the parameters of a fit cost: an effect's by how little of its range is left."""
    least = _log_events(fit.terms)
    left = dict(zip((each.name for each in fit.known.parameters), fit.known.share_left.tolist(), strict=True))
    return sum(max(least, -2.0 * log(left.get(name, 1.0)) if "." in name else least) for name in fit.parameters)


def _log_events(terms: Terms) -> float:
    return log(max(terms.events, 2.0))
