"""An effect of a person's own: the example it begins with, and whether its file is one that a search may try."""

from pathlib import Path

from config.errors import InputError
from config.valve_file import ValveParameters
from sim.effect import SHIPPED, Effect, read_effect, shipped_effects
from sim.kernel import kernel

EXAMPLE = SHIPPED / "_tight_spot.py"
"""The example of docs/effects.md; no effect that comes along."""


def check_effect(path: Path, valve: ValveParameters) -> Effect:
    """Return an effect that reads, compiles, and says where a fit of this valve may start; its text is run.

    Raises:
        InputError: it does not; says the line where one is to blame.
    """
    if path.stem in shipped_effects():
        raise InputError(str(path), "an effect that comes with the package has this name: choose another")
    effect = read_effect(path)
    effect.off(valve)
    effect.strengths(valve)
    kernel([effect])
    return effect
