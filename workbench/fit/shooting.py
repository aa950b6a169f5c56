"""Starts by multiple shooting: where searches of the free run have come to leaves something to explain.

Where slips follow each other closely, the free run's error is too rough for a descent to follow a valley: all that
friction does over velocity is lost between its stairs. With the run put back at each rest (`multiple_shooting`) the
valley is there to go down. The base fit has taken for friction what the effect does, so that of the strengths tried
there the least error leads astray: from each of them, viscous friction scanned, a search goes down, and where that of
all slips comes to the least it goes on, and others begin: by every other slip, and by those between, two without a
common measurement. Then the free run goes on from there. Behind a positioner there are none: it has set the pressure by
where the simulated stem was, which is not where it is put back to.

What the free run's own search came to is judged by the same error: where the descent comes not clearly below that, it
ends early.
"""

from collections.abc import Sequence

from sim.composition import VISCOUS
from sim.karnopp import Vector
from workbench.fit.agreement import SHARED, Place
from workbench.fit.descent import COARSE, MIDDLING, WIDE, descended
from workbench.fit.objective import MIDDLE, SimulationError, smoothed
from workbench.fit.starts import scaled
from workbench.model.free_run import FINE, ROUGH
from workbench.model.multiple_shooting import slips_from_rest

ENOUGH_SLIPS = 12
"""That begin at a rest, from which on every other will do."""
FEWEST_SLIPS = 4
GAINS = 0.9
"""Factor on the error of what is there already, below which a descent is worth while."""
HOPELESS = 5.0
"""Factor on the least error of all strengths, above which no search begins at one."""
LESS_VISCOUS = (0.1, 0.3, 1.0)
"""Of the base fit's, which has taken a lag for friction."""

Strength = Sequence[Vector]
"""Coordinates of an effect's strength at a base fit, of which the best is begun at."""


def shooting_starts(error: SimulationError, strengths: Sequence[Strength], best: Vector) -> list[Place]:
    """Return where multiple shooting comes to from the strengths; nothing where that is no better.

    Args:
        error: of the free run.
        strengths: what is tried of an effect.
        best: coordinates of what the searches of the free run have come to.
    """
    record = error.run.record
    if error.run.by.slow or record.by_setpoint or not strengths:
        return []
    slips = slips_from_rest(record)
    if slips < FEWEST_SLIPS:
        return []
    rough = error.by_slips(ROUGH)
    strength, z = _best_strength(rough, [_with_less_viscosity(error, each) for each in strengths])
    if rough.cost(z, MIDDLE) > GAINS * rough.cost(best, MIDDLE):
        return []
    halves = {"even slips": 0, "odd slips": 1} if slips >= ENOUGH_SLIPS else {}
    found = {SHARED: _shot(error, z, best, None)} | {
        origin: _shot(error, error.by_slips(ROUGH, part).least(strength, MIDDLE), best, part)
        for origin, part in halves.items()
    }
    return [Place(z, origin) for origin, z in found.items() if z is not None]


def _best_strength(rough: SimulationError, strengths: Sequence[Strength]) -> tuple[Strength, Vector]:
    """Return the strength from which a search comes to the least, and where it comes to; hopeless ones are left out."""
    begins = [(each, rough.least(each, MIDDLE)) for each in strengths]
    most = HOPELESS * min(rough.cost(z, MIDDLE) for _, z in begins)
    ends = [(each, descended(smoothed(rough, z), z, WIDE)) for each, z in begins if rough.cost(z, MIDDLE) <= most]
    return min(ends, key=lambda end: rough.cost(end[1], MIDDLE))


def _with_less_viscosity(error: SimulationError, places: Strength) -> list[Vector]:
    return [error.coordinates(scaled(error.theta(z), VISCOUS, factor)) for z in places for factor in LESS_VISCOUS]


def _shot(error: SimulationError, z: Vector, best: Vector, part: int | None) -> Vector | None:
    """Return where a start goes down to, by the slips of one part; None where that gains nothing."""
    rough, fine = (error.by_slips(accuracy, part) for accuracy in (ROUGH, FINE))
    for by, stage in ((rough, WIDE), (rough, MIDDLING), (fine, COARSE)):
        z = descended(smoothed(by, z), z, stage)
        if by.cost(z, MIDDLE) > GAINS * by.cost(best, MIDDLE):
            return None
    return z
