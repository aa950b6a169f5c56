"""The device on CANopen: where its quantities lie in the object dictionary, and its bus.

`SIMULATED_OBJECTS` follows from `config.quantities.QUANTITIES`: one object each, from 0x2000 on, in the table's order.
The electronic data sheet (`fieldbus.canopen.eds`) and the simulated slave come from the same table; the objects of a
real device are written in the daemon's TOML file, in the same words. `fieldbus.canopen.objects` says what its words
mean.
"""

import math
from importlib.util import find_spec
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from config.device import Device
from config.errors import InputError
from config.loading import SHIPPED, NearFile, NonNegative, Schema
from config.quantities import QUANTITIES, ActionName
from config.quantity_map import QuantityMap, Scaled

FIRST_OBJECT = 0x2000
"""Manufacturer-specific objects begin here."""
CONTROL_WORD, STATUS_WORD = 0x6040, 0x6041  # objects of CiA 408
SYNC_IDS = (range(0x80, 0x101), range(0x181, 0x581), range(0x680, 0x6E0))
"""Where CiA 301 lets SYNC be; of these, those of PDOs and emergencies are free where no node has them."""
SHIPPED_EDS = SHIPPED / "profiles" / "positioner.eds"


class Entry(Scaled):
    """Where a quantity lies in the object dictionary."""

    index: Annotated[int, Field(ge=0x1000, le=0xFFFF)]
    subindex: Annotated[int, Field(ge=0, le=254)] = 0


class ObjectMap(QuantityMap[Entry]):
    """The quantities a device has, by object.

    A device without control and status word is taken for ACTIVE as long as it is OPERATIONAL.
    """

    control_word: Entry | None = None
    status_word: Entry | None = None

    @property
    def sampled(self) -> dict[str, Entry]:
        """What the device sends of one sample, by name."""
        status = {} if self.status_word is None else {"status_word": self.status_word}
        return super().sampled | status

    @property
    def commanded(self) -> dict[str, Entry]:
        """What the device is sent each cycle, by name."""
        command = {"command_pa": self.command_pa}
        return command if self.control_word is None else {**command, "control_word": self.control_word}


def _lay_out_objects() -> ObjectMap:
    entries = {each.name: Entry(index=FIRST_OBJECT + n) for n, each in enumerate(QUANTITIES)}
    return ObjectMap(**entries, control_word=Entry(index=CONTROL_WORD), status_word=Entry(index=STATUS_WORD))


SIMULATED_OBJECTS = _lay_out_objects()


class CanBus(Schema):
    """The keys that say which CAN bus: any interface of python-can by its name, and what that wants to know."""

    interface: Annotated[str, Field(min_length=1)] = "loopback"
    channel: str = "29500"
    bitrate_bit_per_s: Annotated[int, Field(gt=0)] | None = None
    options: dict[str, bool | int | float | str] = Field(default_factory=dict)
    node: Annotated[int, Field(ge=1, le=127)] = 1

    @property
    def bus_arguments(self) -> dict[str, object]:
        """What `can.Bus` is called with; no other file of the machine has a say."""
        rate = {} if self.bitrate_bit_per_s is None else {"bitrate": self.bitrate_bit_per_s}
        return {"interface": self.interface, "channel": self.channel, "ignore_config": True, **rate, **self.options}

    @property
    def own_ids(self) -> frozenset[int]:
        """The arbitration ids of the node's emergencies and PDOs, by the predefined connection set."""
        return frozenset(first + self.node for first in (0x80, *range(0x180, 0x580, 0x80)))


def _sync_id(value: int) -> int:
    if not any(value in each for each in SYNC_IDS):
        raise ValueError("must be 0x80 to 0x100, 0x181 to 0x580 or 0x680 to 0x6df")
    return value


