"""What a forward selection has tried, as tables, as columns and as a figure: by simulation in m, by forces in N."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from config.results.block import Table
from workbench.select.effect_acceptance import Gain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class ErrorUnit:
    """How errors are told: factor from SI, the unit told, and the ending of a column's name."""

    factor: float
    unit: str
    ending: str


MILLIMETRES = ErrorUnit(1e3, "mm", "_m")
NEWTONS = ErrorUnit(1.0, "N", "_n")


@dataclass(frozen=True, slots=True)
class Tried:
    """An effect tried: rms errors in SI units, None where it could not be fitted; `typical` the median block's."""

    step: int
    name: str
    train: float | None
    test: float | None
    typical: float | None
    gain: Gain | None
    rejection_reason: str


def candidate_table(tried: Sequence[Tried], unit: ErrorUnit, title: str) -> Table:
    """Return a step's candidates in their order."""
    headings = ("effect", f"fitted {unit.unit}", f"held out {unit.unit}", f"typical {unit.unit}", "evidence", "gain")
    rows = [
        (
            each.name,
            *(_error(value, unit) for value in (each.train, each.test, each.typical)),
            *(("-", "-", "-") if each.gain is None else _gain(each.gain)),
            each.rejection_reason or "accepted",
        )
        for each in tried
    ]
    return Table((*headings, "std errors", ""), rows, title)


def _error(value: float | None, unit: ErrorUnit) -> str:
    return "-" if value is None else f"{unit.factor * value:.4g}"


def _gain(found: Gain) -> tuple[str, str, str]:
    return f"{found.bic:.1f}", f"{found.held_out:.0%}", f"{found.standard_errors:.1f}"


def candidate_columns(tried: Sequence[Tried], unit: ErrorUnit) -> dict[str, list[object]]:
    """Return all candidates of all steps as columns, a row each; None where there is no number."""
    return {
        "step": [each.step for each in tried],
        "effect": [each.name for each in tried],
        f"train_rmse{unit.ending}": [each.train for each in tried],
        f"test_rmse{unit.ending}": [each.test for each in tried],
        f"test_typical_rmse{unit.ending}": [each.typical for each in tried],
        "evidence": [each.gain and each.gain.bic for each in tried],
        "held_out_gain": [each.gain and each.gain.held_out for each in tried],
        "held_out_standard_errors": [each.gain and each.gain.standard_errors for each in tried],
        "accepted": [not each.rejection_reason for each in tried],
        "rejection_reason": [each.rejection_reason for each in tried],
    }


def draw_race(
    tried: Sequence[Tried], chosen: Collection[str], before: float, floor: float | None, unit: ErrorUnit
) -> "Figure":
    """Draw the held-out errors of one step's candidates, against the model before and the floor, SI units."""
    from config.results.drawing import race

    errors = {each.name: unit.factor * each.test for each in tried if each.test is not None}
    marks = {"nothing added": unit.factor * before}
    if floor:
        marks["floor"] = unit.factor * floor
    return race(errors, chosen, marks, f"held-out error with this effect added, {unit.unit} rms")
