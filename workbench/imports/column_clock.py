"""The clock of some columns: time stamps, or numbers in whatever unit and from whatever day their program counts.

    t_s = factor raw,      origin_s = t_s(first) - epoch

Numbers tell by their size what they count, for every program's lie apart over the years 1990 to 2060: see `BASES`.
A clock that tells the day has an origin, so that two of them can be laid side by side; another counts from the
beginning of its file.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import Column
from workbench.imports.cell_kinds import numbers_of
from workbench.imports.cell_units import UNITS, split_unit
from workbench.imports.number_notation import is_numeral
from workbench.imports.raw_table import Cell
from workbench.imports.sample_rows import Samples
from workbench.imports.time_stamps import has_date, seconds_of

DAY_S = 86400.0


@dataclass(frozen=True, slots=True)
class TimeBase:
    """What a program's numbers count: their unit, the numbers between which they are told, and the epoch, s of 1970."""

    unit: str
    low: float
    high: float
    words: str
    epoch_s: float
    longest_step: float = np.inf
    """Between two samples; numbers that are as large may be other things."""


BASES = (
    TimeBase("100ns", 6.2e17, 6.6e17, "ticks of 100 ns since the year 1", -62_135_596_800.0),
    TimeBase("100ns", 1.2e17, 1.5e17, "FILETIME, 100 ns since 1601", -11_644_473_600.0),
    TimeBase("ns", 6.6e17, 1e19, "nanoseconds since 1970", 0.0),
    TimeBase("us", 1e14, 1e16, "microseconds since 1970", 0.0),
    TimeBase("ms", 1e11, 1e13, "milliseconds since 1970", 0.0),
    TimeBase("ud", 3e10, 8e10, "millionths of a workbook's days", -2_209_161_600.0),
    TimeBase("s", 6e8, 3e9, "seconds since 1970", 0.0),
    TimeBase("d", 30_000.0, 80_000.0, "days of a workbook", -2_209_161_600.0, 9e-4),
    TimeBase("d", 726_000.0, 753_000.0, "days since the year 0 (datenum)", -719_529.0 * DAY_S, 9e-4),
    TimeBase("d", 2_447_000.0, 2_474_000.0, "Julian days", -2_440_587.5 * DAY_S, 9e-4),
)
LARGEST_CLOCK_NUMBER = 1e19
"""Numbers of a clock: nanoseconds of 300 years."""
CALENDAR_DIGITS = (1.99e13, 2.07e13)
"""Numbers whose digits are a date and a time, 20260131115950: beyond milliseconds since 1970, short of microseconds."""
LONGEST_DIGITAL_STEP_S = 20.0
"""Of seconds that count, such a step shows some of 60 to 99, which no time of day has."""
NEVER_SECONDS = 1e10
"""Numbers from which on a mapping that says another unit is wrong: 300 years of seconds."""


@dataclass(frozen=True, slots=True)
class Clock:
    """When the rows are.

    Attributes:
        time_s: (n,), s; from the first row where there is an origin, else as counted.
        origin_s: the first row, s since 1970 as the clock shows it; None where it does not tell the day.
        local: whether it shows local time, which a clock change repeats.
        daily: whether they are times of day.
    """

    time_s: Column
    origin_s: float | None
    local: bool = False
    daily: bool = False

    @property
    def recorded(self) -> str:
        """The first row as an ISO time; "" where it does not tell the day."""
        return "" if self.origin_s is None else datetime.fromtimestamp(self.origin_s, UTC).isoformat()[:26]


def time_base(times: Column) -> TimeBase | None:
    """Return what the numbers of a clock count, told by their size; None if nothing is told: seconds from anywhere.

    >>> [time_base(each + np.arange(3)).words[:12] for each in (1.7726121e12, 6.39083097e17, 1.7726121e9)]
    ['milliseconds', 'ticks of 100', 'seconds sinc']
    """
    finite = times[np.isfinite(times)]
    if finite.size < 2:
        return None
    first, step = float(finite[0]), float(np.median(np.abs(np.diff(finite))))
    return next((each for each in BASES if each.low < first < each.high and step < each.longest_step), None)


