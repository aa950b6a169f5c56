"""From the DCS's signal to the opening it asks for, and back: split range, then characteristic.

h = f(s(w))          w = s^-1(f^-1(h))
"""

from dataclasses import dataclass, field

from config.travel_table import TravelTable
from positioner.control.travel.characteristic import Characteristic, characteristic_of
from positioner.control.travel.linear import Linear
from positioner.control.travel.split_range import SplitRange


@dataclass(frozen=True, slots=True)
class SignalPath:
    """By default the opening is the signal."""

    split: SplitRange = field(default_factory=SplitRange)
    characteristic: Characteristic = field(default_factory=Linear)

    @classmethod
    def of(cls, table: TravelTable) -> "SignalPath":
        """Return the path that table `[travel]` asks for."""
        return cls(SplitRange(*table.split_range), characteristic_of(table))

    def opening(self, signal: float) -> float:
        """Return the opening h that a signal w asks for, both 0 to 1."""
        return self.characteristic.opening(self.split.share(signal))

    def signal(self, opening: float) -> float:
        """Return the signal w that asks for an opening h; of one beyond 0 to 1, that of the nearest end."""
        return self.split.signal(self.characteristic.signal(min(max(opening, 0.0), 1.0)))
