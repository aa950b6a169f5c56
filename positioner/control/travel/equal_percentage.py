"""An equal-percentage characteristic: equal steps of the signal change the opening by equal parts of what it is.

    h = (R^s - 1) / (R - 1)          s = ln(1 + (R - 1) h) / ln R

s signal, h opening, 0 to 1; R rangeability. R^(s - 1), the inherent characteristic of a trim, is 1/R at s = 0 and never
shuts; this is the same curve moved so that it does.
"""

from dataclasses import dataclass
from math import log, log1p


@dataclass(frozen=True, slots=True)
class EqualPercentage:
    """By its rangeability R."""

    rangeability: float

    def opening(self, signal: float) -> float:
        """Return h of a signal s, 0 to 1.

        >>> round(EqualPercentage(49.0).opening(0.5), 12)
        0.125
        """
        return float(self.rangeability**signal - 1.0) / (self.rangeability - 1.0)

    def signal(self, opening: float) -> float:
        """Return s of an opening h, 0 to 1.

        >>> round(EqualPercentage(49.0).signal(0.125), 12)
        0.5
        """
        return min(log1p((self.rangeability - 1.0) * opening) / log(self.rangeability), 1.0)
