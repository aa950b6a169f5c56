"""Where a device keeps its quantities in Modbus registers, as a person writes it in table `[device.map]`.

`SIMULATED_MAP` is where the simulated slave keeps them; the map of a real device is written in the same words.
"""

import math
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from config.loading import Schema
from config.quantities import QUANTITIES, WRITABLE
from config.register_format import Format, WireType, WordOrder

MOST_REGISTERS = 125
"""A Modbus reply carries at most this many registers."""


class Place(Schema):
    """Where a quantity lies in a device's registers: value = scale * raw + offset, in the quantity's unit."""

    table: Literal["holding", "input"] = "holding"
    address: Annotated[int, Field(ge=0, le=65535)]
    type: WireType = "float32"
    word_order: WordOrder = "big"
    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _has_a_scale_and_room(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        if self.end > 65536:
            raise ValueError(f"{self.type} at {self.address} reaches past register 65535")
        return self

    @property
    def format(self) -> Format:
        """How the raw value lies in its registers."""
        return Format(self.type, self.word_order)

    @property
    def end(self) -> int:
        """The address just past the last register."""
        return self.address + self.format.words

    @property
    def is_float(self) -> bool:
        """Whether it holds any number, not whole ones alone."""
        return self.type in ("float32", "float64")

    @property
    def is_plain(self) -> bool:
        """Whether the raw value is the value."""
        return self.scale == 1 and self.offset == 0

    def value(self, raw: float) -> float:
        """Return the value of a raw number."""
        return raw if self.is_plain else self.scale * raw + self.offset

    def raw(self, value: float) -> float:
        """Return the raw number nearest to a value; a whole one where the type is.

        Raises:
            ValueError: not a finite number.
        """
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        raw = value if self.is_plain else (value - self.offset) / self.scale
        return raw if self.is_float else round(raw)


class ModbusMap(Schema):
    """The quantities a device has, by place. Only position and command are indispensable.

    What the device says of one sample (position, pressure, counter, time, status) is read in one transaction,
    so it must lie within 125 registers of one table.
    """

    position_m: Place
    command_pa: Place
    pressure_pa: Place | None = None
    sample_counter: Place | None = None
    device_time_us: Place | None = None
    status: Place | None = None
    communication_timeout_s: Place | None = None
    communication_action: Place | None = None
    sample_counter_bits: Annotated[int, Field(ge=2, le=64)] | None = None
    """Of a counter that wraps before its registers are full; all of them where nobody says."""

    @property
    def sample_counter_range(self) -> int:
        """How far the sample counter counts."""
        bits = 32 if self.sample_counter is None else 16 * self.sample_counter.format.words
        return 1 << (self.sample_counter_bits or bits)

    @property
    def places(self) -> dict[str, Place]:
        """The quantities the device has, by name, in the order of `QUANTITIES`."""
        return {each.name: place for each in QUANTITIES if (place := getattr(self, each.name)) is not None}

    @property
    def sampled(self) -> dict[str, Place]:
        """The quantities of one sample, by name."""
        return {name: place for name, place in self.places.items() if name not in WRITABLE}

    @property
    def sampled_words(self) -> int:
        """Registers from the first to the last of one sample, those between its quantities included."""
        places = self.sampled.values()
        return max(place.end for place in places) - min(place.address for place in places)

    @model_validator(mode="after")
    def _can_be_read_and_written(self) -> Self:
        places = self.sampled.values()
        if len({place.table for place in places}) > 1:
            raise ValueError("position, pressure, counter, time and status must lie in one table")
        if self.sampled_words > MOST_REGISTERS:
            raise ValueError(f"one sample must lie within {MOST_REGISTERS} registers, it spans {self.sampled_words}")
        for name, place in self.places.items():
            if name in WRITABLE and place.table != "holding":
                raise ValueError(f"{name} is written, so it must lie in the holding table")
        return self

    @model_validator(mode="after")
    def _nothing_overlaps(self) -> Self:
        in_order = sorted(self.places.items(), key=lambda each: (each[1].table, each[1].address))
        for (name, place), (next_name, next_place) in pairwise(in_order):
            if place.table == next_place.table and place.end > next_place.address:
                raise ValueError(f"{name} and {next_name} share register {next_place.address}")
        return self


def _simulated_map() -> ModbusMap:
    """Lay the quantities one after another from register 0."""
    places: dict[str, Any] = {}
    address = 0
    for quantity in QUANTITIES:
        places[quantity.name] = Place(address=address, type=quantity.type)
        address = places[quantity.name].end
    return ModbusMap(**places)


SIMULATED_MAP = _simulated_map()
