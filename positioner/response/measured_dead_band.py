"""Dead band and resolution, from series of small steps (ISA-75.25.01, IEC 60534-4).

    dead band     what the input must change, after the direction is reversed, until the stem moves
    resolution    what the input must change, in the same direction, until the stem moves again

Counted from the input at which the stem moved last: the steps add up until it moves. The last sum that did not move it
and the first that did bound the figure; several such bounds give their medians. A step that moves the stem by less
than a tenth of what the static gain calls for did not move it: presliding is no response.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from positioner.response.figure import Figure, no_value
from positioner.response.step_figures import StepFigures

RESPONDED = 0.1
"""Least part of the expected travel that is a response."""

COARSE = 0.5
"""Bounds farther apart than this part of the upper one determine nothing."""


@dataclass(frozen=True, slots=True)
class InputBounds:
    """The figure lies between: `low` did not move the stem (0: nothing smaller was tried), `high` did."""

    low: float
    high: float


def dead_band_and_resolution(steps: Sequence[StepFigures], gain: float, unit: str) -> tuple[Figure, Figure]:
    """Return both, in the unit of the input; `gain` is the static gain of the whole recording."""
    reversed_, onward = _bounds(steps, gain)
    return (
        _figure(reversed_, "a reversal after a move", unit),
        _figure(onward, "a second step in the same direction after a move", unit),
    )


def _bounds(steps: Sequence[StepFigures], gain: float) -> tuple[list[InputBounds], list[InputBounds]]:
    reversed_: list[InputBounds] = []
    onward: list[InputBounds] = []
    direction, since = 0, 0.0  # of the last move; change of the input since
    reached = {1: 0.0, -1: 0.0}  # how far the input has been either way since, without a move
    for step in steps:
        since += step.size
        way = 1 if step.size > 0 else -1
        if not follows_step(step, gain):
            reached[way] = max(reached[way], way * since)
            continue
        if direction and way * since > reached[way]:
            (onward if way == direction else reversed_).append(InputBounds(reached[way], way * since))
        direction, since, reached = way, 0.0, {1: 0.0, -1: 0.0}
    return reversed_, onward


def follows_step(step: StepFigures, gain: float) -> bool:
    """Return whether the stem followed a step, the right way and by a tenth at least of what the gain calls for."""
    travel_m = step.travel_m.value
    return step.moved and travel_m is not None and travel_m / (gain * step.size) > RESPONDED


def _figure(bounds: Sequence[InputBounds], wanted: str, unit: str) -> Figure:
    lacks = "this recording does not hold a series of small steps"
    if not bounds:
        return no_value(f"{lacks}: it lacks {wanted}")
    determined = [each for each in bounds if each.low > 0]
    if not determined:
        return no_value(f"{lacks}: the smallest tried, {min(each.high for each in bounds):.4g} {unit}, moved the stem")
    low, high = median(each.low for each in determined), median(each.high for each in determined)
    if high - low > COARSE * high:
        return no_value(f"{lacks}: {low:.4g} {unit} did not move the stem, {high:.4g} {unit} did")
    return Figure((low + high) / 2, (high - low) / 2)
