"""A reference that waits: another than the stem's place, written outside automatic, and followed as soon as that is on.

Who wrote it stands in the daemon's history, where that is kept and can be read.
"""

import math
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from config.codes import Mode
from config.errors import InputError
from positioner.history import HistoryReader
from positioner.history.entries import Write

SAME_PU = 1e-4
"""Of the stroke: the register's other form counts in steps of so much."""
WAITS = ("reference_opening", "reference_in_force", "mode")
"""By which registers it waits; of one request, for outside automatic both follow the stem where none was written."""
NEWEST = 200
"""Writes that are looked through."""
ITS_WRITE = re.compile(r"\breference(_scaled)? = ")


@dataclass(frozen=True, slots=True)
class Writer:
    """Who wrote a register, and when last, s since 1970."""

    peer: str
    who: str
    role: str
    time_s: float

    @property
    def words(self) -> str:
        """The same in words, by this machine's clock and zone."""
        name = f"{self.who} ({self.role}) at {self.peer}" if self.who else self.peer
        return f"{name}, {time.strftime('%Y-%m-%d %H:%M:%S %Z', time.localtime(self.time_s))}"


def waiting_reference(values: Mapping[str, float]) -> float | None:
    """Return the opening, p.u., that automatic will take the stem to, by registers; None if there is none."""
    asked, stands = values.get("reference_opening", math.nan), values.get("reference_in_force", math.nan)
    apart = abs(asked - stands)
    waits = math.isfinite(apart) and apart > SAME_PU and values.get("mode") != Mode.AUTOMATIC
    return asked if waits else None


def reference_writer(folder: Path | None, valve: str) -> Writer | None:
    """Return who wrote a valve's reference last, None where nobody knows; `folder` is that of the daemon's history."""
    if folder is None:
        return None
    try:
        with HistoryReader(folder) as history:
            newest = reversed(history.rows(Write, valve, limit=NEWEST))
            its = (row for _, row in newest if row.what == "write" and ITS_WRITE.search(row.text))
            row = next(its, None)
    except InputError:
        return None
    return None if row is None else Writer(row.peer, row.who, row.role, row.end_s)
