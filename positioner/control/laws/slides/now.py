"""What one step of the law of slides is decided from: what is seen of the stem, what is asked for, what is known.

x = y^-1(indicated + s play/2)      the stem of an extended valve; s the direction in which it moved last
"""

from dataclasses import dataclass, replace
from functools import cached_property

from config.codes import InhibitReason
from positioner.control.laws.boundary import Seen
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.stem_at_rest import Rest


@dataclass(frozen=True, kw_only=True)
class Now:
    """m, s."""

    now_s: float
    position_m: float
    rest: Rest | None
    """None while the stem moves or may yet move."""
    quantum_m: float
    answer_s: float = 0.0
    """The longest that the stem has taken to answer, as far as is learnt."""
    reference_m: float
    balance: Balance
    bounds: SlideBounds
    outcome: SlideOutcome | None = None
    """Of the last change of the command, in the step in which it is known."""
    waits_for: InhibitReason = InhibitReason.NOTHING
    """Why it should long have come to rest, and no rest counts."""

    @classmethod
    def of(cls, seen: Seen, balance: Balance, bounds: SlideBounds) -> "Now":
        """Return what a step is decided from, by what the law is shown."""
        detector, sensor, position_m = seen.statics.detector, seen.statics.sensor, seen.sample.position_m
        rest, quantum_m = detector.rest, detector.quantum_m
        if sensor is not None:
            stem_m, way = sensor.stem_m, seen.statics.way
            position_m, quantum_m = stem_m(position_m, way), max(quantum_m, sensor.inverse.quantum_m)
            rest = None if rest is None else replace(rest, position_m=stem_m(rest.position_m, way))
        return cls(
            now_s=seen.sample.now_s,
            position_m=position_m,
            rest=rest,
            quantum_m=quantum_m,
            answer_s=detector.answers.longest_s,
            reference_m=seen.reference_m,
            balance=balance,
            bounds=bounds,
            outcome=seen.outcome,
            waits_for=detector.waits_for,
        )

    @cached_property
    def local(self) -> float:
        """What break-away distances at the reference are of those in the middle of the travel."""
        return self.balance.local(self.reference_m)

    @property
    def at_rest(self) -> Rest:
        """Where the stem rests; only asked of one that does."""
        assert self.rest is not None, "only asked of a stem at rest"
        return self.rest

    @property
    def error_m(self) -> float:
        """e = r - x of a stem at rest, m."""
        return self.reference_m - self.at_rest.position_m

    @property
    def side(self) -> int:
        """The sign of e."""
        return 1 if self.error_m > 0 else -1

    @property
    def beside_m(self) -> float:
        """How far beside its aim a slide may land, m, where the device is told whole numbers: by half a step."""
        return 0.5 * self.bounds.command_step_pa / -self.balance.ratios.b_over_c
