"""What a test on the valve comes to: figures with their uncertainty, verdicts by their codes, a picture."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, floor, log10, radians
from typing import TYPE_CHECKING, Self

from config.codes import ValveTestVerdict
from config.drive import ROTARY, Kind
from config.recording import Column
from config.results.block import Block, Table
from config.results.result import Result
from positioner.response.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

TURNED = {"m": "rad", "m/s": "rad/s", "m/Pa": "rad/Pa", "Pa/m": "Pa/rad", "N": "N m", "N/m": "N m/rad"}
"""Units of a valve that turns, by those of one with a stem."""
SHOWN = {
    "rad": (degrees(1.0), "deg"),
    "rad/s": (degrees(1.0), "deg/s"),
    "rad/Pa": (1e3 * degrees(1.0), "deg/kPa"),
    "Pa/rad": (1e-3 * radians(1.0), "kPa/deg"),
    "N m/rad": (radians(1.0), "N m/deg"),
    "m": (1e3, "mm"),
    "Pa": (1e-3, "kPa"),
    "Pa/m": (1e-6, "kPa/mm"),
    "m/Pa": (1e6, "mm/kPa"),
    "Pa/s": (1e-3, "kPa/s"),
    "1": (100.0, "%"),
    "m/s": (1e3, "mm/s"),
}
"""Units as they are printed, of those that SI has inside; others are printed as they are."""


def digits(plus_minus: float) -> int:
    """Return the decimal places that a +- leaves of its figure: two digits of it.

    >>> digits(0.045), digits(47.0), digits(3200.0)
    (3, 0, -2)
    """
    return 1 - floor(log10(plus_minus))


def round_to(value: float, plus_minus: float) -> float:
    """Return a value that has no +- of its own, to the first digit of the +- beside it; without one to three digits.

    >>> round_to(101.6, 0.05), round_to(41.2345, 20.0), round_to(0.43714, 0.0), round_to(12345.6, 0.0)
    (101.6, 41.0, 0.437, 12346.0)
    """
    two = digits(abs(value)) if value else 0
    return round(value, max(two, digits(plus_minus) - 1) if plus_minus else max(0, two + 1))


@dataclass(frozen=True, slots=True)
class Quantity:
    """A figure of a test: what it is called, its SI unit, its value; `expected` is what it should be, where known."""

    name: str
    text: str
    unit: str
    figure: Figure
    expected: float | None = None

    @property
    def own_name(self) -> str:
        """What it is called in files: by the units of what it was measured on.

        >>> Quantity("travel_m", "travel", "rad", Figure(1.57)).own_name
        'travel_rad'
        """
        return ROTARY.own(self.name) if self.unit in TURNED.values() else self.name

    @property
    def shown(self) -> str:
        """The value with its +- in the unit people use, or why there is none."""
        if self.figure.value is None:
            return f"cannot be determined: {self.figure.reason}"
        scale, unit = SHOWN.get(self.unit, (1.0, self.unit))
        value, error = scale * self.figure.value, scale * (self.figure.plus_minus or 0.0)
        if error == 0.0:
            return f"{round_to(value, 0.0):.10g} {unit}"
        places = digits(error)
        value, error = round(value, places), round(error, places)
        return f"{value:.{max(0, places)}f} ± {error:.{max(0, places)}f} {unit}"

    @property
    def shown_expected(self) -> str:
        """What it should be in the same unit, to the first digit of the +- beside it; empty where nobody has said."""
        if self.expected is None:
            return ""
        scale, unit = SHOWN.get(self.unit, (1.0, self.unit))
        value, error = scale * self.expected, scale * (self.figure.plus_minus or 0.0)
        return f"{round_to(value, error):.10g} {unit}"


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of the picture."""

    name: str
    x: Column
    y: Column
    points: bool = False


