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
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
