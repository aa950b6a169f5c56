"""Starts by multiple shooting: where searches of the free run have come to leaves something to explain.

Where slips follow each other closely, the free run's error is too rough for a descent to follow a valley: all that
friction does over velocity is lost between its stairs. With the run put back at each rest (`multiple_shooting`) the
valley is there to go down. The grid of strengths is screened by that error, and the best goes down by it: by every
other slip, and by those between, two starts without a common measurement. Then the free run goes on from there.

What the free run's own search came to is judged by the same error: where the descent comes not clearly below that, it
ends early.
"""

from collections.abc import Sequence

from sim.karnopp import Vector
from workbench.fit.agreement import Place
from workbench.fit.descent import COARSE, MIDDLING, WIDE, Stage, descended
from workbench.fit.objective import MIDDLE, SimulationError, smoothed
from workbench.model.free_run import FINE, ROUGH
from workbench.model.multiple_shooting import slips_from_rest

ENOUGH_SLIPS = 12
"""That begin at a rest, from which on every other will do."""
FEWEST_SLIPS = 4
GAINS = 0.9
"""Factor on the error of what is there already, below which a descent is worth while."""


def shooting_starts(error: SimulationError, grid: Sequence[Vector], best: Vector) -> list[Place]:
    """Return where multiple shooting comes to from the best of a grid; nothing where that is no better.

    Args:
        error: of the free run.
        grid: coordinates to choose from.
        best: coordinates of what the searches of the free run have come to.
    """
    if error.run.by.slow or not grid:
        return []
    slips = slips_from_rest(error.run.record)
    if slips < FEWEST_SLIPS:
        return []
    halves = {"even slips": 0, "odd slips": 1} if slips >= ENOUGH_SLIPS else {"slips": None}
    found = ((origin, _shot(error, grid, best, part)) for origin, part in halves.items())
    return [Place(z, origin) for origin, z in found if z is not None]


def _shot(error: SimulationError, grid: Sequence[Vector], best: Vector, part: int | None) -> Vector | None:
    """Return where the best of the grid goes down to, by the slips of one part; None where that gains nothing."""
    rough, fine = (error.by_slips(accuracy, part) for accuracy in (ROUGH, FINE))
    stages: Sequence[tuple[SimulationError, Stage]] = ((rough, WIDE), (rough, MIDDLING), (fine, COARSE))
    z = rough.least(grid, MIDDLE)
    for by, stage in stages:
        smooth = smoothed(by, z)
        z = descended(smooth, z, stage)
        if by.cost(z, MIDDLE) > GAINS * by.cost(best, MIDDLE):
            return None
    return z
