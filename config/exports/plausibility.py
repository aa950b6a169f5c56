"""What is odd about a recording, said before anything is fitted to it: each a line that says what to do about it.

The reading may be right and the export still useless: units a thousand off, a valve that air closes, commands sampled
at other moments than positions, a stem that never moves, samples too far apart to see it move. None of this stops
anybody.
"""

from collections.abc import Iterator

import numpy as np

from config.drive import VALVE
from config.recording import Column, Recording

LONGEST_STROKE_M = 1.5
LARGEST_PA, LEAST_SPAN_PA = 2e6, 200.0
FEWEST_ROWS = 50
REVERSE = -0.5
"""Correlation of command and position below which the valve closes with pressure."""
MISSING = 0.05
"""Share of a column without a value that is worth a word."""
RESPONDS_TOO_EARLY = 0.2
"""Share of the command's changes that the stem may have followed by the same row."""
FAR = 5.0
"""Spans of all other positions between them and one that is no position."""
GAP_PERIODS = 20.0
MOVED = 0.02
"""Of the span of the positions: what counts as a move, and of the commands: as a change."""
STRAIGHT = 0.3
"""Share of the moving rows on straight lines, from which on a historian drew them."""


def oddities(recording: Recording, stroke_m: float | None = None) -> list[str]:
    """Return what is odd about a recording, a line each.

    Args:
        recording: as read.
        stroke_m: of its valve, if that is known.
    """
    position_m, command_pa, kind = recording.position_m, recording.columns.get("command_pa"), recording.kind
    said = [*odd_sizes(recording, stroke_m), *_of_rows(recording)]
    whole = np.isfinite(position_m)
    if whole.any() and np.ptp(position_m[whole]) == 0.0:
        where = f"{position_m[whole][0]:g} {kind.travel.si}"
        said.append(f"the position is {where} throughout: a stem that never moves says nothing")
    elif whole.any() and command_pa is not None and kind is VALVE and not in_each_others_place(position_m, command_pa):
        held_pa = _held(command_pa)
        said += [
            *_of_constant(command_pa),
            *_of_action(position_m, held_pa),
            *_of_sampling(recording.time_s, position_m, held_pa),
        ]
    return said


def odd_sizes(recording: Recording, stroke_m: float | None = None) -> list[str]:
    """Return what is odd about the sizes of a valve's numbers, a line each: those of other units, or of no value."""
    position_m, command_pa = recording.position_m, recording.columns.get("command_pa")
    if recording.kind is not VALVE:
        return []
    if command_pa is not None and in_each_others_place(position_m, command_pa):
        return [
            f"positions go to {_reach(position_m):.4g} m and commands to {_reach(command_pa):.4g} Pa: do their columns "
            "stand in each other's place?"
        ]
    return [*_of_size(position_m, stroke_m), *([] if command_pa is None else _of_pressure(command_pa))]


def in_each_others_place(position_m: Column, command_pa: Column) -> bool:
    """Whether positions are beyond any unit of a length, as pressures are, and commands change within a stroke."""
    in_mm_m = 1e-3 * _reach(position_m)
    low, high = _ends(command_pa)
    return in_mm_m > LONGEST_STROKE_M >= _reach(command_pa) and high > low


def _reach(column: Column) -> float:
    return max(map(abs, _ends(column)))


def _of_size(position_m: Column, stroke_m: float | None) -> Iterator[str]:
    low, high = _ends(position_m)
    far = _reach(position_m)
    if said := _stands_for_none(position_m):
        yield said
    elif far > LONGEST_STROKE_M:
        yield f"positions go to {far:.4g} m: are they in mm, or in %? Then position_m=THEIRS:mm, or :%"
    elif stroke_m is not None and far > 1.5 * stroke_m:
        yield f"positions go to {1e3 * far:.4g} mm, of a stroke of {1e3 * stroke_m:.4g} mm: is one wrong?"
    elif stroke_m is not None and high - low > 0.0 and low > -0.001 * stroke_m and high < 0.0105 * stroke_m:
        yield (
            f"positions never pass {100 * high / stroke_m:.2g} % of the stroke: are they shares of 1, or in m? "
            "Then position_m=THEIRS:p.u., or :m"
        )


def _stands_for_none(position_m: Column) -> str | None:
    """Return what to say of one number far from all others that stands again and again: a device's word for none."""
    finite = position_m[np.isfinite(position_m)]
    for extreme in (float(finite.min()), float(finite.max())) if finite.size else ():
        others = finite[finite != extreme]
        count = finite.size - others.size
        if count > 1 and others.size > count:
            low, high = float(others.min()), float(others.max())
            if high > low and min(abs(extreme - low), abs(extreme - high)) > FAR * (high - low):
                return (
                    f"{count} positions are {extreme:.4g} m, all others {low:.4g} to {high:.4g} m: does this number "
                    "stand for no value? Then leave these cells empty"
                )
    return None


