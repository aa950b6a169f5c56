"""Whether the measured pressure is what drives the stem: what the same valve leaves by its command instead.

A transmitter that is noisy, lags, stands still, is cut off, or is of another line drives a simulated stem elsewhere;
for that something "is missing that the library does not have". So where a diagnosis by the measured pressure explains
nothing, its best model is fitted once more by the command. Where that leaves less, by two standard errors of all blocks
and an evidence of 10 in independent samples, the command is the better witness, and that is said.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from config.drive import Kind
from workbench.diagnosis.doubt import Case, Doubt
from workbench.diagnosis.measured_pressure import driven_otherwise
from workbench.select.effect_candidates import EvaluatedModel, model_json, outdoes


@dataclass(frozen=True, slots=True, repr=False)
class ByCommand(Doubt):
    """A model that by the measured pressure leaves more than by the command."""

    key: ClassVar[str] = "by_command"

    by_pressure_rmse_m: float
    """Held out."""
    model: EvaluatedModel
    """By the command."""

    def sentence(self, kind: Kind) -> str:
        """Say so, and what to do."""
        length, word = kind.length, kind.command.word
        other_m, here_m = length.number(self.model.errors.test_rmse_m), length.said(self.by_pressure_rmse_m)
        return kind.text(
            f"driven by the command, the same valve leaves a held-out error of {other_m} in place of {here_m}. "
            f"The measured {word} is not what drives the stem: its transmitter is noisy, slow or stuck, or sits on "
            "another line. Diagnose by the command"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the model by the command in plain types."""
        return model_json(self.model)


def by_command(case: Case) -> ByCommand | None:
    """Return what the best model by the measured pressure is by the command; None where it explains, or does as well.

    Nor is it asked of a set point, which is no pressure.
    """
    best = case.best
    if case.doubts or not best.fit.from_pressure or best.explained or case.parts.train.record.by_setpoint:
        return None
    model = driven_otherwise(case)
    return ByCommand(best.errors.test_rmse_m, model) if outdoes(model, best) else None
