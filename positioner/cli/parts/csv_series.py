"""A series over time that a person gives as a CSV file: `time_s` and one column, both complete."""

from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import Column, read_table


def read_series(path: Path, name: str) -> tuple[Column, Column]:
    """Return time, (n,), s, and the column of that name, (n,); at least two rows.

    Raises:
        InputError: as `read_table`; fewer than two rows; a value that is not a finite number.
    """
    columns, _ = read_table(path, ("time_s", name))
    time_s, values = columns["time_s"], columns[name]
    if len(values) < 2:
        raise InputError(str(path), "needs at least two rows: the last one ends the series")
    wrong = ~np.isfinite(values)
    if wrong.any():
        index = int(wrong.argmax())
        raise InputError(str(path), f"{name}: sample {index + 1} is {values[index]}, allowed are finite numbers")
    return time_s, values
