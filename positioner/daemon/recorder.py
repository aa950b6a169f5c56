"""Writes the recording format while the cycle runs: crash-safe, rotated, bounded.

The cycle offers rows to a bounded queue and goes on. A thread writes them in whole lines, four times a second in one
system call, and every second makes sure that they are on the disk: a crash costs that second at the most. A full
or an old file is followed by a new one, the oldest beyond a number is deleted; which is older, the number at the end of
the name says, for a clock may be set back. Where no new file can be begun, recording goes on in the old one. A row that
finds the queue full is counted, and the column `unrecorded` of the next row says how many are missing before it.

The newest two files are CSV, for those who read the last minutes; those before are compressed by a process of its own
(`recording_compression`), one after another. At every moment each is there, as the one or the other.
"""

import errno
import logging
import math
import os
import time
from collections import deque
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread
from typing import Protocol

from config.drive import COLUMNS as OF_KIND
from config.drive import VALVE, Kind
from config.errors import explain_failure
from config.file_prefix import file_stem
from config.recorder_files import COLUMNS, files_of_stem, find_compressed_twins, number_of
from positioner.daemon.logs import log_event
from positioner.daemon.recording_compression import Compression, half_done

log = logging.getLogger(__name__)

Row = tuple[float, float, float, float, float, int, int]


class RowSink(Protocol):
    """What takes the rows of a cycle."""

    @property
    def unrecorded(self) -> int:
        """How many rows found no place."""
        ...

    def offer(self, row: Row) -> None:
        """Take a row without waiting."""
        ...


MOST_WAITING = 20_000
RETRY_S = 60.0
"""After a new file could not be begun for the age of the old one."""
WRITE_EVERY_S = 0.25
SYNC_EVERY_WRITES = 4


class Recorder:
    """Records rows into a folder from `start` to `stop`.

    Args:
        folder: where.
        name: of the valve.
        file_bytes: a file of so many is followed by a new one.
        keep_files: the oldest beyond so many are deleted.
        file_s: a file so old is followed by a new one; 0 is never.
        compress: those before the newest two.
        kind: whose names the columns have.
    """

    def __init__(
        self,
        folder: Path,
        name: str,
        file_bytes: int,
        keep_files: int,
        file_s: float = 0.0,
        compress: bool = False,
        kind: Kind = VALVE,
    ) -> None:
        self.unrecorded = 0
        self._folder = folder
        self._stem = file_stem(name)
        self._file_bytes = file_bytes
        self._keep_files = keep_files
        self._file_s = file_s or math.inf
        self.compression = Compression() if compress else None
        self._waiting: deque[tuple[Row, int]] = deque()
        self._stopping = Event()
        self._thread = Thread(target=self._work, name="recorder", daemon=True)
        self._valve = " ".join(name.split())
        self._columns = ",".join(kind.own(each) if each in OF_KIND else each for each in COLUMNS)
        self._file = -1
        self._room = 0
        self._begun_s = 0.0

    def start(self) -> None:
        """Make the folder and begin to record.

        Raises:
            InputError: the folder cannot be written.
        """
        with explain_failure(self._folder, "recordings cannot be written there"):
            self._folder.mkdir(parents=True, exist_ok=True)
            self._open_next()
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
        if self.compression is not None:
            self.compression.stop()

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
                    fields = {"folder": str(self._folder), "rows": len(self._waiting), "reason": error.strerror}
                    log_event(log, logging.ERROR, "the end of the recording is lost", **fields)
                    break
        os.close(self._file)

    def _write_waiting(self) -> None:
        is_old = time.monotonic() - self._begun_s >= self._file_s
        if (self._room <= 0 or is_old) and self._waiting:
            self._rotate()
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

    def _rotate(self) -> None:
        """Go on in a new file; in the old one if there can be none yet, and try again after another part of a file."""
        before = self._file
        try:
            self._open_next()
        except OSError as error:
            self._room = max(self._file_bytes // 10, 1)
            self._begun_s = time.monotonic() - self._file_s + RETRY_S
            log_event(log, logging.ERROR, "no new recording", folder=str(self._folder), reason=error.strerror)
            return
        os.fsync(before)
        os.close(before)

    def _open_next(self) -> None:
        """Begin a file, and delete the oldest beyond those to keep."""
        now = datetime.now(UTC)
        header = f"# valve: {self._valve}\n# recorded: {now:%Y-%m-%dT%H:%M:%SZ}\n{self._columns}\n".encode()
        others = files_of_stem(self._folder, self._stem)
        number = number_of(others[-1]) + 1 if others else 1
        path = self._folder / f"{self._stem}-{now:%Y%m%dT%H%M%SZ}-{number:04d}.csv"
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        try:
            written = os.write(file, header)
            if written < len(header):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            os.close(file)
            path.unlink(missing_ok=True)
            raise
        self._file, self._room, self._begun_s = file, self._file_bytes - written, time.monotonic()
        log_event(log, logging.INFO, "recording", file=str(path))
        for old in others[: max(len(others) + 1 - self._keep_files, 0)]:
            try:
                half_done(old).unlink(missing_ok=True)
                old.unlink(missing_ok=True)
            except OSError as error:
                log_event(log, logging.WARNING, "old recording stays", file=str(old), reason=error.strerror)
        if self.compression is not None:
            for path in find_compressed_twins(self._folder, self._stem):
                path.unlink(missing_ok=True)
            self.compression.begin(
                [each for each in files_of_stem(self._folder, self._stem)[:-2] if each.suffix == ".csv"]
            )


def _line(row: Row, unrecorded: int) -> str:
    return ",".join(map(repr, row)) + f",{unrecorded}\n"
