"""A line that passes on a terminal: it stands in the place of the one before."""

import os
from typing import TextIO

USUAL_COLUMNS = 80
"""Of a terminal that does not say."""


def passing(text: str, stream: TextIO) -> str:
    """Return what shows a line so, its middle left out where a terminal is too narrow: a second row would stay."""
    room = _columns(stream) - 1
    if len(text) > room:
        head = room // 2
        text = f"{text[: head - 2]}..{text[head - room :]}"
    return f"\r\033[K{text}"


def _columns(stream: TextIO) -> int:
    try:
        return os.get_terminal_size(stream.fileno()).columns or USUAL_COLUMNS
    except OSError:
        return USUAL_COLUMNS
