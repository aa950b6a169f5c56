"""What is odd about a recording, said before anything is fitted to it: each a line that says what to do about it.

The reading may be right and the export still useless: units a thousand off, a valve that air closes, commands or set
points sampled at other moments than positions, a stem that never moves, samples too far apart to see it move, a number
read without its sign. None of this stops anybody.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from config.drive import VALVE, Kind
from config.recording import Column, Recording

LONGEST_STROKE_M = 1.5
LARGEST_PA, LEAST_SPAN_PA = 2e6, 200.0
FEWEST_JUDGED_ROWS = 50  # below these a share of rows says nothing
REVERSE = -0.5
"""Correlation of command and position below which the valve closes with pressure."""
MISSING = 0.05
"""Share of a column without a value that is worth a word."""
RESPONDS_TOO_EARLY = 0.2
"""Share of the command's changes that the stem may have followed by the same row."""
FAR = 5.0
"""Spans of all other positions between them and one that is no position."""
HISTORIAN_GAP_PERIODS = 20.0  # a longer gap: the historian stored nothing
MOVED_SHARE = 0.02
"""Of the span of the positions: what counts as a move, and of the commands: as a change."""
LONG_ROWS = 10
"""Rows for which a command is held, so that what the stem did before and after its change can be told apart."""
ANSWER_SHARE = 0.1
"""Of the span of the positions: what counts as an answer to a change."""
FEW_JUMPS = 3  # fewer may be moves of the valve
JUMP_SHARE = 0.9
"""Of the span of the positions: a jump over nearly all of it."""
WRAPS = 0.9
"""Of 65536 steps: what a register of 16 bits without its sign spans."""
SELDOM_SHARE, OFTEN = 0.2, 0.8
"""Parts of the rows in which a set point changes, and a measured position, with its noise."""
UNLIKE = 0.02
"""Ratio of the spans of position and set point below which, or over whose inverse, their units differ."""
STEADY_RUN_SHARE = 0.9
"""Part of the runs of equal positions that are as long as most, or twice, and so on."""
STRAIGHT_SHARE = 0.3
"""Share of the moving rows on straight lines, from which on a historian drew them."""


def oddities(recording: Recording, stroke_m: float | None = None) -> list[str]:
    """Return what is odd about a recording, a line each.

    Args:
        recording: as read.
        stroke_m: of its valve, if that is known.
    """
    position_m, kind = recording.position_m, recording.kind
    said = [*odd_sizes(recording, stroke_m), *_of_rows(recording)]
    whole = np.isfinite(position_m)
    if not whole.any():
        return said
    if np.ptp(position_m[whole]) == 0.0:
        where = f"{position_m[whole][0]:g} {kind.travel.si}"
        return [*said, f"the position is {where} throughout: a stem that never moves says nothing"]
    asked = _command_or_set_point(recording)
    if asked is None or (asked.name == "command_pa" and in_each_others_place(position_m, asked.values)):
        return [*said, *_of_repeats(recording.time_s, position_m, None), *_of_lines(position_m)]
    said += _of_constant(asked)
    # Of what is no position at all, nothing more is to be said.
    by_setpoint = kind is VALVE and asked.name == "reference_m"
    none_at_all = [*_of_registers(position_m, kind), *(_of_setpoint(position_m, asked.values) if by_setpoint else [])]
    if none_at_all:
        return said + none_at_all
    if kind is VALVE:
        said += [*_of_action(position_m, asked), *_of_sampling(recording.time_s, position_m, asked)]
    return [*said, *_of_repeats(recording.time_s, position_m, asked.values), *_of_lines(position_m)]


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of the stem: its column, held where none is written, what it is called, and its unit."""

    name: str
    values: Column
    words: str
    unit: str


def _command_or_set_point(recording: Recording) -> _Asked | None:
    """Return the command of a recording, or else its set point."""
    kind = recording.kind
    for name, words, unit in (
        ("command_pa", "command", kind.command.si),
        ("reference_m", "set point", kind.travel.si),
    ):
        if (column := recording.columns.get(name)) is not None and np.isfinite(column).any():
            return _Asked(name, _hold_between(column), words, unit)
    return None


def odd_settings(stroke_m: float, most_pa: float) -> str:
    """Return what is odd about a valve's stroke, m, and its largest command, Pa: those of other units; else nothing."""
    if stroke_m > LONGEST_STROKE_M:
        return f"a stroke of {stroke_m:g} m: is it in mm?"
    if not LEAST_SPAN_PA < most_pa <= LARGEST_PA:
        return f"commands of up to {most_pa:g} Pa: are they in bar, in kPa, or with a zero too many?"
    return ""


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
                    "mean that there is no value? Then leave these cells empty"
                )
    return None


