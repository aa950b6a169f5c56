"""Replaces a file whole, so that a crash or a loss of power leaves the old one or the new one, never a part.

The new text is written beside the file and forced to the disk; then it takes the file's name, and the folder, which
holds the name, is forced to the disk, too.
"""

import os
from pathlib import Path


def replace_whole(path: Path, text: str) -> None:
    """Give a file a new text, UTF-8.

    Raises:
        OSError: it cannot be written; the old file is as it was.
    """
    beside = path.with_name(path.name + ".new")
    with beside.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    beside.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Force the names that a folder holds to the disk.

    Raises:
        OSError: it cannot be.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
