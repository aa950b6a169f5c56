"""PI on position, as a conventional positioner has it: the reference for comparison.

    conventional_law    its equation

It learns nothing.
"""

from positioner.control.laws.conventional.conventional_law import ConventionalSettings as Settings

__all__ = ["Settings"]
