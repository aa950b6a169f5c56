"""Friction against its baseline, kept in a file over restarts of whoever looks: a row a minute, a month at the most.

    unix_s,friction_pa,baseline_pa

A row is written whole or, if the machine dies meanwhile, not at all: a line that is none is left out when it is read.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from config.errors import InputError
from config.file_stem import file_stem
from config.whole_file import replace_whole

HEAD = "unix_s,friction_pa,baseline_pa"
FrictionRow = tuple[float, float, float]
"""Time, s, friction and its baseline, Pa."""


class FrictionFile:
    """The file of one valve.

    Args:
        folder: where it lies; made if it is not there.
        name: of the valve.
        most: rows that are kept.

    Raises:
        InputError: it can be neither made nor written.
    """

    def __init__(self, folder: Path, name: str, most: int) -> None:
        self.path = folder / f"friction-{file_stem(name)}.csv"
        self._most = most
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.rows: Sequence[FrictionRow] = self._read()[-most:]
            lines = [HEAD, *(_line(row) for row in self.rows)]
            replace_whole(self.path, "\n".join(lines) + "\n")
        except OSError as error:
            raise InputError(str(self.path), f"cannot be kept: {error.strerror}") from None

    def append(self, row: FrictionRow) -> None:
        """Add a row; a disk that is full loses it."""
        with suppress(OSError), self.path.open("a", encoding="ascii") as file:
            file.write(_line(row) + "\n")

    def _read(self) -> list[FrictionRow]:
        if not self.path.exists():
            return []
        text = self.path.read_text(encoding="ascii", errors="replace")
        return [row for line in text.splitlines()[1:] if (row := _row(line)) is not None]


def _line(row: FrictionRow) -> str:
    return f"{row[0]:.0f},{row[1]:.1f},{row[2]:.1f}"


def _row(line: str) -> FrictionRow | None:
    try:
        unix_s, friction_pa, baseline_pa = map(float, line.split(","))
    except ValueError:
        return None
    return (unix_s, friction_pa, baseline_pa) if math.isfinite(unix_s) else None
