"""What the law of slides takes from an extended valve besides its pressures and margins: where the stem is.

    x = y^-1(indicated + s play/2)            s the direction in which the stem moved last

The law works with positions of the stem, not with what is indicated of it.
"""

from dataclasses import replace

from config.extended_valve import ExtendedValve
from positioner.control.laws.slides.slide_memory import StemObservation


def stem_observed(observation: StemObservation, valve: ExtendedValve, direction: int) -> StemObservation:
    """Return an observation of the indicated position as one of the stem, which moved in a direction last."""
    rest = observation.rest
    return replace(
        observation,
        quantum_m=max(observation.quantum_m, valve.inverse.quantum_m),
        position_m=valve.stem_m(observation.position_m, direction),
        rest=None if rest is None else replace(rest, position_m=valve.stem_m(rest.position_m, direction)),
    )
