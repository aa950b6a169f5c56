"""Where a person types a number.

A browser's own field for numbers drops what it takes for no part of one: of "5,5" there is 55 left, and a valve goes
there. So this one is a field of text, and what was typed is read here or refused.
"""

import re

from nicegui import ui

from config.errors import InputError

NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
EITHER = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
"""A decimal comma where one writes so, thousands elsewhere: which of them, nobody can tell."""


def read_number(name: str, text: str) -> float | None:
    """Return the number that somebody typed, with a point or a comma; None where nothing was.

    Raises:
        InputError: it is none, or may be either of two; nothing is dropped, and nothing guessed.

    >>> read_number("reference, %", "5,5"), read_number("reference, %", " 5.5 "), read_number("reference, %", "")
    (5.5, 5.5, None)
    """
    said = text.strip()
    if not said:
        return None
    if EITHER.fullmatch(said):
        decimal, thousands = said.replace(",", "."), said.replace(",", "")
        raise InputError(name, f"type {decimal} or {thousands}; it may be either, got {said!r}")
    if not NUMBER.fullmatch(said):
        raise InputError(name, f"must be a number such as 12.5, without signs between thousands, got {said!r}")
    return float(said.replace(",", "."))


class NumberField(ui.input):
    """A field for one number; `name`: what an error calls it, its label where nothing is said."""

    def __init__(self, label: str, value: float | None = None, *, name: str = "") -> None:
        super().__init__(label, value="" if value is None else f"{value:.12g}")
        self._named = name or label
        self.props("inputmode=decimal")

    def number(self) -> float | None:
        """Return what was typed, None where nothing was.

        Raises:
            InputError: it is no number.
        """
        return read_number(self._named, str(self.value or ""))
