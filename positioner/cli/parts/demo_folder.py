"""The folder of `demo --out`: what an earlier demo left there is made anew, and what is somebody else's is not touched.

Its files have the names that a site's have, too: `daemon.toml`, `recordings`. Whose they are is told by the simulated
valve's file, which a demo leaves first of all.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from config.errors import InputError
from config.lock_file import take_lock
from positioner.cli.parts.output_files import make_folder
from positioner.cli.parts.simulated_plant import SLAVE_HEAD

LEFT = ("slave.toml", "daemon.toml", "recordings", "slides.toml", "slides", "run.png")
"""What demos leave, beside logs."""
RECORDINGS = "demo-*.csv"
"""The recordings of a daemon whose valve is called as theirs is."""
LOCK = "demo.lock"


@contextmanager
def demo_folder(folder: Path) -> Iterator[Path]:
    """Make the folder of a demo, without the recordings of an earlier one, and keep other demos out meanwhile.

    Raises:
        InputError: it cannot be written, another demo runs there, or it holds what no demo has left and this one would
            write over.
    """
    make_folder(folder)
    _refuse_strangers(folder)
    lock = take_lock(folder / LOCK, "another demo runs there; allowed is another folder")
    try:
        for recording in (each for name in LEFT for each in (folder / name).glob(RECORDINGS)):
            recording.unlink()
        yield folder
    finally:
        os.close(lock)


def _refuse_strangers(folder: Path) -> None:
    there = [name for name in LEFT if (folder / name).exists()]
    if there and not _is_demos(folder / "slave.toml"):
        raise InputError(f"--out {folder}", f"holds {', '.join(there)}, not of a demo; allowed is another folder")


def recording_in(folder: Path) -> Path:
    """Return what the daemon of a demo has recorded in a folder."""
    (recording,) = folder.glob(RECORDINGS)
    return recording


def _is_demos(slave: Path) -> bool:
    return slave.is_file() and slave.read_bytes().startswith(SLAVE_HEAD.encode())
