"""A linear characteristic: h = s."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Linear:
    """The opening is the signal."""

    def opening(self, signal: float) -> float:
        """Return h of a signal s, 0 to 1."""
        return signal

    def signal(self, opening: float) -> float:
        """Return s of an opening h, 0 to 1."""
        return opening
