"""Which opening a signal asks for: the characteristic that a daemon's file names."""

from typing import Protocol

from config.travel_table import TravelTable
from positioner.control.travel.equal_percentage import EqualPercentage
from positioner.control.travel.linear import Linear
from positioner.control.travel.polygon import Polygon
from positioner.control.travel.quick_opening import QuickOpening


class Characteristic(Protocol):
    """Rises from signal to opening, both 0 to 1, and is undone."""

    def opening(self, signal: float, /) -> float:
        """Return h of a signal s."""
        ...

    def signal(self, opening: float, /) -> float:
        """Return s of an opening h."""
        ...


def characteristic_of(table: TravelTable) -> Characteristic:
    """Return the characteristic of table `[travel]`."""
    match table.characteristic:
        case "equal_percentage":
            return EqualPercentage(table.rangeability)
        case "quick_opening":
            return QuickOpening(table.rangeability)
        case "polygon":
            return Polygon(table.polygon)
        case "linear":
            return Linear()
