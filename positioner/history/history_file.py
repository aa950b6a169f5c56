"""The history's file: SQLite with a write-ahead log, each batch forced to the disk before it counts as written.

A crash or a loss of power leaves all batches before it, whole. Readers never wait for the writer, nor it for them.
The file is bounded: by age, and by size, where the oldest tenth of the table with the most rows goes first, so that a
flood of one kind pushes out its own kind; the newest `ALWAYS_KEPT` rows of each stay whatever the clock says.

What is another program's, or of another version of this schema, is refused; what is damaged is set aside.
"""

import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from config.errors import InputError, explain_failure
from config.lock_file import take_lock
from config.whole_file import unreadable
from positioner.history.entries import TABLES, Entry, Event, Setting

FILE_NAME = "history.sqlite"
APPLICATION = 0x504F5331
"""In the header of the file: whose it is."""
VERSION = 1
"""Of the tables; a change of `entries` has the next."""
COLUMN_TYPES = {str: "TEXT", int: "INTEGER", float: "REAL"}
ALWAYS_KEPT = 1000  # newest rows of a table, whatever the clock says
FULL_SHARE = 0.9
"""Of the limit, above which the oldest goes: the write-ahead log needs room, too."""
BEYOND_IDS = ("-wal", "-shm")
WAL_PAGES = 128
"""After so many the write-ahead log goes into the file."""
WAL_BYTES = 1 << 20
"""What it may come to with the largest change."""
SECONDS_A_DAY = 86_400.0  # of UTC
NO_TEXT = "what it calls its tables is no text"


class HistoryFull(OSError):
    """What was to be written is not: no room, or the disk fails. It may be tried again."""


class HistoryFile:
    """The writer; one for a file, save that processes of one daemon write beside each other, each of its own valves.

    Args:
        folder: where it is, made if need be.
        keep_days: rows older than this go.
        limit_mb: of the file and its log together, MB.
        beside_another: whether another process of the same daemon has it, and has found it sound.

    Raises:
        InputError: the folder cannot be written, another daemon writes there, the file is another program's or
            another version's.
    """

    def __init__(self, folder: Path, keep_days: float, limit_mb: int, *, beside_another: bool = False) -> None:
        self.path = folder / FILE_NAME
        self.set_aside: str | None = None
        """Why the file that was there could not be used, and what it is called now."""
        self._keep_s = keep_days * SECONDS_A_DAY
        self._limit_bytes = limit_mb * 1_000_000
        self._lock: int | None = None
        if beside_another:
            try:
                self._connection = _connect(self.path)
            except sqlite3.Error as error:
                raise InputError(str(self.path), f"the history cannot be kept there: {error}") from None
            return
        with explain_failure(folder, "the history cannot be kept there"):
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = take_lock(folder / f"{FILE_NAME}.lock", "another daemon keeps its history there")
        try:
            self._connection = self._open_file()
        except BaseException:
            os.close(self._lock)
            raise

    def append(self, entries: Iterable[Entry]) -> None:
        """Write entries, all or none; they are on the disk when this returns.

        Raises:
            HistoryFull: none was written.
        """
        with self._changing():
            for entry in entries:
                self._connection.execute(_insert(type(entry)), astuple(entry))

    def expire(self, now_s: float) -> None:
        """Delete what is too old.

        Raises:
            HistoryFull: it could not be done now.
        """
        with self._changing():
            for entry in TABLES:
                if clock := clock_of(entry):
                    newest = f"(SELECT coalesce(max(rowid), 0) - {ALWAYS_KEPT} FROM {entry.TABLE})"
                    self._connection.execute(
                        f"DELETE FROM {entry.TABLE} WHERE rowid <= {newest} AND {clock} < ?", (now_s - self._keep_s,)
                    )

    def shrink(self) -> None:
        """Delete the oldest of what there is too much.

        Raises:
            HistoryFull: it could not be done now.
        """
        with self._changing():
            while self._used_bytes() > FULL_SHARE * self._limit_bytes:
                if not self._delete_a_tenth():
                    break
        with self._changing(in_one=False):
            self._connection.executescript("PRAGMA incremental_vacuum")  # `execute` frees one page and stops

    def newest_event(self, valve: str) -> Event | None:
        """Return a valve's newest event, None before its first."""
        names = ", ".join(field.name for field in fields(Event))
        said = f"SELECT {names} FROM events WHERE valve = ? ORDER BY number DESC LIMIT 1"
        found = self._connection.execute(said, (valve,)).fetchone()
        return Event(*found) if found else None

    def last_write(self) -> int:
        """Return the number of the newest write."""
        return int(self._connection.execute("SELECT max(number) FROM writes").fetchone()[0] or 0)

    def settings(self, valve: str) -> dict[str, str]:
        """Return the configuration of a valve at the last start, by key."""
        said = f"SELECT key, value FROM {Setting.TABLE} WHERE valve = ? AND value != ''"
        return dict(self._connection.execute(said, (valve,)).fetchall())

    def close(self) -> None:
        """Close the file, its log merged into it."""
        with suppress(sqlite3.Error):  # on a full disk the log stays beside it, and is as good
            self._connection.close()
        if self._lock is not None:
            os.close(self._lock)

    @contextmanager
    def _changing(self, *, in_one: bool = True) -> Iterator[None]:
        """Make changes, all or none.

        Raises:
            HistoryFull: none was made.
        """
        try:
            with self._connection:
                if in_one:
                    self._connection.execute("BEGIN IMMEDIATE")
                yield
        except sqlite3.Error as error:
            raise HistoryFull(str(error)) from None

    def _open_file(self) -> sqlite3.Connection:
        try:
            if not self.path.exists():
                _make(self.path)
            return _connect(self.path)
        except sqlite3.OperationalError as error:
            raise InputError(str(self.path), f"the history cannot be kept there: {error}") from None
        except sqlite3.DatabaseError as error:
            self._put_aside(str(error))
        return self._open_file()

    def _put_aside(self, reason: str) -> None:
        """Give a damaged file another name, with its log."""
        aside = unreadable(self.path)
        for suffix in ("", *BEYOND_IDS):
            path = self.path.with_name(self.path.name + suffix)
            if path.exists():
                path.replace(aside.with_name(aside.name + suffix))
        self.set_aside = f"{reason}; it is {aside.name} now"

    def _delete_a_tenth(self) -> int:
        """Delete the oldest tenth of the table that has the most rows; return how many they were."""
        spans = {
            entry.TABLE: self._connection.execute(
                f"SELECT count(*), coalesce(min(rowid), 0), coalesce(max(rowid), 0) FROM {entry.TABLE}"
            ).fetchone()
            for entry in TABLES
            if clock_of(entry)
        }
        table, (_, first, last) = max(spans.items(), key=lambda each: each[1][0])
        oldest = first + (last - first) // 10
        return self._connection.execute(f"DELETE FROM {table} WHERE rowid <= ?", (oldest,)).rowcount

    def _used_bytes(self) -> int:
        pages, free, size = (
            self._connection.execute(f"PRAGMA {each}").fetchone()[0]
            for each in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size) + WAL_BYTES


