"""What is kept of a valve over restarts is one daemon's: each of two would undo what the other wrote, unseen."""

import os
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import quote

from config.daemon_file import DaemonFile
from config.errors import explain_failure
from config.lock_file import take_lock

HEALTH, MEMORY = "health", "memory"


def valve_file_path(folder: Path, valve: str, what: str) -> Path:
    """Return the file in which a valve's HEALTH is kept, or the MEMORY of what is known of it."""
    return folder / f"{quote(valve, safe=' ')}.{what}.json"


def keep_alone(file: DaemonFile, beside: Path, on_exit: ExitStack) -> None:
    """Have the files of a valve's health and of what is known of it for this daemon alone, until the exit.

    Args:
        file: of the valve.
        beside: what its folders are seen from.
        on_exit: gives them free.

    Raises:
        InputError: another daemon has them, or a folder cannot be made.
    """
    kept = ((file.health.folder, HEALTH), (file.memory.folder, MEMORY))
    for path in (
        valve_file_path(beside / folder, file.valve.name, what) for folder, what in kept if folder is not None
    ):
        with explain_failure(path, "cannot be kept there"):
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = take_lock(path.with_name(f"{path.name}.lock"), f"another daemon keeps {path.name} there")
        on_exit.callback(os.close, lock)
