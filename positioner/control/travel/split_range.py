"""Split range: the part of the DCS's signal over which this valve goes from closed to open.

    s = (w - w_closed) / (w_open - w_closed)          held within 0 to 1

w signal as written, 0 to 1. w_open below w_closed: the valve opens as the signal falls.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SplitRange:
    """The signals at which the valve is closed and open."""

    closed: float = 0.0
    open: float = 1.0

    def share(self, signal: float) -> float:
        """Return s of a signal w.

        >>> SplitRange(0.5, 1.0).share(0.75), SplitRange(0.5, 1.0).share(0.2), SplitRange(0.5, 0.0).share(0.125)
        (0.5, 0.0, 0.75)
        """
        return min(max((signal - self.closed) / (self.open - self.closed), 0.0), 1.0)

    def signal(self, share: float) -> float:
        """Return the signal w that asks for s."""
        return self.closed * (1.0 - share) + self.open * share
