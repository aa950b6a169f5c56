"""A quick-opening characteristic: an equal-percentage one backwards, steep where that is flat.

h = ln(1 + (R - 1) s) / ln R          s = (R^h - 1) / (R - 1)
"""

from dataclasses import dataclass

from positioner.control.travel.equal_percentage import EqualPercentage


@dataclass(frozen=True, slots=True)
class QuickOpening:
    """By its rangeability R."""

    rangeability: float

    def opening(self, signal: float) -> float:
        """Return h of a signal s, 0 to 1."""
        return EqualPercentage(self.rangeability).signal(signal)

    def signal(self, opening: float) -> float:
        """Return s of an opening h, 0 to 1."""
        return EqualPercentage(self.rangeability).opening(opening)
