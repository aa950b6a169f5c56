"""Dates and times of an export as seconds from its first row: ISO 8601, or as a person says how they are written.

    2026-01-31T12:00:00.5   2026-01-31 12:00:00,5+01:00      read as they are
    31.01.2026 12:00:00     01/02/26 1:30 PM    12:00:00      --time-format "%d.%m.%Y %H:%M:%S"

Fractions may have a comma, more digits than microseconds have, or be left out where they are zero. A date that only a
person can tell (01/02/2026) is never guessed: the line that refuses it proposes the formats that would read it. A
midnight in the file tells: one way the day goes on, the other way a month passes.
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
TRIED_ROWS = 2000
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
    "%b %d, %Y",
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
_LONG_FRACTION = re.compile(r"([.,]\d{6})\d+")


def has_date(time_format: str | None) -> bool:
    """Return whether stamps of a format, or of ISO 8601, tell the day."""
    return time_format is None or re.search("%[djyYcxGs]", time_format) is not None


def seconds_of(
    path: Path, texts: Sequence[str], lines: Sequence[int], time_format: str | None
) -> tuple[Array, float, bool]:
    """Return the seconds, (n,), from the first of n stamps, the first from 1970, s, and whether these are local times.

    Raises:
        InputError: a stamp that cannot be read, or day and month are interchanged; names it, its line and the cure.
    """
    stamps = np.empty(len(texts))
    naive = False
    for row, text in enumerate(texts):
        stamp = _stamp(text, time_format)
        if stamp is None:
            raise _unreadable(path, texts, row, lines[row], time_format)
        naive = naive or stamp.tzinfo is None
        stamps[row] = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    steps_s = np.abs(np.diff(stamps, prepend=stamps[0]))
    if (
        time_format is not None
        and steps_s.max() >= DAY_S
        and _without_gaps(texts, other := _swap_day_and_month(time_format))
    ):
        row = int(steps_s.argmax())
        said = f"{texts[row]!r} is {steps_s[row] / DAY_S:.0f} days off the row before it by {time_format!r}"
        raise InputError(str(path), f'line {lines[row]}: {said}; it is not by --time-format "{other}"')
    return stamps - stamps[0], float(stamps[0]), naive


def duration_s(texts: Sequence[str]) -> float | None:
    """Return the seconds from the first of some stamps to the last; None where they cannot be read."""
    time_format = next(iter(propose_formats(texts)), None)
    try:
        return abs(float(seconds_of(Path(), texts, range(len(texts)), time_format)[0][-1]))
    except InputError:
        return None


def _swap_day_and_month(time_format: str) -> str:
    """Return a format with day and month interchanged."""
    return re.sub("%[dm]", lambda each: "%m" if each[0] == "%d" else "%d", time_format)


def _without_gaps(texts: Sequence[str], time_format: str) -> bool:
    """Return whether a format reads all stamps, each less than a day from the one before it."""
    before = None
    for text in texts:
        stamp = _by_format(text, time_format)
        if stamp is None or (before is not None and abs((stamp - before).total_seconds()) >= DAY_S):
            return False
        before = stamp
    return True


def _stamp(text: str, time_format: str | None) -> datetime | None:
    try:
        return datetime.fromisoformat(text.replace(",", "."))
    except ValueError:
        return None if time_format is None else _by_format(text, time_format)


def _by_format(text: str, time_format: str) -> datetime | None:
    """Return a stamp by a format, or by the format without its fraction; None if neither reads it."""
    plain = _LONG_FRACTION.sub(r"\1", text)
    whole = re.sub(r"[.,:]%f", "", time_format)
    if whole == "%H%M%S":  # a number has no zeros in front: 01:02:03 is 10203
        plain = re.sub(r"^\d+", lambda digits: digits[0].zfill(6), plain)
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
    if proposed := propose_formats(texts[:TRIED_ROWS]):
        said += "; it can be read with " + ", or ".join(f'--time-format "{each}"' for each in proposed)
    elif time_format is None:
        said += '; say how it is written, as in --time-format "%d.%m.%Y %H:%M:%S"'
    return InputError(str(path), said)


def propose_formats(texts: Sequence[str]) -> list[str]:
    """Return the formats that read all of some stamps, but for those that say the same, or make a midnight a month.

    >>> propose_formats(["01/02/2026 12:00:00"]), propose_formats(["31/01/2026 12:00:00"])
    (['%d/%m/%Y %H:%M:%S', '%m/%d/%Y %H:%M:%S'], ['%d/%m/%Y %H:%M:%S'])
    >>> propose_formats(["02/01/2026 23:59:59", "02/02/2026 00:00:00"])
    ['%m/%d/%Y %H:%M:%S']
    """
    fractions = any(re.search(r":\d+[.,]\d+", text) for text in texts)
    found = []
    for form in PROPOSED:
        if fractions == ("%f" in form) and texts and all(_by_format(text, form) is not None for text in texts):
            found.append(form)
    going_on = [each for each in found if _swap_day_and_month(each) in found and _without_gaps(texts, each)]
    return [each for each in found if each in going_on or _swap_day_and_month(each) not in going_on]
