"""Writes the recording format while the cycle runs: crash-safe, rotated, bounded.

The cycle offers rows to a bounded queue and goes on. A thread writes them in whole lines, four times a second in one
system call, and every second makes sure that they are on the disk: a crash costs that second at the most. A full
file is followed by a new one, the oldest beyond a number is deleted. A row that finds the queue full is counted,
and the column `unrecorded` of the next row says how many are missing before it.
"""

import errno
import logging
import os
import re
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread

from config.errors import InputError
from positioner.daemon.logs import log_event

log = logging.getLogger(__name__)

COLUMNS = (
    "time_s",
    "command_pa",
    "position_m",
    "pressure_pa",
    "reference_m",
    "state",
    "lost_samples",
    "unrecorded",
)
Row = tuple[float, float, float, float, float, int, int]
"""A row as offered: the columns without the last."""

MOST_WAITING = 20_000
WRITE_EVERY_S = 0.25
SYNC_EVERY_WRITES = 4


class Recorder:
    """Records rows into a folder from `start` to `stop`."""

    def __init__(self, folder: Path, name: str, file_bytes: int, keep_files: int) -> None:
        self.unrecorded = 0
        self._folder = folder
        self._stem = _stem(name)
        self._file_bytes = file_bytes
        self._keep_files = keep_files
        self._waiting: deque[tuple[Row, int]] = deque()
        self._stopping = Event()
        self._thread = Thread(target=self._work, name="recorder", daemon=True)
        self._file = -1
        self._room = 0
        self._number = 0

    def start(self) -> None:
        """Make the folder and begin to record.

        Raises:
            InputError: the folder cannot be written.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._open_next()
        except OSError as error:
            raise InputError(str(self._folder), f"recordings cannot be written there: {error.strerror}") from None
        self._thread.start()

    def offer(self, row: Row) -> None:
        """Take a row if there is room. Never blocks."""
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append((row, self.unrecorded))
        else:
            self.unrecorded += 1

    @property
    def waiting(self) -> int:
        """How many rows are not yet written."""
        return len(self._waiting)

    def stop(self) -> None:
        """Write what waits and close the file."""
        self._stopping.set()
        self._thread.join()

    def _work(self) -> None:
        writes, failed = 0, False
        while not self._stopping.wait(WRITE_EVERY_S) or self._waiting:
            try:
                self._write_waiting()
                writes += 1
                if writes % SYNC_EVERY_WRITES == 0:
                    os.fsync(self._file)
                failed = False
            except OSError as error:
                if not failed:
                    log_event(log, logging.ERROR, "recording fails", folder=str(self._folder), reason=error.strerror)
                failed = True
                if self._stopping.is_set():
                    break
        os.close(self._file)

    def _write_waiting(self) -> None:
        if self._room <= 0:
            os.fsync(self._file)
            os.close(self._file)
            self._open_next()
        batch = [self._waiting.popleft() for _ in range(len(self._waiting))]
        data = "".join(_line(*each) for each in batch).encode()
        try:
            self._write(data)
        except OSError:
            self._waiting.extendleft(reversed(batch))
            raise
        self._room -= len(data)

    def _write(self, data: bytes) -> None:
        """Write all of it or nothing: a full disk takes a part, and a torn line would end the file."""
        written = os.write(self._file, data) if data else 0
        if written < len(data):
            os.ftruncate(self._file, os.lseek(self._file, 0, os.SEEK_END) - written)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _open_next(self) -> None:
        now = datetime.now(UTC)
        stamp = now.strftime("%Y%m%dT%H%M%SZ")
        self._number += 1
        path = self._folder / f"{self._stem}-{stamp}-{self._number:04d}.csv"
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        header = f"# valve: {self._stem}\n# recorded: {now:%Y-%m-%dT%H:%M:%SZ}\n{','.join(COLUMNS)}\n".encode()
        self._room = self._file_bytes - os.write(self._file, header)
        for old in _files(self._folder, self._stem)[: -self._keep_files]:
            old.unlink()
        log_event(log, logging.INFO, "recording", file=str(path))


def files_of(folder: Path, name: str) -> list[Path]:
    """Return the recordings of a valve in a folder, oldest first."""
    return _files(folder, _stem(name))


def _files(folder: Path, stem: str) -> list[Path]:
    # By its whole name: a valve FV-1 must not take what belongs to a valve FV-1-A.
    mine = re.compile(re.escape(stem) + r"-\d{8}T\d{6}Z-\d+\.csv")
    return sorted(each for each in folder.iterdir() if mine.fullmatch(each.name))


def _stem(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name)


def _line(row: Row, unrecorded: int) -> str:
    return ",".join(map(repr, row)) + f",{unrecorded}\n"
