"""What a forward selection has tried: tables, columns, JSON and a figure; by simulation in m, by forces in N."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


METRES, NEWTONS = lengths(VALVE), ErrorUnit(VALVE.force.read, "_n", VALVE)


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


NOTHING_TRIED = Tried(0, "", None, None, None, None, "")


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
    rows, called = [candidate_json(each, unit) for each in tried], {"name": "effect", "why_not": "rejection_reason"}
    return {called.get(key, key): [row[key] for row in rows] for key in candidate_json(NOTHING_TRIED, unit)}


def candidate_json(each: Tried, unit: ErrorUnit = METRES) -> dict[str, Any]:
    """Return what JSON says of an effect tried; None where it could not be fitted."""
    return {
        "step": each.step,
        "name": each.name,
        f"train_rmse{unit.ending}": each.train,
        f"test_rmse{unit.ending}": each.test,
        f"test_typical_rmse{unit.ending}": each.typical,
        **gain_json(each.gain),
        "accepted": not each.rejection_reason,
        "why_not": each.rejection_reason,
    }


def gain_json(gain: Gain | None) -> dict[str, float | None]:
    """Return what JSON says of how much better an effect, or several, does than the model before."""
    names = {"evidence": "bic", "held_out_gain": "held_out", "held_out_evidence": "held_out_evidence"}
    return {key: None if gain is None else getattr(gain, name) for key, name in names.items()}


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