def _of_rows(recording: Recording) -> Iterator[str]:
    count = len(recording)
    if count < FEWEST_JUDGED_ROWS:
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
    if steps.size and steps.max() > HISTORIAN_GAP_PERIODS * np.median(steps):
        hour = " (an hour: a clock change in spring?)" if abs(steps.max() - 3600.0) < 5.0 * np.median(steps) else ""
        yield f"the longest gap is {steps.max():.4g} s, the samples are {np.median(steps):.4g} s apart{hour}"


def _of_pressure(command_pa: Column) -> Iterator[str]:
    low, high = _ends(command_pa)
    if 0.0 < high - low < LEAST_SPAN_PA:
        yield f"commands span {high - low:.3g} Pa: are they in bar, kPa or %? Then command_pa=THEIRS:bar, or :kPa, :%"
    elif high > LARGEST_PA:
        yield f"commands go to {1e-5 * high:.3g} bar: is the unit right?"


def _of_constant(asked: _Asked) -> Iterator[str]:
    low, high = _ends(asked.values)
    if low == high:
        yield f"the {asked.words} is {low:g} {asked.unit} throughout: nothing drives the stem"


def _of_setpoint(position_m: Column, reference_m: Column) -> Iterator[str]:
    """Yield what is odd about a set point beside the travel: one signal, the other's place, another unit."""
    whole = np.isfinite(position_m) & np.isfinite(reference_m)
    x, r = position_m[whole], reference_m[whole]
    if x.size < FEWEST_JUDGED_ROWS or np.ptp(r) == 0.0:
        return
    if np.array_equal(x, r):
        yield "set point and position are equal to the last digit: which column is measured on the stem?"
        return
    changes_x, changes_r = (float((np.diff(each) != 0.0).mean()) for each in (x, r))
    if changes_x < SELDOM_SHARE and changes_r > OFTEN:
        changing = f"the set point changes in {100 * changes_r:.0f} % of the rows"
        yield f"{changing}, the position in {100 * changes_x:.0f} %: are the two columns swapped?"
    if not UNLIKE < np.ptp(x) / np.ptp(r) < 1.0 / UNLIKE:
        yield (
            f"positions go over {1e3 * np.ptp(x):.3g} mm and set points over {1e3 * np.ptp(r):.3g} mm: are both in the "
            "same unit, a share of 1, % or mm?"
        )


def _of_action(position_m: Column, asked: _Asked) -> Iterator[str]:
    whole = np.isfinite(position_m) & np.isfinite(asked.values)
    x, u = position_m[whole], asked.values[whole]
    if x.size < 5 or np.ptp(u) == 0.0 or np.ptp(x) == 0.0 or not float(np.corrcoef(x, u)[0, 1]) < REVERSE:
        return
    if asked.name == "reference_m":
        yield (
            "the position falls as the set point rises: one of them counts from the other end; "
            "position_m=THEIRS:-% (or :-mm) counts from there"
        )
        return
    yield (
        "the position falls as the pressure rises: air closes this valve, or the position counts from the other end. "
        "The model opens with pressure: position_m=THEIRS:-% (or :-mm) counts from there"
    )


def _of_registers(position_m: Column, kind: Kind) -> Iterator[str]:
    """Yield what is odd about jumps over a power of two: a register read without its sign."""
    x = position_m[np.isfinite(position_m)]
    steps = np.abs(np.diff(x))
    gaps = np.diff(np.unique(x))
    if x.size < FEWEST_JUDGED_ROWS or not gaps.size:
        return
    jumps = steps[steps > JUMP_SHARE * np.ptp(x)]
    quantum = float(gaps[gaps > 0.0].min())
    counts = float(np.ptp(x)) / quantum
    if jumps.size >= FEW_JUMPS and jumps.size < 0.5 * steps.size and WRAPS * 2**16 < counts < 2**16:
        others = steps[steps <= JUMP_SHARE * np.ptp(x)]
        if others.size and float(others.max()) < (1.0 - JUMP_SHARE) * np.ptp(x):
            yield (
                f"positions jump {jumps.size} times by nearly all of 65536 steps of {quantum:.3g} {kind.travel.si}: a "
                "register of 16 bits read without its sign? Then subtract 65536 from numbers above 32767"
            )


