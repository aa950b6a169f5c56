"""Whether a file is a recording of our own format, or another program's export that must be mapped."""

from pathlib import Path

from config.errors import InputError
from config.recording import Recording


def own_recording(path: Path) -> Recording | None:
    """Return a recording of our own format; None if the file is none.

    Raises:
        InputError: it is one, but broken; names column or line, value and what is allowed.
    """
    try:
        return Recording.read(path)
    except InputError as error:
        if "is missing" in error.problem or "not a CSV" in error.problem or "Parquet" in error.problem:
            return None
        raise
