"""A file that a person wrote, read whole: none that waits for ever, has no end, or is no text."""

import stat
from pathlib import Path

from config.errors import InputError

MOST_BYTES = 10_000_000
"""Of a configuration or a data sheet."""
MOST_COLUMNS = 2000  # a file of more is no recording
MOST_VALUES = 250_000_000
"""Of a table that declares how large it is, as Parquet does in a few bytes: 2 GB of numbers."""


def read_plain(path: Path, what: str = "text") -> str:
    """Return a file's text.

    Args:
        path: where it is.
        what: should be in it, as messages say it.

    Raises:
        InputError: it is not there, cannot be read, is no regular file, too large, or not UTF-8 text.
    """
    source = printable(path)
    try:
        found = path.stat()
        if stat.S_ISDIR(found.st_mode):
            raise InputError(source, "cannot be read: Is a directory")
        if not stat.S_ISREG(found.st_mode):
            raise InputError(source, "is not a regular file")
        if found.st_size > MOST_BYTES:
            raise InputError(source, f"has {found.st_size} bytes, allowed are {MOST_BYTES}")
        return path.read_text(encoding="utf-8-sig")  # Windows' editors put a byte order mark before it
    except UnicodeDecodeError:
        raise InputError(source, f"is not {what}: it is not UTF-8 text") from None
    except OSError as error:
        raise InputError(source, f"cannot be read: {error.strerror}") from None
    except ValueError as error:  # of a path that no file can have
        raise InputError(source, f"cannot be read: {error}") from None


def printable(path: Path) -> str:
    """Return a path as one line of a message may hold it."""
    return str(path).replace("\0", "\\0")


def require_moderate(path: Path, rows: int, columns: int) -> None:
    """Refuse a table by the size that it declares, before it is unpacked.

    Raises:
        InputError: it is larger than any that is read.
    """
    if columns > MOST_COLUMNS or rows * columns > MOST_VALUES:
        allowed = f"allowed are {MOST_COLUMNS} columns and {MOST_VALUES} values"
        raise InputError(printable(path), f"declares {rows} rows of {columns} columns; {allowed}")
