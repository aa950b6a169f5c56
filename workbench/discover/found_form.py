"""A form that was found: its parameters, where the recordings show it, what it adds, and its file."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from config.results.result import Brief
from sim.effect import Effect
from workbench.data.held_out import Split
from workbench.discover.added_force import AddedForce, added_force, variable_range
from workbench.discover.form_file import form_text
from workbench.discover.grammar import Form
from workbench.select.effect_candidates import EvaluatedModel

SHOWN_TIME_CONSTANTS = 5.0
"""Time constants over which a picture shows what fades."""


@dataclass(frozen=True, slots=True, repr=False)
class FoundForm(Brief):
    """A form that explains the recordings: its parameters, and over which range of its variable they show it."""

    form: Form
    model: EvaluatedModel
    values: Mapping[str, float]
    span: tuple[float, float]
    added: AddedForce

    @classmethod
    def of(cls, form: Form, effect: Effect, model: EvaluatedModel, split: Split) -> Self:
        """Return the form that a model ends with."""
        fit = model.fit
        table = fit.valve.effect[-1]
        values = {key: float(table.parameters[key]) for key in effect.parameters}
        span = variable_range(form, fit, split)
        if form.variable.name == "past":
            span = (0.0, SHOWN_TIME_CONSTANTS * values["time_constant_s"])
        return cls(form, model, values, span, added_force(form, effect, values, span, fit))

    def text(self, source: str) -> str:
        """Return it as an effect's file; `source` says what it was found in."""
        errors, length = self.model.errors, self.model.fit.kind.length
        values = ", ".join(f"{key} = {value:.6g}" for key, value in self.values.items())
        remarks = (
            "",
            f"Found by `positioner discover` in {source}: {values}. Beside it the valve leaves "
            f"{length.said(errors.train_rmse_m, '.4g')} rms of what was fitted and "
            f"{length.said(errors.test_rmse_m, '.4g')} of what was held out.",
            f"The recordings show it {self.shown}; beyond, nothing is known of it.",
        )
        return form_text(self.form, self.values, remarks)

    @property
    def shown(self) -> str:
        """Over which range the recordings show it, in words."""
        variable, (low, high) = self.form.variable, self.span
        if variable.name in {"", "direction"}:
            return "as far as the stem went"
        return f"over {variable.words} from {low:.4g} to {high:.4g} {self.added.unit}"
