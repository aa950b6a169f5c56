"""What one step of the law of slides sees of the stem; of an extended valve the stem, not what is indicated of it.

x = y^-1(indicated + s play/2)            s the direction in which the stem moved last
"""

from dataclasses import replace
from typing import NamedTuple

from config.codes import InhibitReason
from config.extended_valve import ExtendedValve
from positioner.control.laws.boundary import Seen
from positioner.control.records import by_name
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.stem_at_rest import Rest


class StemObservation(NamedTuple):
    """m, s."""

    now_s: float
    position_m: float
    rest: Rest | None
    """None while the stem moves or may yet move."""
    quantum_m: float
    outcome: SlideOutcome | None
    """Of the last change of the command, in the step in which it is known."""
    waits_for: InhibitReason = InhibitReason.NOTHING
    """Why it should long have come to rest, and no rest counts."""


observation_of = by_name(StemObservation)


def observed(seen: Seen) -> StemObservation:
    """Return what is seen of the stem in one step."""
    detector = seen.statics.detector
    observation = observation_of(
        now_s=seen.sample.now_s,
        position_m=seen.sample.position_m,
        rest=detector.rest,
        quantum_m=detector.quantum_m,
        outcome=seen.outcome,
        waits_for=detector.waits_for,
    )
    return observation if seen.valve is None else _of_stem(observation, seen.valve, seen.statics.way)


def _of_stem(observation: StemObservation, valve: ExtendedValve, direction: int) -> StemObservation:
    rest = observation.rest
    return observation._replace(
        quantum_m=max(observation.quantum_m, valve.inverse.quantum_m),
        position_m=valve.stem_m(observation.position_m, direction),
        rest=None if rest is None else replace(rest, position_m=valve.stem_m(rest.position_m, direction)),
    )
