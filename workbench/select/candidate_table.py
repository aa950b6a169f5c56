"""What a forward selection has tried, as tables, as columns and as a figure: by simulation in m, by forces in N."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from config.drive import VALVE, Kind, Scale
from config.results.block import Table
from workbench.select.effect_acceptance import Gain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class ErrorUnit:
    """What errors are of: how they are read, the ending of a column's name, and the names of parameters."""

    scale: Scale
    ending: str
    kind: Kind


def lengths(kind: Kind) -> ErrorUnit:
    """Return what errors of a simulated position are of."""
    return ErrorUnit(kind.length, f"_{kind.moved}", kind)


NEWTONS = ErrorUnit(VALVE.force.read, "_n", VALVE)


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
    headings = (
        "effect",
        f"fitted {unit.scale.unit}",
        f"held out {unit.scale.unit}",
        f"typical {unit.scale.unit}",
        "evidence",
        "gain",
    )
    rows = [
        (
            each.name,
            *(_error(value, unit) for value in (each.train, each.test, each.typical)),
            *(("-", "-", "-") if each.gain is None else _gain(each.gain)),
            unit.kind.text(each.rejection_reason) or "accepted",
        )
        for each in tried
    ]
    return Table((*headings, "held-out evidence", ""), rows, title)


def _error(value: float | None, unit: ErrorUnit) -> str:
    return "-" if value is None else f"{unit.scale.factor * value:.4g}"


def _gain(found: Gain) -> tuple[str, str, str]:
    return f"{found.bic:.1f}", f"{found.held_out:.0%}", f"{found.held_out_evidence:.1f}"


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
        "held_out_evidence": [each.gain and each.gain.held_out_evidence for each in tried],
        "accepted": [not each.rejection_reason for each in tried],
        "rejection_reason": [each.rejection_reason for each in tried],
    }


def draw_race(
    tried: Sequence[Tried], chosen: Collection[str], before: float, floor: float | None, unit: ErrorUnit
) -> "Figure":
    """Draw the held-out errors of one step's candidates, against the model before and the floor, SI units."""
    from config.results.drawing import race

    errors = {each.name: unit.scale.factor * each.test for each in tried if each.test is not None}
    marks = {"nothing added": unit.scale.factor * before}
    if floor:
        marks["floor"] = unit.scale.factor * floor
    return race(errors, chosen, marks, f"held-out error with this effect added, {unit.scale.unit} rms")