@dataclass(frozen=True, slots=True)
class Picture:
    """What is drawn of a test: curves over one axis, what the axes are."""

    x: str
    y: str
    curves: tuple[Curve, ...]

    @classmethod
    def of_travel(cls, kind: Kind, curves: Iterable[Curve]) -> Self:
        """Return the picture of travels, m, over commands, Pa, in the units that people read."""
        command, length = kind.command.read, kind.length
        scaled = (replace(each, x=command.factor * each.x, y=length.factor * each.y) for each in curves)
        return cls(f"command, {command.unit}", f"travel, {length.unit}", tuple(scaled))

    def draw(self, axes: "Axes") -> None:
        """Draw the curves on axes of matplotlib."""
        from config.results.drawing import BETTER, MEASURED, MODEL, QUIET, legend

        for curve, colour in zip(self.curves, (MEASURED, MODEL, BETTER, QUIET) * len(self.curves), strict=False):
            style = {"marker": ".", "ls": "none", "ms": 2.0} if curve.points else {"lw": 1.1}
            axes.plot(curve.x, curve.y, color=colour, label=curve.name, **style)
        axes.set_xlabel(self.x)
        axes.set_ylabel(self.y)
        legend(axes)


@dataclass(frozen=True, slots=True, repr=False)
class Outcome(Result):
    """The outcome of one test of one valve; SI units."""

    test: str
    valve: str
    quantities: tuple[Quantity, ...]
    verdicts: tuple[ValveTestVerdict, ...]
    notes: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    picture: Picture | None = field(default=None, compare=False)

    def of(self, kind: Kind) -> Self:
        """Return it in the units of the valve that it was measured on."""
        if not kind.turns:
            return self
        turned = (replace(each, unit=TURNED.get(each.unit, each.unit)) for each in self.quantities)
        return replace(self, quantities=tuple(turned))

    @property
    def passed(self) -> bool:
        """Whether the verdict is that it passed, and nothing else."""
        return self.verdicts == (ValveTestVerdict.PASSED,)

    def figure(self, name: str) -> Figure:
        """Return a figure by its name.

        Raises:
            KeyError: the test has none of that name.
        """
        return next(each.figure for each in self.quantities if each.name == name)

    @property
    def said(self) -> str:
        """The verdicts in words."""
        return "; ".join(each.text for each in self.verdicts)

    def blocks(self) -> Sequence[Block]:
        """Say the verdict, the figures, and what else was noted."""
        expected = any(each.expected is not None for each in self.quantities)
        headings = ("", "measured ", *(("expected ",) if expected else ()))
        rows = [
            (each.text, each.shown, *((each.shown_expected,) if expected else ()))
            for each in self.quantities
            if each.figure.value is not None
        ]
        missing = [f"- {each.text}: {each.shown}" for each in self.quantities if each.figure.value is None]
        return [
            f"{self.test} of {self.valve}: {self.said}",
            *([Table(headings, rows)] if rows else []),
            *missing,
            *self.tables,
            *(f"note: {each}" for each in self.notes),
        ]

    def frame_columns(self) -> Mapping[str, list[object]]:
        """Return a row a figure."""
        return {
            "name": [each.own_name for each in self.quantities],
            "unit": [each.unit for each in self.quantities],
            "value": [each.figure.value for each in self.quantities],
            "plus_minus": [each.figure.plus_minus for each in self.quantities],
            "reason": [each.figure.reason for each in self.quantities],
        }

    def as_json(self) -> dict[str, object]:
        """Return everything but the picture as plain values; null for what cannot be determined."""
        return {
            "test": self.test,
            "valve": self.valve,
            "verdicts": [{"code": int(each), "name": each.name, "text": each.text} for each in self.verdicts],
            "passed": self.passed,
            "figures": {
                each.own_name: {
                    "text": each.text,
                    "unit": each.unit,
                    "value": each.figure.value,
                    "plus_minus": each.figure.plus_minus,
                    "reason": each.figure.reason,
                    "expected": each.expected,
                }
                for each in self.quantities
            },
            "notes": list(self.notes),
        }

    def plot(self) -> "Drawing":
        """Draw the picture of the test.

        Raises:
            ValueError: it has none.
        """
        from config.results.drawing import panels

        if self.picture is None:
            raise ValueError(f"the {self.test} has no picture")
        figure, (axes,) = panels({self.picture.y: 5.0}, self.picture.x)
        self.picture.draw(axes)
        return figure
