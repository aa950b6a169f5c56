"""What is looked at once a second beside the cycle: conditions that are alarms and no faults.

friction, stiction     by tests that keep a promise (`friction_alarms`)
opening                beyond a limit (`position_limits`)
model changed          |k_s / k_s of the first identification - 1| > [alarms] model_change
test overdue           no test on the valve for [alarms] test_interval_days
"""

from dataclasses import replace
from math import isfinite
from typing import Annotated, NamedTuple, Self

from pydantic import AfterValidator

from config.alarm_table import AlarmsTable
from config.codes import ExperimentState, Ne107Cause
from config.loading import Many, NonNegative, Positive, Schema
from config.travel import Travel
from positioner.control.controller_memory import Decision
from positioner.control.sample import Sample
from positioner.daemon.health.daily_figures import DAY_S
from positioner.daemon.health.friction_alarms import FoundFriction, FrictionAlarms, FrictionLimits
from positioner.daemon.health.position_limits import SIDES, PositionLimits


def _cause(name: str) -> str:
    if name not in Ne107Cause.__members__:
        raise ValueError(f"no cause {name!r}")
    return name


CauseName = Annotated[str, AfterValidator(_cause)]


class KeptConditions(Schema):
    """What is kept of them over a restart."""

    raised: Many[CauseName] = ()
    """By the tests of the packing, and by limits of the opening, whose delays would begin anew."""
    spring_pa_per_m: Positive | None = None
    """k_s / A of the first identification."""
    tested_s: NonNegative | None = None
    """When the last test ended, or the valve was first looked at, s since 1970."""


class PackingFigures(NamedTuple):
    """What health knows of the packing: see `FrictionAlarms.look`."""

    found: FoundFriction | None
    baseline_pa: float
    moves: tuple[int, int]
    stiction_index: float


class ValveConditions:
    """Of one valve, in one thread."""

    def __init__(self, packing: FrictionLimits, alarms: AlarmsTable, travel: Travel) -> None:
        self._packing = FrictionAlarms(packing)
        self._limits = PositionLimits.of(alarms)
        self._alarms, self._travel = alarms, travel
        self._kept = KeptConditions()
        self._experiment = ExperimentState.NONE

    @property
    def kept(self) -> KeptConditions:
        """What is to be kept over a restart."""
        return self._kept

    def begin(self, kept: KeptConditions) -> Self:
        """Go on with what was kept."""
        self._kept = kept
        raised = frozenset(Ne107Cause[each] for each in kept.raised)
        self._packing.begin(raised - SIDES.keys())
        self._limits = replace(self._limits, raised=raised & self._limits.limits.keys())
        return self

    def tested(self, at_s: float | None) -> None:
        """Take when a test of which a record is kept was, s since 1970: by a command that had the valve to itself."""
        latest_s = max((each for each in (at_s, self._kept.tested_s) if each is not None), default=None)
        self._kept = self._kept.model_copy(update={"tested_s": latest_s})

    def look(self, sample: Sample, decision: Decision, packing: PackingFigures, wall_s: float) -> frozenset[Ne107Cause]:
        """Return what holds now; `wall_s` is the time of day, s since 1970."""
        self._limits = self._limits.after(sample.now_s, self._travel.opening(sample.position_m))
        raised = self._packing.look(sample.now_s, *packing) | self._limits.raised
        spring, changed = self._spring(decision)
        tested_s = self._tested_s(decision, wall_s)
        self._kept = KeptConditions(
            raised=tuple(sorted(each.name for each in raised)), spring_pa_per_m=spring, tested_s=tested_s
        )
        overdue = 0.0 < self._alarms.test_interval_days * DAY_S < wall_s - tested_s
        others = {Ne107Cause.MODEL_CHANGED: changed, Ne107Cause.TEST_OVERDUE: overdue}
        return raised | {cause for cause, holds in others.items() if holds}

    def _spring(self, decision: Decision) -> tuple[float | None, bool]:
        """Return the spring of the first identification, Pa/m, and whether today's is another."""
        first, ratios = self._kept.spring_pa_per_m, decision.applied.ratios
        if ratios is None or decision.applied.count == 0 or not isfinite(ratios.b_over_c):
            return first, False
        first = -ratios.b_over_c if first is None else first
        return first, 0.0 < self._alarms.model_change < abs(-ratios.b_over_c / first - 1.0)

    def _tested_s(self, decision: Decision, wall_s: float) -> float:
        before, self._experiment = self._experiment, decision.experiment.state
        ended = self._experiment.played and self._experiment is not before
        return wall_s if ended or self._kept.tested_s is None else self._kept.tested_s
