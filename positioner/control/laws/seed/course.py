"""In which direction the stem comes to its reference: that in which it changed last, until something else moves it.

    s = sign(delta r)                 (seed, 4.1): the stem is sent to r, and arrives there moving that way
    s = sign(r - x)                   from then on where it rests at x on the other side of r, 2 % of stroke away

The second is a stem that a lost supply, a push or S3 has taken away: it comes back moving the other way than the
reference did, so the pressure that held it lands it 2 F_c/k_s off. Once for each such event, and once for a reference:
a friction that is known amiss must not send it to and fro.
"""

from math import nan
from typing import NamedTuple

AWAY = 0.02
"""Of the stroke: from the reference, and by which something else has moved it."""


class Course(NamedTuple):
    """The direction in force, and what it rests on."""

    reference_m: float = nan
    changed: int = 0
    """Direction of the reference's last change."""
    direction: int = 1
    command_pa: float = nan
    rested_m: float | None = None
    """Where the stem first rested under that command; None: it has not yet."""
    turned: bool = False
    """Whether the direction was turned round since the reference changed, or the stem was moved."""

    def after(
        self, reference_m: float, changed: int, command_pa: float, rest_m: float | None, stroke_m: float
    ) -> "Course":
        """Return the course after one sample.

        Args:
            reference_m: in force.
            changed: in which direction it changed last.
            command_pa: in force.
            rest_m: where the stem rests under it; None while it moves or may yet move.
            stroke_m: full travel.
        """
        if (reference_m, changed) != (self.reference_m, self.changed):
            return Course(reference_m=reference_m, changed=changed, direction=1 if changed > 0 else -1)
        if rest_m is None:
            return self
        under_another = command_pa != self.command_pa
        rested_m = rest_m if self.rested_m is None or under_another else self.rested_m
        moved = abs(rest_m - rested_m) > AWAY * stroke_m
        error_m = reference_m - rest_m
        turns = abs(error_m) > AWAY * stroke_m and error_m * self.direction < 0.0 and (moved or not self.turned)
        if not (under_another or moved or turns or self.rested_m is None):
            return self
        return self._replace(
            direction=-self.direction if turns else self.direction,
            command_pa=command_pa,
            rested_m=rest_m if moved else rested_m,
            turned=turns or (self.turned and not moved),
        )
