"""How a valve is used, day by day: looked at once a second, kept for a month.

    opening       histogram of h
    deviation     histogram of |r - h| in automatic, outside S3
    cycle span    histogram of how far the stem goes from one turn to the next
    saturated     in automatic, the command within 1 % of its span of a limit, though the stem is pressed onto no stop
    ends          h where the valve is pressed shut, and where it is pressed open, means
    course        of a stem at rest, by how far it is outside what the identified valve allows under its command:
                  max(|x - (u - p_0) / k| - F_c / k, 0)          k = k_s / A, p_0 offset, F_c as a pressure
    short         command less measured pressure, of a command that stands, share of the span: a leak;
    short, high   the same where the command is in the upper fifth of what the identified valve needs for its travel,
                  or, of one that is not identified, of what its limits allow: the supply
    exhausted     air let out: the sum of the falls of the command over the pressure of the surroundings, in volumes of
                  the actuator

A day is one of UTC.
"""

from bisect import bisect_right
from dataclasses import dataclass
from math import isfinite, nan
from statistics import median
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from config.codes import S3, EndTrend, Mode
from config.loading import Many, Schema
from config.travel import Travel
from positioner.control.controller_memory import Decision
from positioner.control.sample import Sample
from positioner.control.travel.cutoffs import WITHIN
from positioner.daemon.health.travel_accumulator import SPANS

DAY_S = 86_400.0
DAYS = 31
"""That are kept."""
OPENINGS = tuple(each / 20 for each in range(1, 20))
"""Edges between the bins; what lies beyond the ends is counted in the first and the last."""
DEVIATIONS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Upper edges, shares of the stroke; the last bin is beyond."""
NEAR_LIMIT = 0.01
"""Of the span of the command."""
SUPPLY = 0.8
"""Of the pressure that opens the valve, from where a shortage is the supply's."""
RESTS = 0.002
"""Of the stroke, by which a stem that rests may seem to move in a second."""
ENDS = 0.02
"""Of the stroke from its ends: there a stop holds the stem, and no balance."""
SURROUNDINGS_PA = 101_325.0

LAST_DAY = 2_932_896
"""31 December 9999: the last that is a date."""
MOST = 2**53
"""Of what is counted and summed: each up to it is a number of its own."""
Count = Annotated[int, Field(ge=0, le=MOST)]


def _bins(edges: tuple[float, ...]) -> Any:
    """Require a bin on each side of each edge."""
    return Field(min_length=len(edges) + 1, max_length=len(edges) + 1)


class Mean(Schema):
    """A sum and how many."""

    total: Annotated[float, Field(ge=-MOST, le=MOST)] = 0.0
    count: Count = 0

    def with_one(self, value: float) -> "Mean":
        """Return it with a value more."""
        return Mean(total=self.total + value, count=self.count + 1)

    @property
    def value(self) -> float:
        """The mean; NaN of none."""
        return self.total / self.count if self.count else nan


class OperationDay(Schema):
    """One day; counts are seconds, but for the spans, which are turns."""

    day: Annotated[int, Field(ge=0, le=LAST_DAY)]
    """Since 1970, UTC."""
    seconds: Count = 0
    opening: Annotated[Many[Count], _bins(OPENINGS)] = (0,) * (len(OPENINGS) + 1)
    deviation: Annotated[Many[Count], _bins(DEVIATIONS)] = (0,) * (len(DEVIATIONS) + 1)
    span: Annotated[Many[Count], _bins(SPANS)] = (0,) * (len(SPANS) + 1)
    saturated: Count = 0
    away: Mean = Mean()
    """|r - h| in automatic."""
    shut: Mean = Mean()
    opened: Mean = Mean()
    course: Mean = Mean()
    short: Mean = Mean()
    short_high: Mean = Mean()
    exhausted: Annotated[float, Field(ge=0, le=MOST)] = 0.0
    """Volumes."""

    @property
    def saturated_share(self) -> float:
        """Of the seconds; NaN before the first."""
        return self.saturated / self.seconds if self.seconds else nan


class Turned(NamedTuple):
    """What the cycle has counted since the start: spans by bin, and falls of the command, Pa."""

    spans: tuple[int, ...]
    falls_pa: float


@dataclass(frozen=True, slots=True)
class Seen:
    """What was seen a second ago."""

    command_pa: float
    opening: float
    turned: Turned


