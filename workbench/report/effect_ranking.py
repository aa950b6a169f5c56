"""The ranking of the effects: held-out error with each added, against the floor; and how the error fell by steps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.results.drawing import decade_ticks
from workbench.report.charts import EXTENDED, INK, MEASURED, OPEN, QUIET, Figure, axis, layout, mark_line
from workbench.report.display_units import Quantity
from workbench.report.plot_series import significant
from workbench.select.candidate_table import Tried

OUTCOMES = {
    "added": (EXTENDED, "circle"),
    "as good": (OPEN, "diamond"),
    "accepted": (MEASURED, "square"),
    "refused": ("#9aa4b1", "x-thin-open"),
}
ORDER = list(OUTCOMES)


@dataclass(frozen=True, slots=True)
class RankedEffect:
    """An effect tried, and what came of it."""

    tried: Tried
    outcome: str

    @property
    def order(self) -> tuple[int, float]:
        """Added first, then as good, accepted, refused; inside these by held-out error."""
        return ORDER.index(self.outcome), np.inf if self.tried.test is None else self.tried.test

    @property
    def said(self) -> str:
        """The outcome, and why it is no better."""
        return f"{self.outcome}: {self.tried.rejection_reason}" if self.tried.rejection_reason else self.outcome


def ranking(tried: Sequence[RankedEffect], before: float, floor: float | None, of: Quantity) -> Figure:
    """Return the held-out errors on a logarithmic scale."""
    names = [each.tried.name for each in tried]
    lines = [(before, QUIET, "dot")] if floor is None else [(before, QUIET, "dot"), (floor, INK, "dash")]
    shown = [of.factor * each for each in (*(value for value, _, _ in lines), *_errors(tried))]
    traces = []
    for outcome, (colour, symbol) in OUTCOMES.items():
        part = [each for each in tried if each.outcome == outcome and each.tried.test is not None]
        if part:
            errors = np.array(_errors(part), np.float64)
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "orientation": "h",
                    "name": outcome,
                    "x": significant(of.factor * errors),
                    "y": [each.tried.name for each in part],
                    "customdata": significant(errors),
                    "marker": {"color": colour, "symbol": symbol, "size": 10, "line": {"width": 2, "color": colour}},
                    "hovertemplate": f"%{{y}}: %{{x:.4~g}} {of.unit} (%{{customdata:.4~g}} {of.si})"
                    f"<extra>{outcome}</extra>",
                }
            )
    return {
        "data": traces,
        "layout": layout(
            xaxis=axis(f"held-out error, rms, {of.unit}", type="log", **log_ticks(shown)),
            yaxis=axis("", categoryorder="array", categoryarray=names[::-1], range=[-0.7, len(names) - 0.3]),
            shapes=[mark_line(of.factor * value, colour, dash) for value, colour, dash in lines],
            showlegend=True,
        ),
    }


def _errors(tried: Sequence[RankedEffect]) -> list[float]:
    return [each.tried.test for each in tried if each.tried.test is not None]


def log_ticks(values: Sequence[float]) -> Figure:
    """Return ends and ticks of a logarithmic axis about values."""
    if (span := decade_ticks(values)) is None:
        return {}
    low, high, shown = span
    return {"tickvals": shown, "ticktext": [f"{each:g}" for each in shown], "range": np.log10([low, high]).tolist()}


def error_reduction(stages: Sequence[tuple[str, float, float]], floor: float | None, of: Quantity) -> Figure:
    """Return the errors of the models in the order they were made, on a logarithmic scale.

    Args:
        stages: name, fitted and held-out rms, SI.
        floor: what no model undercuts, SI; None where it is not known.
        of: the quantity of the errors.
    """
    names = [name for name, _, _ in stages]
    levels = [] if floor is None else [floor]
    shown = [of.factor * each for each in (*levels, *(error for stage in stages for error in stage[1:]))]
    traces = []
    kinds = (("fitted", "#9aa4b1", "diamond-open", "dot"), ("held out", EXTENDED, "circle", "solid"))
    for column, (label, colour, symbol, dash) in enumerate(kinds, start=1):
        errors = np.array([stage[column] for stage in stages], np.float64)
        traces.append(
            {
                "type": "scatter",
                "mode": "lines+markers+text",
                "name": label,
                "x": names,
                "y": significant(of.factor * errors),
                "customdata": significant(errors),
                "text": [f"{of.factor * each:.3g}" if label == "held out" else "" for each in errors.tolist()],
                "textposition": "top right",
                "cliponaxis": False,
                "line": {"color": colour, "width": 1.4, "dash": dash},
                "marker": {"color": colour, "symbol": symbol, "size": 10},
                "hovertemplate": f"%{{y:.4~g}} {of.unit} (%{{customdata:.4~g}} {of.si})<extra>%{{x}}, {label}</extra>",
            }
        )
    return {
        "data": traces,
        "layout": layout(
            xaxis=axis("", range=[-0.4, len(names) - 0.6]),
            yaxis=axis(f"error, rms, {of.unit}", type="log", **log_ticks(shown)),
            shapes=[_across(of.factor * each) for each in levels],
        ),
    }


def _across(y: float) -> Figure:
    return {
        "type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": y, "y1": y,
        "line": {"color": INK, "width": 1.5, "dash": "dash"},
    }  # fmt: skip