def _of_repeats(time_s: Column, position_m: Column, asked: Column | None) -> Iterator[str]:
    """Yield what is odd about positions that stand for several rows each: they are read more seldom than written."""
    changes = np.flatnonzero(np.diff(position_m) != 0.0)
    if changes.size < FEWEST_JUDGED_ROWS / 2:
        return
    if asked is not None:
        at = np.flatnonzero(np.diff(asked) != 0.0)
        if float(np.isin(changes, [at - 1, at, at + 1]).mean()) > OFTEN:
            return  # it moves when it is asked to, and is read coarsely
    runs = np.diff(changes)
    often = int(np.median(runs))
    if often > 1 and float((runs % often == 0).mean()) > STEADY_RUN_SHARE:
        period_s = often * float(np.median(np.diff(time_s)))
        yield (
            f"the position changes only every {often} rows: it is read every {period_s:.3g} s and written more often; "
            "export the rows in which it was read"
        )


def _hold_between(command_pa: Column) -> Column:
    """Return the commands with those in force where none is written, as of one that is kept with its changes alone."""
    known = np.isfinite(command_pa)
    return command_pa[np.maximum.accumulate(np.where(known, np.arange(known.size), 0))]


def _of_sampling(time_s: Column, position_m: Column, asked: _Asked) -> Iterator[str]:
    """Yield what is odd about when it was sampled: the stem before it is asked, too seldom."""
    t, x, u = time_s, position_m, asked.values
    whole = np.isfinite(x) & np.isfinite(u)
    t, x, u = t[whole], x[whole], u[whole]
    if x.size < FEWEST_JUDGED_ROWS or np.ptp(u) == 0.0:
        return
    dx, du = np.diff(x), np.diff(u)
    moves = np.abs(dx) > MOVED_SHARE * np.ptp(x)
    period_s = float(np.median(np.diff(t)))
    if ahead := _count_early_answers(x, u):
        yield (
            f"in {ahead[0]} of {ahead[1]} changes of the {asked.words} the stem had gone most of its way before the "
            "change: the two clocks differ, or one column is shifted in time"
        )
        return
    told_when = np.diff(np.flatnonzero(whole)) > 1  # a row of the command's own between two of the stem's
    changes = np.flatnonzero((np.abs(du) > MOVED_SHARE * np.ptp(u)) & ~told_when)
    changes = changes[(changes > 0) & (changes < du.size - 1)]
    rested = changes[~moves[changes - 1]]
    early, late = int(moves[rested].sum()), int((moves[rested] | moves[rested + 1]).sum())
    if rested.size >= 5 and early > RESPONDS_TOO_EARLY * rested.size:
        yield (
            f"in {early} of {late} changes the stem had moved by the row that first shows the new {asked.words}: the "
            f"rows are snapshots. Export each change of the {asked.words} with its own time"
        )
    begins = np.flatnonzero(moves & ~np.append(False, moves[:-1]))
    ends = np.flatnonzero(moves & ~np.append(moves[1:], False))
    if begins.size >= 3 and float(np.median(ends - begins + 1)) <= 2.0 and not early > RESPONDS_TOO_EARLY * rested.size:
        yield (
            f"most moves are over within two samples, {period_s:.3g} s apart: response times and friction in motion "
            "do not show; export the raw samples, not averages"
        )


def _count_early_answers(x: Column, u: Column) -> tuple[int, int] | None:
    """Return at how many changes, of how many, the stem was past half its way the row before; None where not at most.

    Its way is from where it was in the middle of the last hold to where it is in the middle of the next.
    """
    changes = np.flatnonzero(np.abs(np.diff(u)) > MOVED_SHARE * np.ptp(u)) + 1
    bounds = np.concatenate([[0], changes, [u.size]])
    held = np.diff(bounds)
    middles = x[(bounds[:-1] + bounds[1:]) // 2]
    way = np.diff(middles)
    told = (np.minimum(held[:-1], held[1:]) >= LONG_ROWS) & (np.abs(way) > ANSWER_SHARE * np.ptp(x))
    gone = (x[changes - 1] - middles[:-1])[told] / way[told]
    before, of = int((gone > 0.5).sum()), int(told.sum())
    return (before, of) if of >= FEW_JUMPS and before > 0.5 * of else None


def _of_lines(position_m: Column) -> Iterator[str]:
    """Yield what is odd about positions on straight lines: a historian's."""
    x = position_m[np.isfinite(position_m)]
    if x.size < FEWEST_JUDGED_ROWS:
        return
    bends = np.abs(np.diff(x, 2)) < 1e-9 * np.ptp(x)
    moving = np.abs(np.diff(x)[1:]) > 1e-6 * np.ptp(x)
    if (
        moving.sum() > FEWEST_JUDGED_ROWS
        and float((bends & moving).sum() / moving.sum()) > STRAIGHT_SHARE
        and x[1] != x[0]
    ):
        yield "many positions lie on straight lines, as a historian interpolates; export raw samples"


def _ends(column: Column) -> tuple[float, float]:
    finite = column[np.isfinite(column)]
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
