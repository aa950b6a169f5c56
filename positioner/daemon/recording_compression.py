"""Compresses closed recordings: in a process of its own, as nice as can be, so that it takes no cycle's time.

Each file is compressed beside itself, read back and compared, forced to the disk, renamed, and only then is the plain
one deleted: a crash or a full disk at any moment leaves the one or the other, whole. What is half done is done anew.

    python -P -m positioner.daemon.recording_compression FILE...      is what it runs
"""

import gzip
import logging
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from shutil import copyfileobj

from config.whole_file import sync_folder
from positioner.daemon.logs import log_event

log = logging.getLogger(__name__)

BLOCK_BYTES = 1 << 20
ENDING_S = 2.0


class Compression:
    """The process, while there is one. In the recorder's thread."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None

    def begin(self, files: Sequence[Path]) -> None:
        """Compress files; those of a process that still works are left to it, and the others to the next time."""
        if self.process is not None:
            if (status := self.process.poll()) is None:
                return
            if status:
                log_event(log, logging.WARNING, "recordings stay uncompressed", status=status)
            self.process = None
        if files:
            words = [sys.executable, "-P", "-m", "positioner.daemon.recording_compression", *map(str, files)]
            try:
                self.process = subprocess.Popen(words, stdin=subprocess.DEVNULL, start_new_session=True)
            except OSError as error:
                log_event(log, logging.WARNING, "recordings stay uncompressed", reason=error.strerror)

    def stop(self) -> None:
        """End it; what is left is done after the next start."""
        if self.process is not None:
            self.process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(ENDING_S)
            self.process.kill()
            self.process.wait()
            self.process = None


def half_done(path: Path) -> Path:
    """Return where a file is compressed, before it gets its name."""
    return path.with_name(f"{path.name}.gz.new")


def compress(path: Path) -> None:
    """Put a file's compressed twin in its place.

    Raises:
        OSError: it cannot be; the plain one is as it was.
    """
    beside = half_done(path)
    try:
        with path.open("rb") as plain, beside.open("wb") as packed:
            with gzip.GzipFile(path.name, "wb", 6, packed, mtime=path.stat().st_mtime) as into:
                copyfileobj(plain, into, BLOCK_BYTES)
            packed.flush()
            os.fsync(packed.fileno())
        if not reads_back(path, beside):
            raise OSError(f"{beside}: does not read back as it was written")
        beside.replace(path.with_name(f"{path.name}.gz"))
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)
    path.unlink(missing_ok=True)


def reads_back(path: Path, packed: Path) -> bool:
    """Return whether a compressed file holds what the plain one does."""
    with path.open("rb") as plain, gzip.open(packed) as back:
        while block := plain.read(BLOCK_BYTES):
            if back.read(len(block)) != block:
                return False
        return not back.read(1)


def _work(files: Sequence[str]) -> int:
    """Compress files; 1 if one could not be."""
    os.nice(19)
    status = 0
    for file in files:
        try:
            compress(Path(file))
        except FileNotFoundError:
            continue  # deleted meanwhile, for it was the oldest
        except OSError as error:
            print(f"{file}: stays uncompressed: {error.strerror or error}", file=sys.stderr)
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(_work(sys.argv[1:]))
