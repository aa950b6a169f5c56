"""A valve's health as it runs: travel, reversals, stiction index, and the friction with its baseline.

    friction        -k/c = F_c / A of the estimates that the law uses, Pa
    baseline        the friction of the first identification that is applied and knows both directions, or of the
                    engineer's command: of one direction alone friction and a preload are one number
    friction ratio  friction / baseline: high where the packing is too tight, low where it leaks

`enter` is called once a cycle by the cycle thread: a few comparisons, nothing is made anew. Others read what it leaves.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite, nan

from config.alarm_table import CLASSED, AlarmsTable
from config.codes import AUTOMATIC, GOOD, S3, Fault, Ne107Cause, Ne107Status
from config.daemon_file import DaemonFile, HealthTable
from config.supervision_table import Ne107Letter, SupervisionTable
from config.travel import Travel
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.travel.cutoffs import WITHIN, sent_to_m
from positioner.daemon.health.daily_figures import Operation, Turned
from positioner.daemon.health.friction_alarms import FoundFriction, FrictionLimits
from positioner.daemon.health.health_file import HealthRecord
from positioner.daemon.health.stiction_index import StictionIndex
from positioner.daemon.health.travel_accumulator import TravelAccumulator
from positioner.daemon.health.valve_conditions import PackingFigures, ValveConditions
from positioner.estimation.acceptance import Applied

MONITORS = SupervisionTable()
ALARMS = AlarmsTable()


@dataclass(frozen=True, slots=True)
class HealthSettings:
    """The limits of health; a limit of 0 is none."""

    stroke_m: float
    dead_band_m: float
    settle_s: float
    friction_high: float
    friction_low: float
    stiction_limit: float
    travel_limit_m: float
    reversal_limit: int
    fault_classes: Mapping[Fault, Ne107Status]
    """Of what table `[supervision]` names; any other fault is a failure."""
    cause_classes: Mapping[Ne107Cause, Ne107Status]
    """Of what table `[alarms]` names."""
    alarms: AlarmsTable
    travel: Travel
    range_pa: tuple[float, float]
    """Of the commands."""

    @classmethod
    def of_file(cls, file: DaemonFile) -> "HealthSettings":
        """Return the settings that a daemon's file asks for."""
        range_pa = (file.pressure.minimum_pa, file.pressure.maximum_pa)
        return cls.of(file.health, file.valve.stroke_m, file.supervision, file.alarms, file.valve.travel, range_pa)

    @classmethod
    def of(
        cls,
        health: HealthTable,
        stroke_m: float,
        supervision: SupervisionTable = MONITORS,
        alarms: AlarmsTable = ALARMS,
        travel: Travel | None = None,
        range_pa: tuple[float, float] = (0.0, 420e3),
    ) -> "HealthSettings":
        """Return the settings that these tables ask for, for a valve of that stroke."""
        return cls(
            stroke_m=stroke_m,
            dead_band_m=health.dead_band * stroke_m,
            settle_s=health.settle_s,
            friction_high=health.friction_high,
            friction_low=health.friction_low,
            stiction_limit=health.stiction_limit,
            travel_limit_m=health.travel_limit_strokes * stroke_m,
            reversal_limit=health.reversal_limit,
            fault_classes={
                Fault.NO_REPLY: _class(supervision.sample_age.ne107),
                Fault.STALE: _class(supervision.sample_age.ne107),
                Fault.IMPLAUSIBLE: _class(supervision.plausibility.ne107),
                Fault.DCS_SILENT: _class(supervision.heartbeat.ne107),
                Fault.TRAVEL_DEVIATION: _class(supervision.travel_deviation.ne107),
                Fault.FROZEN_SENSOR: _class(supervision.frozen_sensor.ne107),
                Fault.POSITION_RATE: _class(supervision.position_rate.ne107),
                Fault.SATURATED: _class(supervision.saturation.ne107),
                Fault.OVERRUN: _class(supervision.overrun.ne107),
                Fault.COMMAND_RATE: _class(supervision.command_rate.ne107),
            },
            cause_classes={CLASSED[name]: _class(letter) for name, letter in alarms.ne107.items()},
            alarms=alarms,
            travel=travel or Travel(stroke_m),
            range_pa=range_pa,
        )

    @property
    def packing(self) -> FrictionLimits:
        """The limits of friction and stiction."""
        return FrictionLimits(
            friction_high=self.friction_high,
            friction_low=self.friction_low,
            stiction_limit=self.stiction_limit,
            false_alarm_years=self.alarms.false_alarm_years,
        )


def _class(letter: Ne107Letter) -> Ne107Status:
    return next(each for each in Ne107Status if each.text.startswith(f"{letter} "))


