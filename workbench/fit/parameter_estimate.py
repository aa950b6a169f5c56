"""A fitted parameter with its interval, and parameters as a table, as columns and as a figure."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

from config.drive import Kind
from config.results.block import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Fitted:
    """A parameter with its standard deviation and 95 % interval, in its own unit."""

    value: float
    std: float
    lower: float
    upper: float
    at_bound: bool
    """It lies at the end of its physical range."""
    physical: bool
    """False if the recording wants it beyond that end."""

    @property
    def remark(self) -> str:
        """What is wrong with it; empty if nothing is."""
        if not self.physical:
            return "not physical: the fit takes it beyond its range"
        if not (isfinite(self.lower) and isfinite(self.upper)):
            return "not determined by this recording"
        return "at the end of its range" if self.at_bound else ""


def parameters_json(parameters: Mapping[str, Fitted]) -> dict[str, dict[str, float | bool | None]]:
    """Return what was fitted; a bound that the recording leaves open is not finite: null, once it is written."""
    return {
        name: {key: getattr(each, key) for key in ("value", "std", "lower", "upper", "physical")}
        for name, each in parameters.items()
    }


def parameter_table(parameters: Mapping[str, Fitted], kind: Kind, title: str = "") -> Table:
    """Return the parameters with their intervals; units are in the names."""
    rows = [
        (kind.text(name), f"{each.value:.6g}", f"{each.std:.2g}", f"{each.lower:.6g}", f"{each.upper:.6g}", each.remark)
        for name, each in parameters.items()
    ]
    return Table(("parameter", "value", "std", "95 % from", "to", ""), rows, title)


def parameter_columns(parameters: Mapping[str, Fitted]) -> dict[str, list[object]]:
    """Return the parameters as columns, a row each."""
    columns: dict[str, list[object]] = {"parameter": list(parameters)}
    for name in ("value", "std", "lower", "upper", "at_bound", "physical"):
        columns[name] = [getattr(each, name) for each in parameters.values()]
    return columns


def draw_parameters(parameters: Mapping[str, Fitted], kind: Kind) -> "Figure":
    """Draw the 95 % intervals in per cent of the values."""
    from config.results.drawing import BETTER, FAINT, Interval, intervals

    shown = [
        Interval(
            f"{kind.text(name)} = {each.value:.4g}",
            100.0,
            100.0 * (1.0 + (each.lower - each.value) / abs(each.value)),
            100.0 * (1.0 + (each.upper - each.value) / abs(each.value)),
            FAINT if each.remark else BETTER,
        )
        for name, each in parameters.items()
        if each.value
    ]
    return intervals(shown, "95 % interval, % of the value")[0]
