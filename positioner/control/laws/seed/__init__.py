"""The seed's law: one pressure for each reference, in open loop.

    seed_law    its equation

It has no settings of its own, and remembers its command alone.
"""

from positioner.control.laws.seed.seed_law import SeedSettings as Settings

__all__ = ["Settings"]
