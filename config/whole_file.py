"""Replaces a file whole: a crash, a full disk or a loss of power leaves the old one or the new one, never a part.

The new one is written beside the file, and then takes its name. What must outlive a loss of power is forced to the disk
before (`replace_whole`), and so is the folder, which holds the name. Files that are of use only
together fill a folder so (`filling`), where no power is lost.
"""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def replace_whole(path: Path, text: str) -> None:
    """Give a file a new text, UTF-8.

    Raises:
        OSError: it cannot be written; the old file is as it was.
    """
    with beside(path) as new, new.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    sync_folder(path.parent)


@contextmanager
def beside(path: Path) -> Iterator[Path]:
    """Give the path at which to write what is to stand at another one: it takes that name once it is whole.

    Of a link, what it points to is replaced. A pipe or a device (`/dev/stdout`) is written itself, so is a file in a
    folder that takes no other, and one that may not be written says so.

    Raises:
        OSError: it cannot take the name; the old file is as it was.
    """
    target = path.resolve()
    replaceable = not target.exists() or (target.is_file() and os.access(target, os.W_OK))
    if not replaceable or not os.access(target.parent, os.W_OK | os.X_OK):
        yield path
        return
    new = target.with_name(target.name + ".new")
    try:
        yield new
        if target.exists():
            shutil.copymode(target, new)
        new.replace(target)
    finally:
        new.unlink(missing_ok=True)


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """Give the folder in which to write what is to fill another, a new or an empty one: that gets all of it, or none.

    Raises:
        FileExistsError: it is no folder, or not empty.
        OSError: it cannot be written.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    new = folder / ".new"
    new.mkdir()
    moved: list[Path] = []
    try:
        if any(each != new for each in folder.iterdir()):
            raise FileExistsError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY))
        yield new
        for each in sorted(new.iterdir()):
            moved.append(folder / each.name)
            each.replace(moved[-1])
        new.rmdir()
    except BaseException:
        for each in moved:
            each.unlink(missing_ok=True)
        shutil.rmtree(new, ignore_errors=True)
        with suppress(OSError):  # of another's that came into it meanwhile
            for each in made:
                each.rmdir()
        raise


def unreadable(path: Path) -> Path:
    """Return the name under which a file that cannot be read is put aside: one that is put aside already stays."""
    free, number = path.with_name(f"{path.name}.unreadable"), 1
    while free.exists():
        number += 1
        free = path.with_name(f"{path.name}.unreadable{number}")
    return free


def sync_folder(folder: Path) -> None:
    """Force the names that a folder holds to the disk, where a folder can be opened: not on Windows.

    Raises:
        OSError: it cannot be.
    """
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
