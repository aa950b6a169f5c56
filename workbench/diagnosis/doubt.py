"""A doubt about a verdict, and what it is asked of.

    check(case) -> doubt or None

Each check is a file of its own; `doubts` has their order. A check sees what those before it doubt: of a stem that its
measured pressure does not drive nobody asks for the mass.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from config.results.result import Brief
from config.valve_file import ValveFile
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.verdict import EXPLAINED, Verdict
from workbench.select.effect_candidates import EffectStep, EvaluatedModel
from workbench.select.effect_search import Progress


class Doubt(Brief):
    """Why the best model of a diagnosis is not believed as it stands."""

    key: ClassVar[str]
    """Under which it stands in JSON."""
    overturns: ClassVar[bool] = False
    """Whether what explained the recording explains it no longer."""

    def sentence(self, kind: Kind) -> str:
        """Say so, and what to do, after "But", without the full stop; in the names and units of what was diagnosed."""
        raise NotImplementedError

    def as_json(self) -> dict[str, Any] | list[dict[str, Any]]:
        """Return it in plain types; SI units, in the names."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A verdict, and all that it rests on."""

    verdict: Verdict
    best: EvaluatedModel
    steps: tuple[EffectStep, ...]
    valve: ValveFile
    """As it was diagnosed."""
    library: Mapping[str, Effect]
    """What was tried, by name."""
    parts: Split
    given: AsGiven
    workers: int
    progress: Progress
    doubts: tuple[Doubt, ...] = ()
    """Those of the checks before."""

    @property
    def outcome(self) -> Verdict:
        """The verdict, unless a doubt has overturned it."""
        return "unexplained" if any(each.overturns for each in self.doubts) else self.verdict

    @property
    def explained(self) -> bool:
        """Whether all is explained."""
        return self.outcome in EXPLAINED