def digits_format(times: Column) -> str | None:
    """Return the format of numbers whose digits are a time of day, with a date or without; None: they count something.

    Without a date a full minute must show it: 115959 is followed by 120000.

    >>> digits_format(np.array([115957.0, 115958.0, 115959.0, 120000.0])), digits_format(np.arange(50.0, 110.0))
    ('%H%M%S', None)
    """
    if times.size < 2:
        return None
    whole = np.floor(times)
    hour, minute, second = whole // 10_000 % 100, whole // 100 % 100, whole % 100
    if (whole < 0).any() or (hour > 23).any() or (minute > 59).any() or (second > 59).any():
        return None
    fraction = ".%f" if (whole != times).any() else ""
    if CALENDAR_DIGITS[0] < times[0] < CALENDAR_DIGITS[1]:
        return f"%Y%m%d%H%M%S{fraction}"
    steps, passed_s = np.diff(whole), np.diff(3600.0 * hour + 60.0 * minute + second)
    step = float(np.median(np.diff(times)))
    turns = passed_s[steps > passed_s]
    is_told = whole.max() < 240_000 and 0.0 < step < LONGEST_DIGITAL_STEP_S and turns.size > 0
    return f"%H%M%S{fraction}" if is_told and (turns <= 2.0 * max(step, 1.0)).any() else None


def clock_by_rows(rows: int, period_s: float) -> Clock:
    """Return the clock of rows that have no time: so far apart, from zero."""
    return Clock(period_s * np.arange(rows, dtype=np.float64), None)


def clock_of(
    path: Path,
    samples: Samples,
    theirs: str,
    mapped: str | None,
    time_format: str | None,
    decimal: str,
    option: str = "--column time_s=",
) -> Clock:
    """Return when the rows are.

    Args:
        path: for messages.
        samples: the cells.
        theirs: the clock's column.
        mapped: its unit as a person says it.
        time_format: how stamps are written, None: ISO 8601.
        decimal: the decimal sign.
        option: by which a person names it and its unit.

    Raises:
        InputError: a row without a time, or a time that is none; says what to type.
    """
    cells = samples.cells[theirs]
    first = next((cell for cell in cells if cell != ""), "")
    worded = isinstance(first, str) and not is_numeral(first) and split_unit(first)[1] is None
    stamped = mapped == "iso" or (time_format is not None and isinstance(first, str)) or worded
    if stamped and all(isinstance(cell, str) for cell in cells):
        seconds, first_s, naive = seconds_of(path, [str(cell) for cell in cells], samples.lines, time_format)
        daily = not has_date(time_format)
        return Clock(seconds, None if daily else first_s, local=naive, daily=daily and naive)
    raw = numbers_of(cells, decimal)
    if np.isnan(raw).any():
        row = int(np.isnan(raw).argmax())
        raise InputError(
            str(path),
            f"sample {row + 1} (line {samples.lines[row]}): {cells[row]!r} is neither seconds nor an ISO time stamp",
        )
    if _unit(first) is not None:
        return Clock(raw * np.array([UNITS["_s"][_unit(cell) or "s"] for cell in cells]), None)
    if (beyond := np.abs(raw) > LARGEST_CLOCK_NUMBER).any():
        row = int(beyond.argmax())
        raise InputError(str(path), f"line {samples.lines[row]}: {cells[row]!r} in {theirs!r} is no time")
    said = mapped or _in_header(samples, theirs)
    if (written := digits_format(raw)) and (said is None or raw[0] > NEVER_SECONDS):
        problem = f"{cells[0]!r} in {theirs!r} is no time in seconds: its digits are a time of day"
        counts = "" if has_date(written) else f", or {option}{theirs}:s if it counts"
        raise InputError(str(path), f'{problem}: type --time-format "{written}"{counts}')
    unit, base = said or "s", time_base(raw)
    if base is None:
        return Clock(raw * UNITS["_s"][unit], None)
    if base.unit != unit and (said is None or abs(raw[0]) > NEVER_SECONDS):
        problem = f"{cells[0]!r} in {theirs!r} is no time in {'seconds' if unit == 's' else unit}"
        raise InputError(str(path), f"{problem}: type {option}{theirs}:{base.unit}, {base.words}")
    factor = UNITS["_s"][unit]
    if base.unit != unit:
        return Clock(raw * factor, None)
    return Clock((raw - raw[0]) * factor, float(raw[0] * factor + base.epoch_s))


def _in_header(samples: Samples, theirs: str) -> str | None:
    unit, _ = samples.header.units.get(theirs, ("", 0))
    return unit if unit in UNITS["_s"] else None


def _unit(cell: Cell) -> str | None:
    unit = split_unit(cell)[1] if isinstance(cell, str) else None
    return unit if unit in UNITS["_s"] else None