def require_ours(path: Path) -> None:
    """Refuse what another program or another version has written, before anything of it is touched.

    Raises:
        InputError: it is not ours, or cannot be read.
    """
    with explain_failure(path, "cannot be read"), path.open("rb") as file:
        head = file.read(100)
    if not head.startswith(b"SQLite format 3\0") or int.from_bytes(head[68:72]) != APPLICATION:
        raise InputError(str(path), "is not a history of this program")
    if (version := int.from_bytes(head[60:64])) != VERSION:
        raise InputError(str(path), f"is a history of version {version}, allowed is {VERSION}; move it away")


def require_tables(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse a file whose tables are not those that its version says: it would be read and written in part.

    Raises:
        InputError: there are others.
        DatabaseError: it is damaged.
    """
    try:
        # As bytes: in a damaged file they, and what is said of them, may be no text.
        rows = connection.execute("SELECT CAST(sql AS BLOB) FROM sqlite_master WHERE type = 'table'").fetchall()
    except UnicodeDecodeError:
        raise sqlite3.DatabaseError(NO_TEXT) from None
    if {said for (said,) in rows} != {each.encode() for each in schema()}:
        raise InputError(str(path), f"has other tables than a history of version {VERSION} has; move it away")


def _connect(path: Path) -> sqlite3.Connection:
    """Open the file to write.

    Raises:
        InputError: it is not ours, or of another version.
        DatabaseError: it is damaged; OperationalError: it cannot be opened.
    """
    require_ours(path)
    connection = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=2.0)
    try:
        if said := connection.execute("PRAGMA quick_check(1)").fetchone()[0].removeprefix("ok"):
            raise sqlite3.DatabaseError(said)
        require_tables(connection, path)
        connection.execute("PRAGMA journal_mode = WAL").fetchall()
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute(f"PRAGMA wal_autocheckpoint = {WAL_PAGES}").fetchall()
        connection.execute(f"PRAGMA journal_size_limit = {WAL_BYTES // 2}").fetchall()
    except UnicodeDecodeError:
        connection.close()
        raise sqlite3.DatabaseError(NO_TEXT) from None
    except BaseException:
        connection.close()
        raise
    return connection


def _make(path: Path) -> None:
    """Make the file with its tables under another name, then give it its own: it is never half there."""
    beside = path.with_name(path.name + ".new")
    beside.unlink(missing_ok=True)
    with closing(sqlite3.connect(beside, isolation_level=None)) as connection:
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
        connection.execute("PRAGMA synchronous = FULL")
        for statement in (f"PRAGMA application_id = {APPLICATION}", f"PRAGMA user_version = {VERSION}", *schema()):
            connection.execute(statement)
    beside.replace(path)


def schema() -> list[str]:
    """Return the statements that make the tables."""
    return [_table(entry) for entry in TABLES]


def _table(entry: type[Entry]) -> str:
    columns = [f"{field.name} {_column(field.type)}" for field in fields(entry)]
    key = [f"UNIQUE ({', '.join(entry.KEY)})"] if entry.KEY else []
    return f"CREATE TABLE {entry.TABLE} ({', '.join(columns + key)}) STRICT"


def _column(kind: object) -> str:
    assert isinstance(kind, type)
    return COLUMN_TYPES[kind] + ("" if kind is float else " NOT NULL")


def _insert(entry: type[Entry]) -> str:
    names = [field.name for field in fields(entry)]
    said = f"INSERT INTO {entry.TABLE} ({', '.join(names)}) VALUES ({', '.join('?' * len(names))})"
    others = [f"{name} = excluded.{name}" for name in names if name not in entry.KEY]
    return said + (f" ON CONFLICT ({', '.join(entry.KEY)}) DO UPDATE SET {', '.join(others)}" if entry.KEY else "")


def clock_of(entry: type[Any]) -> str | None:
    """Return the column by which a row ages; None of a table that does not grow."""
    names = {field.name for field in fields(entry)}
    return next((name for name in ("time_s", "end_s", "hour_s") if name in names), None)