def _of_rows(recording: Recording) -> Iterator[str]:
    count = len(recording)
    if count < FEWEST_ROWS:
        rows = "1 row is" if count == 1 else f"{count} rows are"
        yield f"{rows} too few to fit anything to; some hundred are needed in which the stem moves"
    for name, column in recording.columns.items():
        missing = float((~np.isfinite(column)).mean())
        if missing > MISSING:
            yield f"{100 * missing:.0f} % of {name} is missing"
    steps = np.diff(recording.time_s)
    if (back := steps <= 0.0).any():
        rows = f"sample {int(back.argmax()) + 2}" + (f", the first of {int(back.sum())}" if back.sum() > 1 else "")
        yield f"time_s does not increase at {rows}: the clock was set back; the workbench begins anew there"
    steps = steps[steps > 0.0]
    if steps.size and steps.max() > GAP_PERIODS * np.median(steps):
        hour = " (an hour: a clock change in spring?)" if abs(steps.max() - 3600.0) < 5.0 * np.median(steps) else ""
        yield f"the longest gap is {steps.max():.4g} s, the samples are {np.median(steps):.4g} s apart{hour}"


def _of_pressure(command_pa: Column) -> Iterator[str]:
    low, high = _ends(command_pa)
    if 0.0 < high - low < LEAST_SPAN_PA:
        yield f"commands span {high - low:.3g} Pa: are they in bar, kPa or %? Then command_pa=THEIRS:bar, or :kPa, :%"
    elif high > LARGEST_PA:
        yield f"commands go to {1e-5 * high:.3g} bar: is the unit right?"


def _of_constant(command_pa: Column) -> Iterator[str]:
    low, high = _ends(command_pa)
    if low == high:
        yield f"the command is {low:g} Pa throughout: a stem that is not driven says nothing"


def _of_action(position_m: Column, command_pa: Column) -> Iterator[str]:
    whole = np.isfinite(position_m) & np.isfinite(command_pa)
    x, u = position_m[whole], command_pa[whole]
    if x.size < 5 or np.ptp(u) == 0.0 or np.ptp(x) == 0.0:
        return
    if float(np.corrcoef(x, u)[0, 1]) < REVERSE:
        yield (
            "more pressure, less position: air closes this valve, or the position counts from the other end. "
            "The model opens with pressure: position_m=THEIRS:-% (or :-mm) counts from there"
        )


def _held(command_pa: Column) -> Column:
    """Return the commands with those in force where none is written, as of one that is kept with its changes alone."""
    known = np.isfinite(command_pa)
    return command_pa[np.maximum.accumulate(np.where(known, np.arange(known.size), 0))]


def _of_sampling(time_s: Column, position_m: Column, command_pa: Column) -> Iterator[str]:
    """Yield what is odd about when it was sampled: after the command's change, too seldom, on a historian's lines."""
    t, x, u = time_s, position_m, command_pa
    whole = np.isfinite(x) & np.isfinite(u)
    t, x, u = t[whole], x[whole], u[whole]
    if x.size < FEWEST_ROWS or np.ptp(u) == 0.0:
        return
    dx, du = np.diff(x), np.diff(u)
    moves = np.abs(dx) > MOVED * np.ptp(x)
    period_s = float(np.median(np.diff(t)))
    changes = np.flatnonzero(np.abs(du[1:-1]) > MOVED * np.ptp(u)) + 1
    rested = changes[~moves[changes - 1]]
    early, late = int(moves[rested].sum()), int((moves[rested] | moves[rested + 1]).sum())
    if rested.size >= 5 and early > RESPONDS_TOO_EARLY * rested.size:
        yield (
            f"in {early} of {late} answers the stem had moved by the row of the command's change: snapshots, the "
            "command changed between them. A row's command is in force from its time: export changes with their times"
        )
    begins = np.flatnonzero(moves & ~np.append(False, moves[:-1]))
    ends = np.flatnonzero(moves & ~np.append(moves[1:], False))
    if begins.size >= 3 and float(np.median(ends - begins + 1)) <= 2.0 and not early > RESPONDS_TOO_EARLY * rested.size:
        yield (
            f"most moves are over within two samples, {period_s:.3g} s apart: response times and friction in motion "
            "do not show; export the raw samples, not averages"
        )
    bends = np.abs(np.diff(x, 2)) < 1e-9 * np.ptp(x)
    moving = np.abs(dx[1:]) > 1e-6 * np.ptp(x)
    if moving.sum() > FEWEST_ROWS and float((bends & moving).sum() / moving.sum()) > STRAIGHT and x[1] != x[0]:
        yield "many positions lie on straight lines: the historian drew them between its samples; export raw samples"


def _ends(column: Column) -> tuple[float, float]:
    finite = column[np.isfinite(column)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
