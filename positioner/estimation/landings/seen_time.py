"""The time for which a stem was seen: what is learnt from time must not count what nobody saw.

    t' = t - sum over gaps (Δt - Δ)        Δ the usual interval between samples, a gap Δt > 3 Δ

An outage of the replies, a daemon that stood still: what happened meanwhile, and when, nobody knows. So the clock
stands but for one interval, and a stem that came to rest in the dark has taken no longer than it was watched.
"""

GAP_USUAL_INTERVALS = 3.0
"""Usual intervals: a sample or two that are lost are none."""
POOLED, LENGTHENED = 0.1, 1.25
"""Weight of a new interval in the usual one; factor on that with each gap: a loop may have become slower."""


class SeenTime:
    """The clock of what was seen."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._usual_s: float | None = None
        self._unseen_s = 0.0

    def at(self, time_s: float) -> float:
        """Return what it shows at a sample, s."""
        if self._last_s is not None:
            interval_s = time_s - self._last_s
            if self._usual_s is None:
                self._usual_s = interval_s
            elif interval_s > GAP_USUAL_INTERVALS * self._usual_s:
                self._unseen_s += interval_s - self._usual_s
                self._usual_s *= LENGTHENED
            else:
                self._usual_s += POOLED * (interval_s - self._usual_s)
        self._last_s = time_s
        return time_s - self._unseen_s
