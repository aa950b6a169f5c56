"""Where a device keeps its quantities in Modbus registers, as a person writes it in table `[device.map]`.

`SIMULATED_MAP` is where the simulated slave keeps them; the map of a real device is written in the same words.
"""

from collections.abc import Iterator, Mapping
from itertools import pairwise, product
from typing import Annotated, Any, Literal, Protocol, Self, TypeVar, get_args

from pydantic import Field, model_validator

from config.loading import Schema
from config.quantities import QUANTITIES, WRITABLE, ActionName, CommunicationAction, DeviceStatus
from config.quantity_map import QuantityMap, Scaled
from config.register_format import Format, Order, WireType

MOST_REGISTERS = 125
"""A Modbus reply carries at most this many registers."""


class Laid(Protocol):
    """What lies in registers, from an address up to an end."""

    @property
    def address(self) -> int:
        """The first register."""

    @property
    def end(self) -> int:
        """The address just past the last."""


LaidT = TypeVar("LaidT", bound=Laid)
ORDERS: tuple[Order, ...] = get_args(Order)


class Place(Scaled):
    """Where a quantity lies in a device's registers."""

    table: Literal["holding", "input"] = "holding"
    address: Annotated[int, Field(ge=0, le=65535)]
    type: WireType = "float32"
    word_order: Order = "big"
    byte_order: Order = "big"

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if self.end > 65536:
            raise ValueError(f"{self.type} at {self.address} reaches past register 65535")
        return self

    @property
    def format(self) -> Format:
        """How the raw value lies in its registers."""
        return Format(self.type, self.word_order, self.byte_order)

    @property
    def end(self) -> int:
        """The address just past the last register."""
        return self.address + self.format.words

    @property
    def is_float(self) -> bool:
        """Whether it holds any number, not whole ones alone."""
        return self.type in ("float32", "float64")

    def raw(self, value: float) -> float:
        """Return the raw number nearest to a value; a whole one where the type is.

        Raises:
            ValueError: not a finite number.
        """
        raw = super().raw(value)
        return raw if self.is_float else round(raw)

    def in_other_orders(self, value: float) -> dict[str, float]:
        """Return what the registers that say a value would say in other orders, by the keys that choose them.

        Raises:
            ValueError: no register says it.
        """
        words = self.format.encode(self.raw(value))
        other: dict[str, float] = {}
        for word_order, byte_order in product(ORDERS, ORDERS):
            turned = {"word_order": word_order, "byte_order": byte_order}
            if turned == {"word_order": self.word_order, "byte_order": self.byte_order} or (
                len(words) == 1 and word_order != self.word_order
            ):
                continue
            said = ", ".join(f'{key} = "{order}"' for key, order in turned.items() if order != getattr(self, key))
            place = self.model_copy(update=turned)
            other[said] = place.value(place.format.decode(words))
        return other


Mask = Annotated[int, Field(ge=0, lt=1 << 32)]


class StatusBits(Schema):
    """Which bits of a device's own status word say what: any bit of a mask says so; of `ready`, any that is missing."""

    communication_lost: Mask = 0
    sensor_fault: Mask = 0
    not_ready: Mask = 0
    device_fault: Mask = 0
    ready: Mask = 0
    """Bits that are 1 while the device works."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        if not self.communication_lost | self.sensor_fault | self.not_ready | self.device_fault | self.ready:
            raise ValueError("names no bit; leave the table out where the status has the bits of DeviceStatus")
        return self

    def status(self, raw: int) -> DeviceStatus:
        """Return what a status word says."""
        said = DeviceStatus(0)
        if raw & self.communication_lost:
            said |= DeviceStatus.COMMUNICATION_LOST
        if raw & self.sensor_fault:
            said |= DeviceStatus.SENSOR_FAULT
        if raw & self.not_ready or self.ready & ~raw:
            said |= DeviceStatus.NOT_READY
        if raw & self.device_fault:
            said |= DeviceStatus.DEVICE_FAULT
        return said


class ActionCodes(Schema):
    """The device's own numbers for what it does when nobody has commanded it for its time-out; None: it cannot."""

    hold: Annotated[int, Field(ge=0, lt=1 << 16)] | None = None
    vent: Annotated[int, Field(ge=0, lt=1 << 16)] | None = None
    fill: Annotated[int, Field(ge=0, lt=1 << 16)] | None = None

    @model_validator(mode="after")
    def _differ(self) -> Self:
        codes = [each for each in (self.hold, self.vent, self.fill) if each is not None]
        if len(set(codes)) < len(codes) or not codes:
            raise ValueError("hold, vent and fill need a number each, of those that the device can do")
        return self


