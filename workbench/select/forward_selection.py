"""Forward selection, as both searches for a missing effect share it: by simulation, and in a balance of forces.

A step tries every effect beside what is there, accepts by the rule of `effect_acceptance`, and adds the best accepted
one. What does as well as the added one stands beside it as a rival, unless it is still accepted in the step after: then
it is missing too.

The searches themselves differ. `effect_search` stops as soon as all is explained, for a step takes a minute;
`force_diagnosis` takes one step more, for its steps cost nothing, to find the rivals that have nothing left to explain.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from config.results.result import Brief
from sim.effect import Effect
from workbench.select.candidate_table import Tried
from workbench.select.equivalence import algebraic_class


@dataclass(frozen=True, slots=True, repr=False)
class Candidate(Brief):
    """An effect tried in one step, counted from 1, and why it is not accepted; empty if it is."""

    step: int
    name: str
    rejection_reason: str

    @property
    def tried(self) -> Tried:
        """Its row of the table; without errors where it could not be fitted."""
        raise NotImplementedError

    @property
    def accepted(self) -> bool:
        """Whether it passes the rule; the best of the accepted is added."""
        return not self.rejection_reason


FittedT = TypeVar("FittedT")
CandidateT = TypeVar("CandidateT", bound=Candidate)


@dataclass(frozen=True, slots=True, repr=False)
class ForwardStep(Brief, Generic[FittedT, CandidateT]):
    """One forward step: the model before, all candidates by evidence, the one added, and those that do as well."""

    before: FittedT
    candidates: tuple[CandidateT, ...]
    added: CandidateT | None
    indistinguishable: tuple[CandidateT, ...]
    """The added one and its rivals: the block errors do not tell them from it."""
    bare_equivalent: CandidateT | None = None
    """What would be accepted but that it is the bare valve by another name: a parameter that is kept is off."""
    suspected: tuple[CandidateT, ...] = ()
    """Where nothing is added: what would be if more were left to explain, and all that is not told from it."""
    contradicted: tuple[CandidateT, ...] = ()
    """Those that do as well as the added one but for a pressure that was not measured."""


@dataclass(frozen=True, slots=True, repr=False)
class ForwardSelection(Brief, Generic[FittedT, CandidateT]):
    """The steps of a search, and what they added."""

    steps: tuple[ForwardStep[FittedT, CandidateT], ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """The effects added, in order."""
        return tuple(step.added.name for step in self.steps if step.added)

    @property
    def indistinguishable(self) -> tuple[tuple[str, ...], ...]:
        """For each step with more than one equally good effect, their names."""
        return tuple(
            tuple(each.name for each in step.indistinguishable)
            for step in self.steps
            if len(step.indistinguishable) > 1
        )

    @property
    def candidates(self) -> tuple[CandidateT, ...]:
        """All candidates of all steps."""
        return tuple(each for step in self.steps for each in step.candidates)


def without_missing(
    step: ForwardStep[FittedT, CandidateT],
    following: ForwardStep[FittedT, CandidateT],
    library: Mapping[str, Effect],
) -> ForwardStep[FittedT, CandidateT]:
    """Drop from the rivals what is accepted after the added one too: it is missing as well, not a rival."""
    assert step.added
    accepted = {each.name for each in following.candidates if each.accepted}
    own = algebraic_class(step.added.name, library)
    rivals = tuple(each for each in step.indistinguishable if each.name in own or each.name not in accepted)
    return replace(step, indistinguishable=rivals)
