"""Cut-offs: near an end of the travel the stem is not positioned, but pressed onto its stop.

    r < r_l:  p = p_min    until r >= r_l + h
    r > r_h:  p = p_max    until r <= r_h - h

r reference, r_l and r_h the cut-offs low and high, h hysteresis, m; p pressure, p_min and p_max the least and the most
allowed, Pa. A plug held a hair's breadth off its seat leaks, and what leaks past it cuts the seat; pressed onto it by
all the spring gives, it is tight. Friction cannot keep it off.
"""

from dataclasses import dataclass
from math import inf

LOW, WITHIN, HIGH = -1, 0, 1
"""The stop onto which the stem is pressed; none while it is positioned."""


@dataclass(frozen=True, slots=True)
class Cutoffs:
    """Where the stem is no longer positioned, m; by default nowhere."""

    low_m: float = -inf
    high_m: float = inf
    hysteresis_m: float = 0.0

    def after(self, before: int, reference_m: float) -> int:
        """Return onto which stop a reference, m, presses the stem, and what it did before.

        >>> cutoffs = Cutoffs(low_m=0.0004, hysteresis_m=0.0002)
        >>> cutoffs.after(WITHIN, 0.0005), cutoffs.after(LOW, 0.0005), cutoffs.after(LOW, 0.0007)
        (0, -1, 0)
        """
        if reference_m < self.low_m + self.hysteresis_m * (before == LOW):
            return LOW
        return HIGH if reference_m > self.high_m - self.hysteresis_m * (before == HIGH) else WITHIN


def sent_to_m(cut_off: int, reference_m: float, stem_m: float) -> float:
    """Return where a stem is sent to, m: where it is pressed onto a stop, of all places up to that the nearest."""
    if cut_off == LOW:
        return min(reference_m, stem_m)
    return max(reference_m, stem_m) if cut_off == HIGH else reference_m
