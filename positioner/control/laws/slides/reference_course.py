"""How the reference comes: does it rest, or will the next one take back what would be corrected now?

A DCS's controller, a ramp or a filter writes a new reference at each of its scans, Δ s. Of such a run of changes
d_1, d_2, ... (the latest first; each at most `scan_s` after the one before) is known

    Δ = the longest of the last intervals,   D = mean abs(d_i),   s_r = the sign of the last three d_i, 0 if they differ

and the reference has come to rest when it has stood for 1.5 Δ. Until then, of an error e = r - x:

    abs(e) <= 3 D                      left alone: the next references may take it back; of references that go to and
                                       fro, e is the least error that the last three have had
    e carried by N = 8 references      left alone: a ramp brings it within the reach of one slide, or back to the stem
    abs(e) <= m/sqrt(12) on a ramp     left alone: single slides leave as much, rms
    e^3 <= 3/2 m^2 T v on a ramp       left alone: two slides would cost more than they save
    else                               corrected as if the reference rested

Two slides leave a ramp of v = D/Δ by m for T, the time until the second is given, and again whenever the error has
come to e, each e/v: a mean square of e^2/3 + m^2 T v/e, which is least where e^3 = 3/2 m^2 T v. By hand, v = 0.13 %/s,
m = 7.5 %, T = 0.5 s: e = 1.8 %, every 14 s.

A ramp may be written more slowly than a DCS scans. Four steps alike, in one direction, each and each interval no more
than twice the least, within a minute of each other, are one, and of its error is left alone what two slides would cost
more than they save, as above.

A ramp followed by slides of a way m, for no shorter one breaks the stem loose, leaves a sawtooth. Slides that land at
the reference leave errors of 0 to m, rms m/sqrt(3), those that land ahead of it by half of m

    -m/2 to m/2,   rms m/sqrt(12)      lead = min(m/2, N D) + v T_a/2

with the same travel: no stem that can only be moved by m comes nearer. N D is as far as N references go, v T_a/2 as far
as the ramp goes on while a slide that takes T_a is half-way. A ramp is taken to go on as far as it has gone since it
turned: from m/2 on no excursion is made for it.
"""

from dataclasses import dataclass
from itertools import accumulate
from math import sqrt
from operator import sub

from positioner.control.laws.slides.slide_bounds import THRESHOLDS


@dataclass(frozen=True, slots=True)
class ReferenceCourse:
    """The last changes of the reference, m, and the intervals between them, s; the latest first."""

    value_m: float
    changed_s: float
    changes_m: tuple[float, ...] = ()
    intervals_s: tuple[float, ...] = ()
    turned_m: float | None = None
    """The reference at which the run turned round last, or began, m; None: it rests."""
    steps: tuple[tuple[float, float], ...] = ()
    """The last changes that came after a rest, m, and the intervals before them, s; the latest first."""

    def after(self, now_s: float, reference_m: float) -> "ReferenceCourse":
        """Return the course with a reference, m, that is in force now; one after a long rest begins a new run."""
        if reference_m == self.value_m:
            return self
        interval_s = now_s - self.changed_s
        if interval_s > THRESHOLDS.scan_s:
            steps = ((reference_m - self.value_m, interval_s), *self.steps)[: THRESHOLDS.steps_alike]
            return ReferenceCourse(reference_m, now_s, steps=steps)
        change_m = reference_m - self.value_m
        turns = self.turned_m is None or (bool(self.changes_m) and change_m * self.changes_m[0] < 0.0)
        return ReferenceCourse(
            reference_m,
            now_s,
            (change_m, *self.changes_m)[: THRESHOLDS.references_kept],
            (interval_s, *self.intervals_s)[: THRESHOLDS.references_kept],
            self.value_m if turns else self.turned_m,
        )

    def rate_m_per_s(self, now_s: float) -> float:
        """Return D/Δ of a run, with the mean interval, or the rate of a ramp in steps, m/s; 0: neither goes on."""
        if not self.rests(now_s):
            return sum(map(abs, self.changes_m)) / sum(self.intervals_s)
        if len(self.steps) < THRESHOLDS.steps_alike:
            return 0.0
        ways_m, intervals_s = zip(*self.steps, strict=True)
        least_m, most_m = sorted((min(ways_m), max(ways_m)), key=abs)
        factor = THRESHOLDS.alike_step_factor
        longest_s = min(factor * min(intervals_s), THRESHOLDS.ramp_step_s)
        alike = 0.0 < most_m / least_m <= factor and max(intervals_s) <= longest_s
        goes_on = now_s - self.changed_s <= THRESHOLDS.overdue * max(intervals_s)
        return abs(sum(ways_m)) / sum(intervals_s) if alike and goes_on else 0.0

    def rests(self, now_s: float) -> bool:
        """Whether no next reference is to be waited for."""
        return not self.intervals_s or now_s - self.changed_s > THRESHOLDS.overdue * max(self.intervals_s)

    @property
    def change_m(self) -> float:
        """D, m: what a change is on average; 0 of a reference that came after a rest."""
        return sum(abs(each) for each in self.changes_m) / len(self.changes_m) if self.changes_m else 0.0

    @property
    def trend(self) -> int:
        """s_r: +1 or -1 while it goes on in one direction."""
        last_m = self.changes_m[: THRESHOLDS.a_trend]
        if len(last_m) < THRESHOLDS.a_trend:
            return 0
        return 1 if min(last_m) > 0.0 else -1 if max(last_m) < 0.0 else 0

    def goes_far(self, way_m: float) -> bool:
        """Whether the run is a ramp that has gone half as far as a slide of way_m, the shortest: it goes on so far."""
        return self.trend != 0 and self.turned_m is not None and abs(self.value_m - self.turned_m) >= 0.5 * way_m

    def lead_m(self, now_s: float, way_m: float, answer_s: float = 0.0) -> float:
        """Return how far ahead of the reference, m, signed, a slide is to land, of at least way_m, in answer_s."""
        if self.rests(now_s):
            return 0.0
        half_m = 0.5 * way_m if self.goes_far(way_m) else min(0.5 * way_m, THRESHOLDS.coming * self.change_m)
        return self.trend * (half_m + 0.5 * answer_s * self.rate_m_per_s(now_s))

    def _lasting_m(self, error_m: float) -> float:
        """Return the least error that the last references had of a stem that is off by an error now, m."""
        errors_m = tuple(accumulate(self.changes_m[: THRESHOLDS.a_trend - 1], sub, initial=error_m))
        return max(0.0, min(errors_m), -max(errors_m))

    def takes_back(self, now_s: float, error_m: float, way_m: float, away_s: float) -> bool:
        """Whether an error r - x, m, is left to the references to come.

        Args:
            now_s: on the clock of the cycle.
            error_m: r - x.
            way_m: the shortest slide that way.
            away_s: for how long the first of two slides leaves the stem away; 0: none was given yet.
        """
        costs_more = abs(error_m) ** 3 <= 1.5 * way_m**2 * away_s * self.rate_m_per_s(now_s)
        if self.rests(now_s):
            return costs_more
        lasting_m = abs(error_m) if self.trend else self._lasting_m(error_m)
        if lasting_m <= THRESHOLDS.taken_back * self.change_m or self.goes_far(way_m):
            return True
        coming_m = THRESHOLDS.coming * self.change_m
        if self.trend * error_m <= 0.0:
            return self.trend != 0 and abs(error_m) <= coming_m
        reached = abs(error_m) + coming_m + abs(self.lead_m(now_s, way_m)) >= way_m
        return costs_more or reached or abs(error_m) <= way_m / sqrt(12.0)
