"""Where a device keeps its quantities, whatever its bus: a place each, in which value = scale * raw + offset."""

import math
from typing import Generic, Self, TypeVar

from pydantic import model_validator

from config.loading import Schema
from config.quantities import QUANTITIES, WRITABLE


class Scaled(Schema):
    """A number as a device has it: value = scale * raw + offset, in the quantity's unit."""

    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _has_a_scale(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        return self

    @property
    def is_plain(self) -> bool:
        """Whether the raw number is the value."""
        return self.scale == 1 and self.offset == 0

    def value(self, raw: float) -> float:
        """Return the value of a raw number."""
        return raw if self.is_plain else self.scale * raw + self.offset

    def raw(self, value: float) -> float:
        """Return the raw number of a value, not rounded.

        Raises:
            ValueError: not a finite number.
        """
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        return value if self.is_plain else (value - self.offset) / self.scale


PlaceT = TypeVar("PlaceT", bound=Scaled)


class QuantityMap(Schema, Generic[PlaceT]):
    """The quantities of `config.quantities` that a device has. Only position and command are indispensable."""

    position_m: PlaceT
    command_pa: PlaceT
    pressure_pa: PlaceT | None = None
    sample_counter: PlaceT | None = None
    device_time_us: PlaceT | None = None
    status: PlaceT | None = None
    communication_timeout_s: PlaceT | None = None
    communication_action: PlaceT | None = None

    @property
    def places(self) -> dict[str, PlaceT]:
        """The quantities the device has, by name, in the order of `QUANTITIES`."""
        return {each.name: place for each in QUANTITIES if (place := getattr(self, each.name)) is not None}

    @property
    def sampled(self) -> dict[str, PlaceT]:
        """The quantities of one sample, by name."""
        return {name: place for name, place in self.places.items() if name not in WRITABLE}
