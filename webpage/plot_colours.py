"""Colours of plots, light and dark, told apart without red and green.

What is measured is ink, a model orange, a better one teal, as in the reports.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Ink:
    """Colours of plots."""

    text: str
    quiet: str
    grid: str
    paper: str
    measured: str
    model: str
    better: str


LIGHT = Ink("#1f2a37", "#5b6675", "#e3e7ec", "#ffffff", "#1f2a37", "#d9622b", "#1b7f79")
DARK = Ink("#e6eaf0", "#a3adba", "#333b46", "#12161b", "#e6eaf0", "#ff9a5c", "#4fc3b8")
