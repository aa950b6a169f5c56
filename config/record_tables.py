"""Tables `[recorder]` and `[history]`: what is kept of a valve's samples, and of what has happened to it."""

from typing import Annotated

from pydantic import Field

from config.loading import FolderName, NonNegative, Schema


class RecorderTable(Schema):
    """Table `[recorder]`: recordings in a folder, a new file at a size or an age; the oldest are deleted."""

    folder: FolderName
    file_bytes: Annotated[int, Field(ge=10_000)] = 50_000_000
    file_s: NonNegative = 86_400.0
    """A file older than this is followed by a new one; 0: only a full one is."""
    compress: bool = True
    """Those before the newest two are compressed, by a process of its own."""
    keep_files: Annotated[int, Field(ge=1)] = 20


class HistoryTable(Schema):
    """Table `[history]`: what has happened, kept in a SQLite file for as long and as large as is said here."""

    folder: FolderName
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 400.0
    limit_mb: Annotated[int, Field(ge=4, le=100_000)] = 100