Run = dict[str, Place]
"""Quantities that one read brings, by name."""


class ModbusMap(QuantityMap[Place]):
    """The quantities a device has, by their registers.

    What the device says of one sample (position, pressure, counter, time, status) is read in one transaction where it
    lies within 125 registers of one table; else in several, and then need not be of one sample.
    """

    sample_counter_bits: Annotated[int, Field(ge=2, le=64)] | None = None
    """Of a counter that wraps before its registers are full; all of them where nobody says."""
    status_bits: StatusBits | None = None
    """By default the status has the bits of `DeviceStatus`."""
    communication_action_codes: ActionCodes | None = None
    """By default those of `CommunicationAction`."""

    @property
    def sample_counter_range(self) -> int:
        """How far the sample counter counts."""
        bits = 32 if self.sample_counter is None else 16 * self.sample_counter.format.words
        return 1 << (self.sample_counter_bits or bits)

    @property
    def runs(self) -> list[Run]:
        """The reads that bring one sample: as few as there can be."""
        tables = ({n: each for n, each in self.sampled.items() if each.table == t} for t in ("holding", "input"))
        return [run for table in tables for run in runs_within(table, MOST_REGISTERS)]

    def device_status(self, raw: int) -> int:
        """Return the bits of `DeviceStatus` that a status word says."""
        return raw if self.status_bits is None else int(self.status_bits.status(raw))

    def action_code(self, action: ActionName) -> int:
        """Return the device's number for a communication action."""
        codes = self.communication_action_codes
        code = CommunicationAction[action.upper()] if codes is None else getattr(codes, action)
        return int(code)

    @model_validator(mode="after")
    def _says_what_it_has(self) -> Self:
        for name, of in (("status_bits", "status"), ("communication_action_codes", "communication_action")):
            if getattr(self, name) is not None and getattr(self, of) is None:
                raise ValueError(f"{name} goes with {of}, which the device has not")
        return self

    @model_validator(mode="after")
    def _can_be_written(self) -> Self:
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


def without_holes(run: Run) -> list[Run]:
    """Return a run cut wherever a register lies between its quantities, for a device that refuses to read such."""
    return list(runs_within(run, 0))


def one_by_one(run: Run) -> list[Run]:
    """Return a run cut between its quantities, for a device that gives few registers at once."""
    return [{name: place} for name, place in run.items()]


def words_of(run: Mapping[str, Laid]) -> int:
    """Return over how many registers a run goes."""
    return max(each.end for each in run.values()) - min(each.address for each in run.values())


def runs_within(places: Mapping[str, LaidT], most: int) -> Iterator[dict[str, LaidT]]:
    """Yield what lies in registers by address, in runs of at most so many registers; of 0, in runs without a hole.

    >>> places = {name: Place(address=address) for name, address in {"a": 0, "b": 2, "c": 9}.items()}
    >>> [list(run) for run in runs_within(places, 0)], [list(run) for run in runs_within(places, 11)]
    ([['a', 'b'], ['c']], [['a', 'b', 'c']])
    """
    run: dict[str, LaidT] = {}
    start = end = held = 0
    for name, place in sorted(places.items(), key=lambda each: each[1].address):
        size = place.end - place.address
        if run and max(end, place.end) - start > max(most, held + size):
            yield run
            run = {}
        if not run:
            start = end = place.address
            held = 0
        run[name] = place
        end, held = max(end, place.end), held + size
    if run:
        yield run


def _lay_out_map() -> ModbusMap:
    """Lay the quantities one after another from register 0."""
    places: dict[str, Any] = {}
    address = 0
    for quantity in QUANTITIES:
        places[quantity.name] = Place(address=address, type=quantity.type)
        address = places[quantity.name].end
    return ModbusMap(**places)


SIMULATED_MAP = _lay_out_map()