class Operation:
    """The days, the newest last. Written by the thread that looks once a second; `days` is replaced whole."""

    def __init__(self, travel: Travel, range_pa: tuple[float, float]) -> None:
        self.days: tuple[OperationDay, ...] = ()
        self._travel, self._range_pa = travel, range_pa
        self._before: Seen | None = None

    @property
    def today(self) -> OperationDay:
        """The newest day; an empty one before the first look."""
        return self.days[-1] if self.days else OperationDay(day=0)

    def begin(self, days: tuple[OperationDay, ...]) -> None:
        """Go on with what was kept."""
        self.days = days[-DAYS:]

    def look(self, sample: Sample, decision: Decision, turned: Turned, wall_s: float) -> None:
        """Take what is there now; `wall_s` is the time of day, s since 1970."""
        opening, before = self._travel.opening(sample.position_m), self._before
        if not isfinite(opening):
            return
        self._before = Seen(decision.command_pa, opening, turned)
        number = max(int(wall_s // DAY_S), 0)
        kept = self.days if self.days and self.days[-1].day == number else (*self.days, OperationDay(day=number))
        day = self._entered(kept[-1], sample, decision, opening, before, turned)
        self.days = (*kept[:-1], day)[-DAYS:]

    def _entered(
        self, day: OperationDay, sample: Sample, decision: Decision, opening: float, before: Seen | None, turned: Turned
    ) -> OperationDay:
        low_pa, high_pa = self._range_pa
        span_pa, command_pa = high_pa - low_pa, decision.command_pa
        near_pa = NEAR_LIMIT * span_pa
        changes: dict[str, object] = {
            "seconds": day.seconds + 1,
            "opening": _counted(day.opening, OPENINGS, opening),
        }
        if decision.cut_off != WITHIN:
            shut = (decision.cut_off < WITHIN) != self._travel.closes
            name = "shut" if shut else "opened"
            changes[name] = getattr(day, name).with_one(opening)
        if decision.mode is Mode.AUTOMATIC and decision.state is not S3 and decision.cut_off == WITHIN:
            if not low_pa + near_pa <= command_pa <= high_pa - near_pa:
                changes["saturated"] = day.saturated + 1
            away = abs(self._travel.opening(decision.reference_m) - opening)
            changes |= {"deviation": _counted(day.deviation, DEVIATIONS, away), "away": day.away.with_one(away)}
        if before is not None:
            new = [now - then for now, then in zip(turned.spans, before.turned.spans, strict=True)]
            changes["span"] = tuple(count + more for count, more in zip(day.span, new, strict=True))
            fell_pa = turned.falls_pa - before.turned.falls_pa
            changes["exhausted"] = day.exhausted + max(fell_pa, 0.0) / SURROUNDINGS_PA
            if command_pa == before.command_pa:
                changes |= self._at_rest(day, sample, decision, opening, before)
        return day.model_copy(update=changes)

    def _at_rest(
        self, day: OperationDay, sample: Sample, decision: Decision, opening: float, before: Seen
    ) -> dict[str, object]:
        """Return what a command that stands says: of the stem at rest, and of the pressure."""
        changes: dict[str, object] = {}
        low_pa, high_pa = self._range_pa
        ratios, command_pa = decision.applied.ratios, decision.command_pa
        if ratios is not None and abs(opening - before.opening) <= RESTS and ENDS <= opening <= 1.0 - ENDS:
            slope, away_m = -ratios.b_over_c, sample.position_m + (command_pa - ratios.offset_pa) / ratios.b_over_c
            outside_m = max(abs(away_m) + ratios.k_over_c / slope, 0.0)
            changes["course"] = day.course.with_one(outside_m / self._travel.stroke_m)
        short_pa = command_pa - sample.pressure_pa
        if isfinite(short_pa) and short_pa != 0.0:  # to the digit: the device measures none, and the command is shown
            most_pa = high_pa if ratios is None else min(high_pa, ratios.balance_pa(self._travel.stroke_m, 1))
            high = command_pa >= low_pa + SUPPLY * (most_pa - low_pa)
            name = "short_high" if high else "short"
            changes[name] = getattr(day, name).with_one(short_pa / (high_pa - low_pa))
        return changes


def _counted(counts: tuple[int, ...], edges: tuple[float, ...], value: float) -> tuple[int, ...]:
    at = bisect_right(edges, value)
    return (*counts[:at], counts[at] + 1, *counts[at + 1 :])


FEWEST_DAYS = 5
"""That tell a trend."""
SAME_END_STROKE_SHARE = 0.002
"""Of the stroke, within which an end position is the same."""
SURE = 2.0
"""Deviations of Kendall's S, one in twenty by chance."""
JUMPS = 4.0
"""Median deviations of the days before, beyond which the last lies elsewhere."""


def end_trend(means: list[float]) -> EndTrend:
    """Return what an end position does over days; NaN of a day on which the valve was not there.

    By Kendall's S, the days that rise less those that fall, whose variance is n (n - 1) (2 n + 5) / 18 by chance.
    """
    known = [each for each in means if isfinite(each)]
    n = len(known)
    if n < FEWEST_DAYS:
        return EndTrend.NOT_KNOWN
    if max(known) - min(known) <= SAME_END_STROKE_SHARE:
        return EndTrend.STEADY
    middle = median(known[:-1])
    scatter = max(median(abs(each - middle) for each in known[:-1]), 0.25 * SAME_END_STROKE_SHARE)
    if abs(known[-1] - middle) > JUMPS * scatter and max(known[:-1]) - min(known[:-1]) <= abs(known[-1] - middle):
        return EndTrend.JUMPED
    s = sum((known[j] > known[i]) - (known[j] < known[i]) for i in range(n) for j in range(i + 1, n))
    if abs(s) > SURE * (n * (n - 1) * (2 * n + 5) / 18) ** 0.5:
        return EndTrend.RISING if s > 0 else EndTrend.FALLING
    return EndTrend.SCATTERED
