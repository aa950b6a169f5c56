"""Reads a history while a daemon writes it, for commands and pages. Each question sees one state of the file, whole.

with HistoryReader(path) as history:
    newest = history.events(limit=20)
    later = history.rows(Event, after_row=newest[-1][0])
"""

import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import fields
from math import nan
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar
from urllib.parse import quote

from config.errors import InputError
from positioner.history.entries import Entry, Event
from positioner.history.history_file import FILE_NAME, clock_of, require_ours, require_tables

E = TypeVar("E", bound=Entry)


class HistoryReader:
    """Of one file, or of the one in a folder; used as a context, in one thread.

    Raises:
        InputError: there is none, or it is another program's or another version's.
    """

    def __init__(self, path: Path) -> None:
        self.path = path / FILE_NAME if path.is_dir() else path
        require_ours(self.path)
        try:
            self._connection = sqlite3.connect(f"file:{quote(str(self.path))}?mode=ro", uri=True, isolation_level=None)
        except sqlite3.Error as error:
            raise InputError(str(self.path), f"cannot be read: {error}") from None
        try:
            require_tables(self._connection, self.path)
        except (sqlite3.Error, InputError) as error:
            self._connection.close()
            if isinstance(error, InputError):
                raise
            raise InputError(str(self.path), f"cannot be read: {error}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._connection.close()

    def events(self, valve: str | None = None, since_s: float | None = None, limit: int | None = None) -> list[Event]:
        """Return the newest events, oldest first."""
        return [event for _, event in self.rows(Event, valve, since_s, limit=limit)]

    def valves(self) -> list[str]:
        """Return the names of the valves that anything has happened to.

        Raises:
            InputError: the file is damaged, or cannot be read any more.
        """
        try:
            found = self._connection.execute(f"SELECT DISTINCT valve FROM {Event.TABLE} ORDER BY valve").fetchall()
        except sqlite3.Error as error:
            raise InputError(str(self.path), f"cannot be read: {error}") from None
        return [name for (name,) in found]

    def rows(
        self,
        of: type[E],
        valve: str | None = None,
        since_s: float | None = None,
        *,
        after_row: int = 0,
        limit: int | None = None,
    ) -> list[tuple[int, E]]:
        """Return the newest entries of a table, oldest first, each with the number of its row.

        Args:
            of: which table.
            valve: only this valve's; a session may be about any, and is every valve's.
            since_s: only from then on, s since 1970.
            after_row: only those that came after this row.
            limit: at most so many.

        Raises:
            InputError: the file is damaged, or cannot be read any more.
        """
        names = ", ".join(field.name for field in fields(of))
        conditions, values = _conditions(of, valve, since_s, after_row)
        query = f"SELECT rowid, {names} FROM {of.TABLE} WHERE {conditions} ORDER BY rowid DESC LIMIT ?"
        try:
            found = self._connection.execute(query, (*values, -1 if limit is None else limit)).fetchall()
        except sqlite3.Error as error:
            raise InputError(str(self.path), f"cannot be read: {error}") from None
        return [(row, _entry(of, columns)) for row, *columns in reversed(found)]


def _conditions(of: type[Any], valve: str | None, since_s: float | None, after_row: int) -> tuple[str, list[Any]]:
    conditions = ["rowid > ?"]
    values: list[Any] = [after_row]
    if valve is not None:
        conditions.append("valve IN (?, '')")
        values.append(valve)
    if since_s is not None and (clock := clock_of(of)):
        conditions.append(f"{clock} >= ?")
        values.append(since_s)
    return " AND ".join(conditions), values


def _entry(of: type[E], columns: Sequence[Any]) -> E:
    kinds = [field.type for field in fields(of)]
    made: Callable[..., E] = of
    return made(
        *(nan if value is None and kind is float else value for value, kind in zip(columns, kinds, strict=True))
    )
