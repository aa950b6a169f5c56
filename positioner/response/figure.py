"""A figure with its uncertainty, or the reason why there is none."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """A value and its uncertainty (both None when it cannot be determined, and then `reason` says why)."""

    value: float | None
    plus_minus: float | None = None
    reason: str | None = None


def no_value(reason: str) -> Figure:
    """Return a figure without a value, for a reason."""
    return Figure(None, None, reason)
