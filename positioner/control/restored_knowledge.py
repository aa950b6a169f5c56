"""What was restored after a restart is provisional until the first landings agree with it.

It is used at once, so that a valve that has not changed is controlled as before. Each change of the command is a test:

    landing      x = (p - offset - s φ)/κ, or the extended valve's, corrected by the landings near it, within
                 max(3 deviations, 0.3 % of stroke)
    no landing   the stem rests where static friction can hold it: no slide by the law from there is much longer than
                 the shortest that breaks loose, in either direction

The second holds before the first move, too: a stem that rests where it cannot by what was restored is another valve's,
and a reference moves nothing.

The deviation is that of what was kept, widened by 1 % of friction, for a packing that sat still. Three landings that
agree, one in each direction at least, confirm. One that does not, and all that was restored is dropped: nothing is left
to command by, the pressure is held, and somebody must identify the valve. Until then a reference waits for the stem to
rest, so that there is never a second move before the first has been judged.
"""

from dataclasses import dataclass, replace
from math import hypot

from config.codes import PROVISIONAL, Restored
from config.extended_valve import ExtendedValve
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.landings.landing_detector import STOP, VISIBLE, SlideOutcome
from positioner.estimation.landings.local_balance import LocalBalance

DEVIATIONS, AGREEING_STROKE_SHARE = 3.0, 3e-3
"""Of the stroke: landings nearer than this agree."""
SAT_STILL = 0.01
"""Of friction: a standard deviation of what a packing that was left alone holds more or less."""
CONFIRMING = 3
MUCH_LONGER = 2.0
"""Times the shortest slide that breaks loose."""


@dataclass(frozen=True, slots=True)
class Restoration:
    """What was restored, and what has become of it.

    Attributes:
        stroke_m: full travel.
        knowledge: None when nothing was.
        valve: the extended valve that the laws work with, if there is one.
        trust: in it.
        ups, downs: landings that agreed.
    """

    stroke_m: float
    knowledge: ValveKnowledge | None = None
    valve: ExtendedValve | None = None
    trust: Restored = Restored.NOTHING
    ups: int = 0
    downs: int = 0

    @classmethod
    def of(cls, knowledge: ValveKnowledge | None, valve: ExtendedValve | None, stroke_m: float) -> "Restoration":
        """Return what has become of it before anything was seen."""
        return cls(stroke_m, knowledge, valve, Restored.NOTHING if knowledge is None else Restored.PROVISIONAL)

    @property
    def provisional(self) -> bool:
        """Whether landings have still to agree."""
        return self.trust is PROVISIONAL

    def replaced(self) -> "Restoration":
        """Return what has become of it when the valve is identified anew."""
        return self if self.trust is Restored.NOTHING else replace(self, trust=Restored.REPLACED)

    def after(self, outcome: SlideOutcome | None) -> "Restoration":
        """Return what has become of it after what a change of the command did, if that is known now."""
        if outcome is None or not self.provisional or self.knowledge is None:
            return self
        agrees = self._agrees(outcome, self.knowledge)
        if agrees is None:
            return self
        if not agrees:
            return replace(self, trust=Restored.DROPPED)
        ups, downs = self.ups + (outcome.direction > 0), self.downs + (outcome.direction < 0)
        confirmed = ups + downs >= CONFIRMING and min(ups, downs) > 0
        return replace(self, ups=ups, downs=downs, trust=Restored.CONFIRMED if confirmed else self.trust)

    def where_it_rests(self, position_m: float, std_m: float, command_pa: float, now_s: float) -> "Restoration":
        """Return what has become of it by where the stem rests under a command, whatever brought it there."""
        return self.after(SlideOutcome(now_s, 1, position_m, command_pa, position_m, std_m, moved=False, landing=False))

    def _agrees(self, outcome: SlideOutcome, knowledge: ValveKnowledge) -> bool | None:
        """Return whether what a change of the command did agrees with what was restored; None: it does not say."""
        s, at_m, stroke_m = outcome.direction, outcome.position_m, self.stroke_m
        lands_m = {each: self._landing_m(outcome, each, knowledge) for each in (s, -s)}
        should_m = lands_m[s]
        within_m = _within_m(outcome, should_m, knowledge, stroke_m)
        if outcome.landing:
            return abs(at_m - should_m) <= within_m
        low_m, high_m = (0.0, stroke_m) if self.valve is None else self.valve.stops_m
        went = s * (at_m - outcome.from_m) > VISIBLE * stroke_m
        free = low_m + STOP * stroke_m < at_m < high_m - STOP * stroke_m
        if went and not free:  # onto a stop: it should have come to rest before
            contradicts = low_m + within_m < should_m < high_m - within_m
        elif went and s * (should_m - outcome.from_m) > knowledge.shortest_m(s):  # less far than a slide goes
            contradicts = abs(at_m - should_m) > within_m
        else:  # so much as a slide from where it rests would go was held
            contradicts = free and any(
                d * (to_m - at_m) > MUCH_LONGER * knowledge.shortest_m(d) + within_m for d, to_m in lands_m.items()
            )
        return False if contradicts else None

    def _landing_m(self, outcome: SlideOutcome, direction: int, knowledge: ValveKnowledge) -> float:
        """Return where a slide lands: by the law, corrected by what landings near there missed it by."""
        balance = LocalBalance(
            ratios=knowledge.ratios,
            landings=tuple(knowledge.landings),
            stroke_m=self.stroke_m,
            valve=self.valve,
            now_s=outcome.time_s,
        )
        lands_m = (knowledge.landing_m if self.valve is None else self.valve.lands_m)(outcome.command_pa, direction)
        off_pa = balance.pressure_pa(lands_m, direction) - outcome.command_pa
        return lands_m - off_pa / -knowledge.ratios.b_over_c


def _within_m(outcome: SlideOutcome, should_m: float, knowledge: ValveKnowledge, stroke_m: float) -> float:
    """Return how far off what should be a landing may be."""
    still_m = SAT_STILL * knowledge.friction_m
    std_m = hypot(knowledge.deviation_m(should_m, outcome.direction), still_m, outcome.std_m)
    return max(DEVIATIONS * std_m, AGREEING_STROKE_SHARE * stroke_m)
