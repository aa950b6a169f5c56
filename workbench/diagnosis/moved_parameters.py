"""What a valve file says of its own effects, and a fit says otherwise: a preload of the data sheet that was moved.

A file's effects are free in every fit. What is missing may be made up for by one of them: an asymmetric friction by
another preload. So where a fitted parameter excludes the file's value, that is said, with the effects that it may stand
in for, by their files' `CONFOUNDED`. What a positioner is set to is a guess to begin with.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from config.valve_file import ValveFile
from sim.effect import Effect, find_effect
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.diagnosis.doubt import Case, Doubt
from workbench.fit.fit_result import Fit
from workbench.fit.parameter_estimate import Fitted
from workbench.select.equivalence import algebraic_class, distinguishing_record


@dataclass(frozen=True, slots=True)
class Moved:
    """A parameter of one of the file's effects, before and as it was fitted, and what it may stand in for."""

    name: str
    before: float
    fitted: Fitted
    like: tuple[str, ...]

    def sentence(self, kind: Kind) -> str:
        """Say so."""
        after = self.fitted
        same = f"; {' or '.join(self.like)} may look the same" if self.like else ""
        return kind.text(
            f"the recording says that {self.name} is {after.value:.4g} (95 %: {after.lower:.4g} to {after.upper:.4g}); "
            f"the valve file says {self.before:.4g}{same}"
        )


@dataclass(frozen=True, slots=True, repr=False)
class MovedParameters(Doubt):
    """All of them."""

    key: ClassVar[str] = "moved"

    moved: tuple[Moved, ...]

    def sentence(self, kind: Kind) -> str:
        """Say so."""
        return ". But ".join(each.sentence(kind) for each in self.moved)

    def as_json(self) -> list[dict[str, Any]]:
        """Return them in plain types."""
        return [
            {
                "name": each.name,
                "before": each.before,
                "value": each.fitted.value,
                "lower": each.fitted.lower,
                "upper": each.fitted.upper,
                "like": list(each.like),
            }
            for each in self.moved
        ]


def moved_parameters(case: Case) -> MovedParameters | None:
    """Return the parameters of the file's own effects that the recording wants elsewhere; None where it holds."""
    if not case.explained or case.given.holds(case.best.errors):
        return None
    own = {each.name: find_effect(each.name, "effects") for each in case.valve.effect}
    moved = excluded_parameters(case.valve, case.best.fit, {**case.library, **own})
    return MovedParameters(moved) if moved else None


def excluded_parameters(file: ValveFile, fit: Fit, library: Mapping[str, Effect]) -> tuple[Moved, ...]:
    """Return the parameters of a file's effects whose value the fit excludes.

    Args:
        file: where the fit began.
        fit: with intervals.
        library: all effects by name, the file's too.
    """
    there = {each.name for each in fit.valve.effect}
    return tuple(
        Moved(f"{table.name}.{key}", before, found, _like(table.name, library, there))
        for table in file.effect
        if table.name in library and not library[table.name].by_setpoint
        for key, before in table.parameters.items()
        if (found := fit.parameters.get(f"{table.name}.{key}")) and _excluded(before, found)
    )


def _excluded(before: float, found: Fitted) -> bool:
    outside = not found.lower <= before <= found.upper
    return outside and abs(found.value - before) > DIAGNOSIS.moved * abs(before)


def _like(name: str, library: Mapping[str, Effect], there: set[str]) -> tuple[str, ...]:
    same = algebraic_class(name, library)
    others = [each for each in library if each not in there]
    return tuple(each for each in others if each in same or distinguishing_record(name, each, library))
