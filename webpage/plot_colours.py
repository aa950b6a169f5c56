"""Colours of plots, light and dark, told apart without red and green.

What is measured is ink, a model orange, a better one teal, as in the reports and in all pictures.
"""

from dataclasses import dataclass

from config.results.drawing import BETTER, MEASURED, MODEL, QUIET


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


LIGHT = Ink(MEASURED, QUIET, "#e3e7ec", "#ffffff", MEASURED, MODEL, BETTER)
DARK = Ink("#e6eaf0", "#a3adba", "#333b46", "#12161b", "#e6eaf0", "#ff9a5c", "#4fc3b8")
