"""What the law of slides takes from an extended valve besides its pressures: where the stem is, and its margins.

    x = y^-1(indicated + s play/2)            s the direction in which the stem moved last
    m_s(r) = learnt factor * (m_s(r) of the extended valve)

The law works with positions of the stem, not with what is indicated of it.
"""

from dataclasses import replace
from math import isnan

from config.extended_valve import ExtendedValve
from positioner.control.slide_margins import NO_MARGINS, Margin, Margins
from positioner.control.slide_memory import SlideMemory, StemObservation

SURE = 1.02
"""Factor on a margin that is known: a slide of just that length may hold."""
LEAST = 5e-3
"""Of the stroke: a slide shorter than this would not be seen for one."""


def stem_observed(observation: StemObservation, valve: ExtendedValve, direction: int) -> StemObservation:
    """Return an observation of the indicated position as one of the stem, which moved in a direction last."""
    rest = observation.rest
    return replace(
        observation,
        quantum_m=max(observation.quantum_m, valve.inverse.quantum_m),
        position_m=valve.stem_m(observation.position_m, direction),
        rest=None if rest is None else replace(rest, position_m=valve.stem_m(rest.position_m, direction)),
    )


def with_margins_at(memory: SlideMemory, reference_m: float, valve: ExtendedValve) -> SlideMemory:
    """Return the memory with the margins of the valve at a reference; what slides have taught of them stays."""
    if memory.margins_at_m == reference_m:
        return memory
    margins = _at(memory.margins, memory.margins_at_m, reference_m, valve)
    before = _at(memory.held.margins, memory.margins_at_m, reference_m, valve) if memory.held.slides else NO_MARGINS
    return replace(memory, margins=margins, held=replace(memory.held, margins=before), margins_at_m=reference_m)


def _at(margins: Margins, at_m: float, reference_m: float, valve: ExtendedValve) -> Margins:
    """Return margins learnt at one place, m, at another; at none, nan: the valve's."""
    for s in (1, -1):
        for turning in (False, True):
            margin = Margin(_margin_m(reference_m, s, valve) / SURE, _margin_m(reference_m, s, valve))
            if not isnan(at_m):
                margin = margins.own(s, turning=turning).times(margin.broke_m / _margin_m(at_m, s, valve))
            margins = margins.replaced(s, margin, turning=turning)
    return margins


def _margin_m(stem_m: float, direction: int, valve: ExtendedValve) -> float:
    return max(SURE * valve.margin_m(stem_m, direction), LEAST * valve.stroke_m)
