"""The race of the effects: held-out error with each added, against the floor; and how the error fell step by step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.report.charts import EXTENDED, INK, MEASURED, OPEN, QUIET, Figure, axis, layout, marked
from workbench.report.series import significant

OUTCOMES = {
    "added": (EXTENDED, "circle"),
    "as good": (OPEN, "diamond"),
    "accepted": (MEASURED, "square"),
    "refused": ("#9aa4b1", "x-thin-open"),
}
ORDER = list(OUTCOMES)


@dataclass(frozen=True, slots=True)
class Tried:
    """An effect and what came of it; errors, m, None where it could not be fitted."""

    name: str
    test_m: float | None
    train_m: float | None
    fall_errors: float | None
    """By how many standard errors the held-out error falls."""
    evidence: float | None
    outcome: str
    why: str

    @property
    def order(self) -> tuple[int, float]:
        """Added first, then as good, accepted, refused; inside these by held-out error."""
        return ORDER.index(self.outcome), np.inf if self.test_m is None else self.test_m


def ranking(tried: Sequence[Tried], before_m: float, floor_m: float) -> Figure:
    """Return the held-out errors on a logarithmic scale."""
    names = [each.name for each in tried]
    errors_m = [before_m, floor_m, *(each.test_m for each in tried if each.test_m is not None)]
    traces = []
    for outcome, (colour, symbol) in OUTCOMES.items():
        part = [each for each in tried if each.outcome == outcome and each.test_m is not None]
        if part:
            errors = np.array([each.test_m for each in part], np.float64)
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "orientation": "h",
                    "name": outcome,
                    "x": significant(1e3 * errors),
                    "y": [each.name for each in part],
                    "customdata": significant(errors),
                    "marker": {"color": colour, "symbol": symbol, "size": 10, "line": {"width": 2, "color": colour}},
                    "hovertemplate": "%{y}: %{x:.4~g} mm (%{customdata:.4~g} m)<extra>" + outcome + "</extra>",
                }
            )
    return {
        "data": traces,
        "layout": layout(
            xaxis=axis("held-out error, rms, mm", type="log", **_ticks([1e3 * each for each in errors_m])),
            yaxis=axis("", categoryorder="array", categoryarray=names[::-1], range=[-0.7, len(names) - 0.3]),
            shapes=[marked(1e3 * floor_m, INK), marked(1e3 * before_m, QUIET, "dot")],
            showlegend=True,
        ),
    }


def _ticks(values: Sequence[float]) -> Figure:
    """Return ticks at 1, 2 and 5 of the decades that the values span."""
    positive = [each for each in values if each > 0.0]
    low, high = 0.8 * min(positive), 1.25 * max(positive)
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
    shown = [float(f"{each:.3g}") for each in ticks if low <= each <= high]
    return {"tickvals": shown, "ticktext": [f"{each:g}" for each in shown], "range": np.log10([low, high]).tolist()}


def fall(stages: Sequence[tuple[str, float, float]], floor_m: float) -> Figure:
    """Return the errors of the models in the order they were made: name, fitted and held-out rms, m."""
    names = [name for name, _, _ in stages]
    traces = []
    for label, column, colour in (("fitted", 1, "#c3cad3"), ("held out", 2, EXTENDED)):
        errors = np.array([stage[column] for stage in stages], np.float64)
        traces.append(
            {
                "type": "bar",
                "name": label,
                "x": names,
                "y": significant(1e3 * errors),
                "customdata": significant(errors),
                "text": [f"{1e3 * each:.3g}" for each in errors.tolist()],
                "textposition": "outside",
                "cliponaxis": False,
                "marker": {"color": colour},
                "hovertemplate": "%{y:.4~g} mm (%{customdata:.4~g} m)<extra>%{x}, " + label + "</extra>",
            }
        )
    floor = {
        "type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 1e3 * floor_m, "y1": 1e3 * floor_m,
        "line": {"color": INK, "width": 1.5, "dash": "dash"},
    }  # fmt: skip
    return {
        "data": traces,
        "layout": layout(
            xaxis=axis(""), yaxis=axis("error, rms, mm", rangemode="tozero"), shapes=[floor],
            bargap=0.45,
        ),
    }  # fmt: skip