class CanopenDevice(CanBus, Device):
    """Table `[device]` of the daemon: a device on CANopen."""

    bus: Literal["canopen"] = "canopen"
    eds: NearFile = SHIPPED_EDS
    """Its electronic data sheet; by default that of the simulated device."""
    sync_cob_id: Annotated[int, AfterValidator(_sync_id)] = 0x80
    """Several valves on one bus need one each, since each cycle has its own SYNC; 0x680 to 0x6DF are nobody's."""
    heartbeat_s: Annotated[float, Field(ge=1e-3, le=65)] = 0.05
    """Told to the node; `heartbeats_missed` of it without one is a fault."""
    heartbeats_missed: Annotated[float, Field(ge=1.5, le=100)] = 2.5
    master_node: Annotated[int, Field(ge=1, le=127)] | None = None
    """The node id that this daemon has itself: then the node is told to watch its heartbeat (0x1016)."""
    master_heartbeat_s: Annotated[float, Field(ge=1e-3, le=10)] = 0.05
    """Sent at least so often while cycles are more frequent; the node is told `heartbeats_missed` of it."""
    reply_timeout_s: Annotated[float, Field(gt=0, le=60)] = 0.03
    communication_timeout_s: NonNegative = 1.0
    communication_action: ActionName = "hold"
    only_watch: bool = False
    """Read by SDO and nothing else: no NMT, no SYNC, nothing set."""
    map: ObjectMap = SIMULATED_OBJECTS

    @property
    def longest_exchange_s(self) -> float:
        """The reply's time-out."""
        return self.reply_timeout_s

    @property
    def acts_alone_after_s(self) -> float:
        """The shorter of the time-outs that it is told, if it can be told one."""
        told_s = self.communication_timeout_s or math.inf if self.map.communication_timeout_s else math.inf
        return told_s if self.master_node is None else min(told_s, self.master_timeout_s)

    @property
    def acts_alone_by(self) -> ActionName | None:
        """The action that it is told, if it can be told one."""
        return self.communication_action if self.map.communication_action else None

    @property
    def master_timeout_s(self) -> float:
        """Silence of this master after which the node acts by itself, if it watches it."""
        return self.heartbeats_missed * self.master_heartbeat_s

    def read_only(self) -> Self:
        """Return the same device for one who only watches."""
        return self.model_copy(update={"only_watch": True})

    def conflict_with(self, other: Device) -> str | None:
        """Say so if the other is the same node, or its SYNC has the id of this one's, or of a frame of it."""
        if not isinstance(other, CanopenDevice) or self._bus != other._bus:
            return None
        where = f"on {self.interface} {self.channel}"
        if self.node == other.node:
            return f"node {self.node} {where}"
        if self.sync_cob_id == other.sync_cob_id:
            return f"sync_cob_id {self.sync_cob_id:#x} {where}"
        shared = {self.sync_cob_id, other.sync_cob_id} & (self.own_ids | other.own_ids)
        return (
            f"arbitration id {min(shared):#x} {where}, as sync_cob_id and as one of the node's own" if shared else None
        )

    @property
    def _bus(self) -> tuple[object, ...]:
        return self.interface, self.channel, tuple(sorted(self.options.items()))

    @model_validator(mode="after")
    def _sync_id_is_free(self) -> Self:
        if self.sync_cob_id in self.own_ids:
            raise ValueError(f"sync_cob_id must be none of node {self.node}'s own ids, it is {self.sync_cob_id:#x}")
        if self.master_node == self.node:
            raise ValueError(f"master_node must be another than the device's own node, {self.node}")
        return self

    @property
    def heartbeat_timeout_s(self) -> float:
        """Silence after which the node is gone."""
        return self.heartbeats_missed * self.heartbeat_s


def require_can(source: str, key: str) -> None:
    """Ask for the packages that CANopen needs.

    Raises:
        InputError: they are not installed.
    """
    missing = [
        package for package, module in {"canopen": "canopen", "python-can": "can"}.items() if not find_spec(module)
    ]
    if missing:
        raise InputError(source, f"{key}: 'canopen' needs {' and '.join(missing)}: pip install 'positioner[canopen]'")
