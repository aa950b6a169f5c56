"""The history that lasts on a gateway: one SQLite file for all valves of a daemon. It knows `config` alone.

One daemon writes; whoever may read the file reads it meanwhile. `docs/history.md` has the tables.

    entries                       what is kept, a table a class
    history_file                  the file: opened or refused, written, bounded by age and size
    history_reader                what is in it, for commands and pages
    kept_tests                    where the records of tests on a valve are, and when the last was
"""

from positioner.history.history_file import FILE_NAME, HistoryFile, HistoryFull
from positioner.history.history_reader import HistoryReader

__all__ = ["FILE_NAME", "HistoryFile", "HistoryFull", "HistoryReader"]
"""The writer, the reader, and what the file is called in its folder."""
