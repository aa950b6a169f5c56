"""How far a valve is open, and where its stem stands: the one place that knows in which direction it is counted.

    h = x / L          air to open
    h = 1 - x / L      air to close

h opening, 0 closed, 1 open; x stem position in the direction in which pressure drives it, m; L stroke, m.

Who is outside counts from the closed end: the DCS's registers and the shares of the stroke in a daemon's file give h,
and a device measures h L. Estimators, laws, models and recordings go with the pressure: they have x.
"""

from dataclasses import dataclass
from typing import Literal

ActionWord = Literal["air_to_open", "air_to_close"]
"""What more air does to the valve."""


@dataclass(frozen=True, slots=True)
class Travel:
    """The stroke L, m, and whether more air closes the valve; of one that turns, lengths are angles, rad."""

    stroke_m: float
    closes: bool = False
    turns: bool = False

    @classmethod
    def of(cls, stroke_m: float, action: ActionWord) -> "Travel":
        """Return the travel of a valve by its action."""
        return cls(stroke_m, action == "air_to_close")

    def stem_m(self, opening: float) -> float:
        """Return the stem position x, m, of an opening h.

        >>> Travel(0.04).stem_m(0.25), Travel(0.04, closes=True).stem_m(0.25)
        (0.01, 0.03)
        """
        return (1.0 - opening if self.closes else opening) * self.stroke_m

    def opening(self, stem_m: float) -> float:
        """Return the opening h of a stem position x, m."""
        share = stem_m / self.stroke_m
        return 1.0 - share if self.closes else share

    def turned_m(self, position_m: float) -> float:
        """Return a position counted from the closed end, h L, as the stem's, x; and back again.

        >>> Travel(0.5, closes=True).turned_m(0.125)
        0.375
        """
        return self.stroke_m - position_m if self.closes else position_m

    def opening_change(self, stem_m: float) -> float:
        """Return by how much a way of the stem, m, opens the valve."""
        return (-stem_m if self.closes else stem_m) / self.stroke_m

    def window_m(self, openings: tuple[float, float]) -> tuple[float, float]:
        """Return between which stem positions, m, the openings of a window lie, lower first."""
        ends = self.stem_m(openings[0]), self.stem_m(openings[1])
        return (ends[1], ends[0]) if self.closes else ends

    @property
    def without_air(self) -> str:
        """Where the spring takes the valve when the air fails."""
        return "open" if self.closes else "closed"

    @property
    def words(self) -> str:
        """What the action means.

        >>> Travel(0.04, closes=True).words
        'air to close: without air it is open'
        """
        return f"air to {'close' if self.closes else 'open'}: without air it is {self.without_air}"
