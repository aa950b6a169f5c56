"""The units that a person reads a valve in; inside, all is SI."""

import math
from dataclasses import dataclass, field

NO_NUMBER = "–"
"""Shown where there is no number."""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: how many of it are 1 SI unit, and to how many places it is read."""

    name: str
    per_si: float
    places: int

    def fine(self, value_si: float) -> str:
        """Return a value with its unit to four figures, however small it is.

        >>> LENGTHS["mm"].fine(4.8736e-05)
        '0.04874 mm'
        """
        return f"{self.fine_number(value_si)} {self.name}"

    def fine_number(self, value_si: float) -> str:
        """Return the same without its unit."""
        return f"{self.per_si * value_si:.4g}" if math.isfinite(value_si) else NO_NUMBER

    def text(self, value_si: float) -> str:
        """Return a value with its unit.

        >>> Unit("bar", 1e-5, 3).text(44126.0), Unit("bar", 1e-5, 3).text(math.nan)
        ('0.441 bar', '– bar')
        """
        return f"{self.number(value_si)} {self.name}"

    def number(self, value_si: float) -> str:
        """Return a value without its unit; what rounds to nothing has no sign, which would come and go with the noise.

        >>> Unit("bar", 1e-5, 3).number(-20.0), Unit("bar", 1e-5, 3).number(-60.0)
        ('0.000', '-0.001')
        """
        return f"{self.per_si * value_si:z.{self.places}f}" if math.isfinite(value_si) else NO_NUMBER


PRESSURES = {each.name: each for each in (Unit("bar", 1e-5, 3), Unit("kPa", 1e-3, 1), Unit("psi", 1 / 6894.757, 2))}
LENGTHS = {each.name: each for each in (Unit("mm", 1e3, 2), Unit("in", 1 / 0.0254, 3))}
DEGREES = Unit("deg", math.degrees(1.0), 2)
"""Of a valve that turns, in the place of a length."""
PERCENT = "%"
"""Positions as a part of the stroke."""
POSITIONS = (PERCENT, *LENGTHS)


@dataclass(slots=True)
class Units:
    """What a person has chosen; of a valve whose stroke is not known, positions are in mm in place of %."""

    position: str = PERCENT
    pressure: Unit = field(default_factory=lambda: PRESSURES["bar"])

    def position_unit(self, stroke_m: float, *, turns: bool = False) -> Unit:
        """Return the unit of positions in m; in rad of a valve that turns."""
        if self.position == PERCENT and math.isfinite(stroke_m):
            return Unit(PERCENT, 100 / stroke_m, 2)
        return self.length_unit(turns=turns)

    def length_unit(self, *, turns: bool = False) -> Unit:
        """Return the unit of lengths that are no positions."""
        return DEGREES if turns else LENGTHS.get(self.position, LENGTHS["mm"])

    def as_chosen(self, factor: float, name: str) -> tuple[float, str]:
        """Return the factor from SI and the name of a unit, those of a pressure or a length as chosen.

        >>> Units(pressure=PRESSURES["psi"]).as_chosen(1e-3, "kPa/s")[1], Units().as_chosen(1e-3, "N/mm")
        ('psi/s', (0.001, 'N/mm'))
        """
        plain, per, rest = name.partition("/")
        chosen = {"kPa": self.pressure, "mm": self.length_unit()}.get(plain)
        return (factor, name) if chosen is None else (chosen.per_si, f"{chosen.name}{per}{rest}")

    def choose_pressure(self, name: str) -> None:
        """Take a pressure's unit by its name."""
        self.pressure = PRESSURES[name]