class Health:
    """The counts of one valve, from what was kept of it."""

    def __init__(self, settings: HealthSettings, stored: HealthRecord | None = None) -> None:
        stored = stored or HealthRecord()
        self.settings = settings
        self._baseline_pa = nan if stored.baseline_pa is None else stored.baseline_pa
        self._travel = TravelAccumulator(settings.stroke_m, settings.dead_band_m)
        self._travel.travel_m, self._travel.reversals = stored.travel_m, stored.reversals
        self._stiction = StictionIndex(settings.settle_s, lambda: self._travel.band_m)
        self._stiction.index, self._stiction.judged = stored.stiction_index, stored.moves_judged
        self._applied: Applied | None = None
        self._friction_pa = nan
        self._requests = Requests()
        self._pressed_s = inf
        """Since when the stem is pressed onto a stop."""
        self.away_m = 0.0
        """From stem to where it is sent, m; 0 where nobody asks, and on its way onto a stop, ..."""
        self.left_away_m = 0.0
        """... and the same where it has stood still for the time in which moves settle: it is not on its way."""
        self.conditions: frozenset[Ne107Cause] = frozenset()
        """What holds of what is looked at once a second; replaced whole by the thread that does."""
        self.watch = ValveConditions(settings.packing, settings.alarms, settings.travel)
        self.operation = Operation(settings.travel, settings.range_pa)
        self._found: FoundFriction | None = None
        self._command_pa = inf
        self._falls_pa = 0.0
        self._stood = (nan, nan, inf)
        """Where, for which reference, and since when: m, m, s."""

    @classmethod
    def idle(cls, stroke_m: float) -> "Health":
        """Return the health of a valve that nobody looks after."""
        return cls(HealthSettings.of(HealthTable(), stroke_m))

    @property
    def friction_pa(self) -> float:
        """F_c / A as the law uses it; NaN: none yet."""
        return self._friction_pa

    @property
    def baseline_pa(self) -> float:
        """The friction that is called normal; NaN: none yet."""
        return self._baseline_pa

    @property
    def friction_ratio(self) -> float:
        """Friction over baseline; NaN while either is missing."""
        return self._friction_pa / self._baseline_pa

    @property
    def record(self) -> HealthRecord:
        """What is to be kept over a restart."""
        travel, stiction = self._travel, self._stiction
        baseline_pa = self._baseline_pa if isfinite(self._baseline_pa) else None
        return HealthRecord(travel.travel_m, travel.reversals, stiction.index, stiction.judged, baseline_pa)

    def enter(self, sample: Sample, decision: Decision, requests: Requests) -> None:
        """Take one cycle."""
        command_pa = decision.command_pa
        if command_pa < self._command_pa < inf:
            self._falls_pa += self._command_pa - command_pa
        self._command_pa = command_pa
        if decision.applied is not self._applied:
            self._take(decision)
        if requests is not self._requests:
            self._obey(requests)
        if sample.quality is not GOOD or not isfinite(sample.position_m):
            return
        self._travel.enter(sample.position_m)
        follows = decision.mode is AUTOMATIC and decision.state is not S3
        self._pressed_s = inf if decision.cut_off == WITHIN else min(self._pressed_s, sample.now_s)
        if follows and decision.cut_off == WITHIN:
            self._stiction.enter(sample.now_s, sample.position_m, decision.reference_m)
        else:
            self._stiction.interrupt()
        under_way = self._pressed_s <= sample.now_s < self._pressed_s + self.settings.settle_s
        asked_m = sent_to_m(decision.cut_off, decision.reference_m, sample.position_m)
        self.away_m = abs(sample.position_m - asked_m) if follows and not under_way else 0.0
        self.left_away_m = self.away_m if self._stands(sample, decision.reference_m if follows else nan) else 0.0

    def _stands(self, sample: Sample, reference_m: float) -> bool:
        """Whether the stem has stood still, but for noise, under a reference, m, for as long as moves settle.

        NaN: it follows none, and has not stood yet when it follows one again.
        """
        at_m, asked_m, since_s = self._stood
        if not (reference_m == asked_m and abs(sample.position_m - at_m) <= self._travel.band_m):
            self._stood, since_s = (sample.position_m, reference_m, sample.now_s), sample.now_s
        return sample.now_s - since_s >= self.settings.settle_s

    def look(self, sample: Sample, decision: Decision, wall_s: float) -> None:
        """Look once a second at what needs no cycle; `wall_s` is the time of day, s since 1970."""
        stiction = self._stiction
        packing = PackingFigures(self._found, self._baseline_pa, stiction.counted, stiction.index)
        self.conditions = self.watch.look(sample, decision, packing, wall_s)
        self.operation.look(sample, decision, Turned(tuple(self._travel.spans), self._falls_pa), wall_s)

    def _take(self, decision: Decision) -> None:
        before, self._applied = self._applied, decision.applied
        applied = decision.applied
        if applied.ratios is None:
            return
        self._friction_pa = -applied.ratios.k_over_c
        if not isfinite(self._baseline_pa):
            if applied.count and not applied.ratios.directions.unseen:
                self._baseline_pa = self._friction_pa
        elif applied.count and (before is None or applied.count != before.count):
            self._found = FoundFriction(self._friction_pa, decision.estimates.k_over_c.std)

    def _obey(self, requests: Requests) -> None:
        before, self._requests = self._requests, requests
        if requests.baseline_writes != before.baseline_writes:
            self._baseline_pa, self._found = self._friction_pa, None
        if requests.health_resets != before.health_resets:
            self._reset()

    def _reset(self) -> None:
        self._travel.travel_m, self._travel.reversals = 0.0, 0
        self._stiction.index, self._stiction.judged = 0.0, 0
