"""How many landings a verdict rests on, where the command changed between samples and nothing else is judged.

    n_f > 2 k,   n_h > k        n_f, n_h landings fitted and held out, k parameters fitted

So many landings as parameters are met whatever the valve is; only those beyond tell whether a model holds. Held out,
there are to be more than could be met by chance if each parameter were free once more.

However many there are: what the pressure did between samples is not known. A controller that pushes and lets go again
within a sample leaves the stem where no balance does, which looks like an effect that no library has. So of what is
left there nobody can say that something is missing. Nor where a record does not tell whether its command was held.
"""

from dataclasses import dataclass

from workbench.data.held_out import Part, Split
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.fit.fit_result import Fit
from workbench.model.simulation_regime import MORE_LANDINGS, Sampling, landings

UNTOLD = (
    "the recording does not show whether, or when, the command changed between samples, and the error that is left may "
    "come from that"
)


@dataclass(frozen=True, slots=True)
class JudgedLandings:
    """Landings under a settled pressure, by which a model of so many parameters is fitted and judged."""

    fitted: int
    held_out: int
    parameters: int

    @property
    def enough(self) -> bool:
        """Whether a verdict can rest on them."""
        return self.fitted > DIAGNOSIS.landings_a_parameter * self.parameters and self.held_out > self.parameters

    @property
    def sentence(self) -> str:
        """Say why nothing is judged by them."""
        if self.enough:
            return "the error that landings leave may come from the pressure between samples, which is not known"
        return (
            f"{self.fitted} landings fitted and {self.held_out} held out are too few for {self.parameters} parameters, "
            f"more than {DIAGNOSIS.landings_a_parameter * self.parameters} and {self.parameters} are needed"
        )


def unknown_between_samples(fit: Fit, split: Split) -> str:
    """Say that what happened between samples is not known, so that nothing is judged, and what would tell; or empty."""
    landed = judged_landings(fit, split)
    if landed is None and fit.by.sure:
        return ""
    why = landed.sentence if landed else UNTOLD
    return f"{why}. To know, {MORE_LANDINGS}."


def judged_landings(fit: Fit, split: Split) -> JudgedLandings | None:
    """Return how many landings a fit rests on; None where more than landings is judged."""
    if fit.by.held:
        return None
    fitted, held_out = (_settled(part, fit.by.of(part.record, fit.valve.valve)) for part in (split.train, split.test))
    return JudgedLandings(fitted, held_out, len(fit.parameters))


def _settled(part: Part, by: Sampling) -> int:
    if by.held or by.valve is None:
        return 0
    found = landings(part.record, by.valve)
    return sum(settled and bool(part.counted[each.first]) for each, settled in found)
