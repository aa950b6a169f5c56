"""The static law of one valve from its samples: landings as they come, the law anew after each.

The newest landings count, `EACH` in either direction, so that a spring or a packing that changes is followed. What
others say of b/c and k/c is tested on them: `tested` refuses what lands elsewhere than the stem did.

A rest counts as one under its command if the pressure measured there is what such commands have given
(`pressure_delivered`), or if the stem is where the law has it under the command all the same: then it is the
measurement of the pressure that is wrong.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from math import inf

from config.codes import Refusal
from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Applied, Ratios
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.extended_balance import contradicted
from positioner.estimation.landings.landing_detector import Answers, LandingDetector, SlideOutcome, Supposed
from positioner.estimation.landings.landing_shift import shifted
from positioner.estimation.landings.local_balance import LocalBalance
from positioner.estimation.landings.overshoot import balanced
from positioner.estimation.landings.packing_compliance import compliance
from positioner.estimation.landings.pressure_delivered import PressureDelivered
from positioner.estimation.landings.static_law import StaticLaw, no_static_law, static_law

LONGEST_WAY, OFF, LIKE = 0.03, 1e-3, 0.15
"""Of the stroke: a stuck stem gives way no farther; a slide may land so far from where it should, or by a share of its
way."""
AS_COMMANDED = 0.02
"""Of the pressure over the stroke: a stem that rests so near where the law has it has the pressure commanded."""
IN_A_ROW = 4
EACH = 20
"""Landings remembered in a direction."""


class StaticIdentification:
    """Landings and the static law.

    Args:
        stroke_m: full travel, m.
        stops_m: positions of the stops as indicated, m; by default the valve's, or 0 and the stroke.
        each: landings remembered in a direction.
        valve: whose sensor and play are known; then all positions are of the stem, else as indicated.

    Attributes:
        detector: of the rests.
        landings: the latest first.
        balances: the same, each where its balance is: a stem that swings sticks past it.
        held: changes of the command that did not move the stem, the latest first.
        law: from the landings.
        sensor: the valve whose sensor and play are known, whatever the landings say.
        valve: the same, as long as the landings do not say that it is another.
        way: direction in which the stem moved last, 0 if it has not.
    """

    def __init__(
        self,
        stroke_m: float,
        stops_m: tuple[float, float] | None = None,
        each: int = EACH,
        valve: ExtendedValve | None = None,
    ) -> None:
        self._stroke_m = stroke_m
        self.sensor = self.valve = valve
        self.way = 0
        self._each = each
        known_m = None if valve is None else valve.stops_indicated_m
        self.detector = LandingDetector(stroke_m, stops_m or known_m, self._believed)
        self._delivered = PressureDelivered()
        self._tested: tuple[Estimates, StaticLaw, Estimates] | None = None
        self.restart()

    def restart(self) -> None:
        """Forget the landings."""
        self._in_direction: dict[int, deque[SlideOutcome]] = {
            1: deque(maxlen=self._each),
            -1: deque(maxlen=self._each),
        }
        self.landings: tuple[SlideOutcome, ...] = ()
        self.balances: tuple[SlideOutcome, ...] = ()
        self.held: tuple[SlideOutcome, ...] = ()
        self._elsewhere = 0
        self.law: StaticLaw = no_static_law(Refusal.LANDINGS_TOO_FEW)

    def refuse_as_few(self) -> None:
        """Say of a law that is refused that its landings are too few: what they lie on is then not known."""
        self.law = no_static_law(Refusal.LANDINGS_TOO_FEW, self.law.slides)

    def restore(self, landings: Iterable[SlideOutcome], held: tuple[SlideOutcome, ...], answers: Answers) -> None:
        """Remember what was known before a restart; the latest first, times negative."""
        self.restart()
        for each in reversed(tuple(landings)):
            self._in_direction[each.direction].appendleft(each)
        self._solve()
        self.held, self.detector.answers = held[: self._each], answers

    def update(
        self, time_s: float, position_m: float, command_pa: float, pressure_pa: float, *, arrived: bool = True
    ) -> SlideOutcome | None:
        """Take a sample, the command in force and the measured pressure (NaN: none): s, m, Pa.

        Args:
            time_s, position_m, command_pa, pressure_pa: as said.
            arrived: False where it is known that the pressure has not arrived yet.

        Returns:
            What a change of the command did, once that is known.
        """
        outcome = self.detector.update(time_s, position_m, command_pa, pressure_pa, arrived=arrived)
        if outcome is None:
            return None
        if self.sensor is not None:
            outcome = self._of_stem(outcome, self.sensor)
        off_m, near_m = self._off_m(outcome)
        if outcome.landing and self._gave_way(outcome, off_m, near_m):
            outcome = outcome._replace(moved=False, landing=False)
        if not outcome.moved and off_m > near_m:
            self.held = (outcome, *self.held[: self._each - 1])
        if outcome.landing:
            self.take(outcome)
        return outcome

    def _believed(self, supposed: Supposed) -> bool:
        """Whether a stem rests under the pressure that is commanded."""
        pressure_pa, command_pa = supposed.rest.pressure_pa, supposed.command_pa
        believed = self._delivered.agrees(command_pa, pressure_pa) or self._rests_by_law(supposed)
        if believed:
            self._delivered.add(command_pa, pressure_pa)
        return believed

    def _rests_by_law(self, supposed: Supposed) -> bool:
        """Whether a stem rests where the law has it: after a slide at its balance, else anywhere in its band."""
        law, s = self.law, supposed.direction
        if not law.valid:
            return False
        position_m = supposed.rest.position_m
        if self.sensor is not None:
            position_m = self.sensor.stem_m(position_m, s or self.way)
        down_pa, up_pa = (self._balance.pressure_pa(position_m, way) for way in (-1, 1))
        low_pa, high_pa = (up_pa if s > 0 else down_pa), (down_pa if s < 0 else up_pa)
        near_pa = AS_COMMANDED * -law.ratios.b_over_c * self._stroke_m
        return low_pa - near_pa <= supposed.command_pa <= high_pa + near_pa

    def _of_stem(self, outcome: SlideOutcome, valve: ExtendedValve) -> SlideOutcome:
        """Return an outcome with the positions of the stem in place of those indicated."""
        from_m = valve.stem_m(outcome.from_m, self.way)
        self.way = outcome.direction if outcome.moved else self.way
        return outcome._replace(from_m=from_m, position_m=valve.stem_m(outcome.position_m, self.way))

    def take(self, outcome: SlideOutcome) -> None:
        """Take a slide that has ended, and work out the law anew."""
        self._in_direction[outcome.direction].appendleft(outcome)
        self._solve()

    def _solve(self) -> None:
        both = (*self._in_direction[1], *self._in_direction[-1])
        landings = tuple(sorted(both, key=lambda each: -each.time_s))
        self.law = static_law(landings, self._stroke_m)
        if self.sensor is not None:
            self.valve = None if contradicted(self.sensor, self.law) else self.sensor
        self.landings = self.law.slides if self.law.valid else landings
        self.balances = tuple(balanced(each, self.law.swing) for each in self.landings)
        self._balance = LocalBalance(ratios=self.law.ratios, landings=self.balances, stroke_m=self._stroke_m)

    def _off_m(self, outcome: SlideOutcome) -> tuple[float, float]:
        """Return how far a stem went from where a slide by the law goes, m, and by how much such slides may miss.

        One that went as a slide does was broken loose, be it too short to be seen for one. Without a law none was.
        """
        if not self.law.valid:
            return inf, 0.0
        went_m = outcome.direction * (outcome.position_m - outcome.from_m)
        should_m = self._balance.ahead_m(outcome, self.law.swing)
        return abs(went_m - should_m), OFF * self._stroke_m + 3.0 * (self._balance.scatter_m + outcome.std_m)

    def _gave_way(self, outcome: SlideOutcome, off_m: float, near_m: float) -> bool:
        """Whether the packing that holds the stem gave way, for a slide by the law would have gone elsewhere.

        Not for long ways, nor `IN_A_ROW` times on end but as the packing has given way before: then it is the law that
        no longer holds.
        """
        went_m = outcome.direction * (outcome.position_m - outcome.from_m)
        if not self.law.valid or went_m > LONGEST_WAY * self._stroke_m:
            self._elsewhere = 0
            return False
        elsewhere = off_m > max(LIKE * went_m, near_m)
        if elsewhere and (gives := compliance(self.held, outcome.direction)) is not None and gives.explains(outcome):
            return True
        self._elsewhere = self._elsewhere + 1 if elsewhere else 0
        return 0 < self._elsewhere < IN_A_ROW

    def _shifted(self) -> bool:
        """Return whether landings before and after some instant disagree.

        The slides, and such as by the law are none, for it may be the law that is wrong: the last one, and ways longer
        than any packing gives way.
        """
        both = (*self._in_direction[1], *self._in_direction[-1])
        last = max(both, key=lambda each: each.time_s)
        far = [each for each in both if abs(each.position_m - each.from_m) > LONGEST_WAY * self._stroke_m]
        doubtful = ([last], [*far, last])
        return any(
            shifted({*self.balances, *(balanced(each, self.law.swing) for each in more)}, self._stroke_m)
            for more in doubtful
        )

    def tested(self, estimates: Estimates) -> Estimates:
        """Return estimates whose friction is refused if the landings contradict it."""
        if self._tested is None or self._tested[0] is not estimates or self._tested[1] is not self.law:
            self._tested = (estimates, self.law, self._tested_anew(estimates))
        return self._tested[2]

    def _tested_anew(self, estimates: Estimates) -> Estimates:
        slope, friction = estimates.b_over_c, estimates.k_over_c
        if not (self.law.valid and slope.valid and friction.valid):
            return estimates
        ratios = Ratios(slope.value, friction.value, directions=estimates.directions)
        if not self.law.contradicts(ratios, self._stroke_m):
            return estimates
        refused = Refusal.CONTRADICTED_BY_LANDINGS
        k = replace(estimates.k, reason=refused) if estimates.k.valid else estimates.k
        return replace(estimates, k=k, k_over_c=replace(friction, reason=refused))

    def corrected(self, applied: Applied) -> Applied:
        """Return what is applied after a landing: completed, or the numbers of the law where it contradicts them."""
        if applied.ratios is None or self.valve is not None:
            return applied
        applied = self.completed(applied)
        if applied.ratios is None or not self.law.contradicts(applied.ratios, self._stroke_m):
            return applied
        return Applied(self.law.ratios, applied.count + 1, applied.refusals, Refusal.CONTRADICTED_BY_LANDINGS)

    def completed(self, applied: Applied) -> Applied:
        """Return what is applied with friction in a direction that was not seen, by the last landing there."""
        ratios = applied.ratios
        if ratios is None or not (s := ratios.directions.unseen) or not self._in_direction[s]:
            return applied
        last, slope = self._in_direction[s][0], -ratios.b_over_c
        unseen_pa, seen_pa = s * (last.command_pa - slope * last.position_m), ratios.friction_pa(-s)
        if unseen_pa + seen_pa <= 0.0:  # no valve's: friction would drive it
            return applied
        up_pa, down_pa = (unseen_pa, seen_pa) if s > 0 else (seen_pa, unseen_pa)
        return replace(applied, ratios=Ratios.of(slope, up_pa, down_pa))

    def accepted(self, applied: Applied) -> Applied:
        """Return what is applied after an identification by landings alone: the law's numbers, or those in use."""
        if self.law.valid and self._shifted():
            self.restart()
            self.law = no_static_law(Refusal.LANDINGS_SHIFTED)
        if not self.law.valid:
            return applied.refused(self.law.reason)
        return Applied(self.law.ratios, applied.count + 1, applied.refusals, Refusal.VALID)
