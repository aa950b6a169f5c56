"""The seed's law: one pressure for each reference, in open loop.

    seed_law    its equation
    course      in which direction the stem comes to its reference

It has no settings of its own.
"""

from positioner.control.laws.seed.seed_law import SeedSettings as Settings

__all__ = ["Settings"]
