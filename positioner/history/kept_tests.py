"""Where the records of tests on a valve are kept, and when the last of them was: for the daemon, who writes none.

A record is one JSON file, `STAMP_TEST.json`, in a folder of the valve's own, below `[history] folder` or, without it,
beside the daemon's file. `positioner.tests_on_the_valve.kept_records` writes and reads the whole of them.
"""

import json
from pathlib import Path

from config.codes import ValveTestVerdict
from config.daemon_file import DaemonFile
from config.file_prefix import file_stem

FOLDER = "tests"
NO_TEST = frozenset({ValveTestVerdict.BROKEN_OFF, ValveTestVerdict.UNDETERMINED})
"""Verdicts of what tells nothing of the valve."""


def folder_of(history: Path, valve: str) -> Path:
    """Return where the records of a valve are."""
    return history / FOLDER / file_stem(valve)


def records_folder(file: DaemonFile, source: Path) -> Path:
    """Return where the records of the valve of a daemon's file are kept."""
    beside = source.parent
    return folder_of(beside if file.history is None else beside / file.history.folder, file.valve.name)


def last_tested_s(folder: Path) -> float | None:
    """Return when the newest test was that came to something, s since 1970; None without one that can be read."""
    for path in sorted(folder.glob("*.json"), reverse=True):
        try:
            told = json.loads(path.read_text(encoding="utf-8"))
            verdicts = {int(each["code"]) for each in told["outcome"]["verdicts"]}
            if verdicts.isdisjoint(NO_TEST):
                return float(told["time_s"])
        except (OSError, ValueError, KeyError, TypeError):  # the report says of such a file what is wrong with it
            continue
    return None
