"""Multiple shooting: the run is put back to where the stem was measured at rest, before each of its slips.

In a free run an error of one landing moves all break-aways after it, by whole samples of the command: of a stick-slip
motion the error is a staircase whose steps hide every valley. Put back, each slip answers for itself, and the error is
smooth in all that a slip shows by its course: friction over velocity, damping, spring.

    x_j = mean of the measured positions of the rest before slip j, at its last sample     v_j = 0

Pressure and the effects' memories go on as simulated: they are not measured. It judges nothing: it sees positions.
"""

import numpy as np

from sim.composition import Composition
from sim.karnopp import Vector
from workbench.data.motion import slips
from workbench.data.record import Mask, Record
from workbench.model.free_run import FINE, Accuracy, FreeRun
from workbench.model.sampling import Sampling

LONGEST_MEAN = 10
"""Samples at the end of a rest that are averaged at most: a stem that creeps has been elsewhere before."""


class MultipleShooting(FreeRun):
    """A run put back at each rest, for one parameter vector after another; where samples see inertia (`sampling`).

    With `part` 0 or 1 every other slip is judged, or those between: two halves that share no measurement.

    Raises:
        InputError: as `FreeRun`.
    """

    def __init__(
        self,
        composition: Composition,
        record: Record,
        *,
        from_pressure: bool = False,
        accuracy: Accuracy = FINE,
        by: Sampling | None = None,
        part: int | None = None,
    ) -> None:
        super().__init__(composition, record, from_pressure=from_pressure, accuracy=accuracy, by=by)
        self._segments = [
            each._replace(shots=_shots(record, each.first, each.end) * [each.parts, 1.0]) for each in self._segments
        ]
        self._part = part

    @property
    def judged(self) -> Mask:
        """Which rows are simulated and judged, (n,)."""
        rows = super().judged
        if self._part is not None:
            begins = np.zeros(rows.size, np.int64)
            for each in self._segments:
                begins[each.first + 1 + each.shots[:, 0].astype(np.int64) // each.parts] = 1
            rows &= np.cumsum(begins) % 2 == self._part
        return rows


def slips_from_rest(record: Record) -> int:
    """Return how many slips begin at a rest."""
    return sum(len(_shots(record, first, end)) for first, end in record.segments)


def _shots(record: Record, first: int, end: int) -> Vector:
    """Return the periods before which the stem is put back, and where it is shown then, m, (shots, 2).

    They are where the rests of a stretch without a gap end, rows first to end (half open).
    """
    position_m = np.where(record.valid, record.position_m, np.nan)[first:end]
    found, rest = [], 0
    for slip in slips(position_m, record.scale_m):
        # Velocities are taken over two samples to either side: at its first row the stem still rests.
        at_rest_m = position_m[max(rest, slip.first + 1 - LONGEST_MEAN) : slip.first + 1]
        if slip.first > rest + 1 and not np.isnan(at_rest_m).all():
            found.append((slip.first, np.nanmean(at_rest_m)))
        rest = slip.last
    return np.array(found, np.float64).reshape(-1, 2)
