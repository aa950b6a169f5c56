"""A daemon's cycle in a flow loop: the course of flow and stem, and figures of it.

    e = q - q_set               std e, max e - min e, integral of abs(e)
    e_v = q - q_0               std e_v, what the valve adds; q_0 is the same loop's flow, the stem at its reference

    air = sum of the falls of the pressure, over that which takes the stem through its travel: so often is it vented

Travel and reversals of the stem are counted as the daemon's own accumulator counts them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from positioner.daemon.health.travel_accumulator import TravelAccumulator
from positioner.virtual.virtual_cycle import play_script

if TYPE_CHECKING:
    from benchmarks.flow.loop import FlowLoop
    from positioner.control.requests import Requests
    from positioner.daemon.cycle import Cycle
    from positioner.daemon.snapshot import Snapshot

Series = np.ndarray[tuple[int], np.dtype[np.float64]]

LEAST_MOTION = 2e-3
"""Of the stroke: a motion that counts as travel."""


@dataclass(frozen=True, slots=True)
class FlowCourse:
    """Samples of a loop: s, shares and p.u."""

    time_s: Series
    flow: Series
    reference_pu: Series
    stem_pu: Series
    pressure_pu: Series | None = None
    """Of the pressure over the travel; None: of a stem that needs none."""


@dataclass(frozen=True, slots=True)
class FlowFigures:
    """How the flow does, and what it costs the valve; flows are shares of full flow."""

    deviation_std: float
    peak_to_peak: float
    absolute_error_s: float
    """Integral of the absolute deviation."""
    added_std: float
    """Deviation from the flow that a valve without friction would give."""
    strokes_per_minute: float
    reversals_per_minute: float
    vented_per_minute: float = 0.0
    """Air exhausted: fills of the actuator over its travel."""


def course_in(
    cycle: "Cycle", loop: "FlowLoop", write: Callable[[float], None], stroke_m: float, duration_s: float
) -> FlowCourse:
    """Run a cycle in a loop for a while, s, `write` taking each reference, p.u., to the daemon."""
    begin_s, ratios = cycle.snapshot.sample.time_s, cycle.snapshot.decision.applied.ratios
    over_travel_pa = 1.0 if ratios is None else -ratios.b_over_c * stroke_m
    rows: list[tuple[float, float, float, float, float]] = []

    def dcs(snapshot: "Snapshot", _: "Requests") -> "Requests":
        time_s, stem_pu = snapshot.sample.time_s, snapshot.sample.position_m / stroke_m
        if loop.advance(time_s, stem_pu):
            write(loop.reference_pu)
        pressure_pu = snapshot.sample.pressure_pa / over_travel_pa
        rows.append((time_s - begin_s, loop.flow, loop.reference_pu, stem_pu, pressure_pu))
        return cycle.requests

    for _ in play_script(cycle, dcs, begin_s + duration_s):
        pass
    return FlowCourse(*np.array(rows).T)


def course_of_stem(loop: "FlowLoop", time_s: Series, stem_pu: float | None = None) -> FlowCourse:
    """Return the course of a stem without friction, always at its reference; or of one that stands somewhere, p.u."""
    rows: list[tuple[float, float, float]] = []
    for each in time_s.tolist():
        stem = loop.reference_pu if stem_pu is None else stem_pu
        loop.advance(each, stem)
        rows.append((loop.flow, loop.reference_pu, stem))
    return FlowCourse(time_s, *np.array(rows).T)


def figures(course: FlowCourse, frictionless: FlowCourse, setpoint: float, from_s: float) -> FlowFigures:
    """Return the figures of a course from a time on, s.

    Args:
        course: of the valve.
        frictionless: of the same loop at the same times.
        setpoint: of the flow.
        from_s: when the steady state begins.
    """
    steady = course.time_s >= from_s
    time_s, deviation = course.time_s[steady], course.flow[steady] - setpoint
    travel, reversals = _wear(course.stem_pu, int(np.argmax(steady)))
    minutes = float(time_s[-1] - time_s[0]) / 60
    return FlowFigures(
        deviation_std=float(np.std(deviation)),
        peak_to_peak=float(np.ptp(deviation)),
        absolute_error_s=float(np.trapezoid(np.abs(deviation), time_s)),
        added_std=float(np.std(course.flow[steady] - frictionless.flow[steady])),
        strokes_per_minute=travel / minutes,
        reversals_per_minute=reversals / minutes,
        vented_per_minute=0.0 if course.pressure_pu is None else _vented(course.pressure_pu[steady]) / minutes,
    )


def _vented(pressure_pu: Series) -> float:
    """Return the sum of the falls of a pressure."""
    return float(np.maximum(0.0, -np.diff(pressure_pu)).sum())


def _wear(stem_pu: Series, start: int) -> tuple[float, int]:
    """Return how far the stem went from a sample on, strokes, and how often it turned round."""
    accumulator = TravelAccumulator(1.0, LEAST_MOTION)
    travel, reversals = 0.0, 0
    for index, each in enumerate(stem_pu.tolist()):
        if index == start:
            travel, reversals = accumulator.travel_m, accumulator.reversals
        accumulator.enter(each)
    return accumulator.travel_m - travel, accumulator.reversals - reversals
