"""Dates and times of an export as seconds from its first row: ISO 8601, or as a person says how they are written.

    2026-01-31T12:00:00.5   2026-01-31 12:00:00,5+01:00      read as they are
    31.01.2026 12:00:00     01/02/26 1:30 PM    12:00:00      --time-format "%d.%m.%Y %H:%M:%S"

Fractions may have a comma, more digits than microseconds have, or be left out where they are zero. A date that only a
person can tell (01/02/2026) is never guessed: the line that refuses it proposes the formats that would read it.
"""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import product
from pathlib import Path

import numpy as np
import numpy.typing as npt

from config.errors import InputError

Array = npt.NDArray[np.float64]
DAY_S = 86400.0
TRIED = 2000
"""Rows that a proposed format must read."""
_DATES = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%Y/%m/%d", "%Y.%m.%d")
_SHORT_DATES = (
    "%d.%m.%y",
    "%d/%m/%y",
    "%m/%d/%y",
    "%d-%m-%y",
    "%y-%m-%d",
    "%d-%b-%Y",
    "%d-%b-%y",
    "%d %b %Y",
    "%b %d %Y",
)
_TIMES = ("%H:%M:%S", "%H:%M:%S.%f", "%I:%M:%S %p", "%I:%M:%S.%f %p", "%H:%M", "%I:%M %p", "%H:%M:%S:%f", "%H.%M.%S")
PROPOSED = (
    *(
        f"{date}{between}{time}"
        for date, between, time in product(_DATES + _SHORT_DATES, (" ", ", ", "T", "-"), _TIMES)
    ),
    *_TIMES,
    "%Y%m%d%H%M%S",
    "%Y%m%d %H%M%S",
    "%Y%m%dT%H%M%S.%f",
)
CLOCKS = (("ms", 1e11, 1e13, "milliseconds since 1970"), ("us", 1e14, 1e16, "microseconds since 1970"))
"""Units of clocks, between which numbers they are told: from 1973 to 2286."""
WORKBOOK_DAYS, LONGEST_STEP_D = (30_000.0, 80_000.0), 9e-4
"""Numbers of days, from 1982 to 2119, that a workbook's dates are without their format, and a step between two."""
_LONG_FRACTION = re.compile(r"([.,]\d{6})\d+")


def has_date(time_format: str | None) -> bool:
    """Return whether stamps of a format, or of ISO 8601, tell the day."""
    return time_format is None or re.search("%[djyYcxGs]", time_format) is not None


def clock_unit(times: Array) -> tuple[str, str] | None:
    """Return the unit of a clock whose numbers are no seconds, and what it counts; None if they may be seconds.

    >>> clock_unit(np.array([1.7726121e12, 1.7726121001e12])), clock_unit(np.array([46085.25, 46085.250001]))
    (('ms', 'milliseconds since 1970'), ('d', 'days of a workbook'))
    """
    finite = times[np.isfinite(times)]
    if finite.size < 2:
        return None
    first, steps = float(finite[0]), np.abs(np.diff(finite))
    for unit, low, high, words in CLOCKS:
        if low < first < high:
            return unit, words
    low_d, high_d = WORKBOOK_DAYS
    if low_d < first < high_d and 0.0 < float(np.median(steps)) < LONGEST_STEP_D:
        return "d", "days of a workbook"
    return None


def seconds_of(
    path: Path, texts: Sequence[str], lines: Sequence[int], time_format: str | None
) -> tuple[Array, float | None]:
    """Return the seconds, (n,), from the first of n stamps, and where these are local times, the first from 1970, s.

    Raises:
        InputError: a stamp that cannot be read; names it and its line and what would read it.
    """
    stamps = np.empty(len(texts))
    naive = False
    for row, text in enumerate(texts):
        stamp = _stamp(text, time_format)
        if stamp is None:
            raise _unreadable(path, texts, row, lines[row], time_format)
        naive = naive or stamp.tzinfo is None
        stamps[row] = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    return stamps - stamps[0], float(stamps[0]) if naive else None


def _stamp(text: str, time_format: str | None) -> datetime | None:
    try:
        return datetime.fromisoformat(text.replace(",", "."))
    except ValueError:
        return None if time_format is None else _by_format(text, time_format)


def _by_format(text: str, time_format: str) -> datetime | None:
    """Return a stamp by a format, or by the format without its fraction; None if neither reads it."""
    plain = _LONG_FRACTION.sub(r"\1", text)
    whole = re.sub(r"[.,:]%f", "", time_format)
    for words, form in ((plain, time_format), (plain.replace(",", "."), time_format), (plain, whole)):
        try:
            return datetime.strptime(words, form)
        except (ValueError, re.error):
            continue
    return None


def _unreadable(path: Path, texts: Sequence[str], row: int, line: int, time_format: str | None) -> InputError:
    said = f"sample {row + 1}: {texts[row]!r} is neither seconds nor an ISO time stamp (2026-01-31T12:00:00.5)"
    if time_format is not None:
        said = f"sample {row + 1} (line {line}): {texts[row]!r} is not as --time-format {time_format!r} says"
    if proposed := proposed_formats(texts[:TRIED]):
        said += "; it can be read with " + ", or ".join(f'--time-format "{each}"' for each in proposed)
    elif time_format is None:
        said += '; say how it is written, as in --time-format "%d.%m.%Y %H:%M:%S"'
    return InputError(str(path), said)


def proposed_formats(texts: Sequence[str]) -> list[str]:
    """Return the formats that read all of some stamps, but for those that say the same.

    >>> proposed_formats(["01/02/2026 12:00:00"]), proposed_formats(["31/01/2026 12:00:00"])
    (['%d/%m/%Y %H:%M:%S', '%m/%d/%Y %H:%M:%S'], ['%d/%m/%Y %H:%M:%S'])
    """
    fractions = any(re.search(r":\d+[.,]\d+", text) for text in texts)
    found = []
    for form in PROPOSED:
        if fractions == ("%f" in form) and texts and all(_by_format(text, form) is not None for text in texts):
            found.append(form)
    return found
