"""The PDOs of a node: their mapping, and one cycle of them (CiA 301, 7.2.2 PDO and 7.2.5 SYNC).

    RPDO 1  0x200 + n            command, control word            obeyed at SYNC
    SYNC    `sync_cob_id`        empty
    TPDOs   0x180, 0x280, .. + n the quantities of one sample     sent at each SYNC (transmission type 1)

PDOs that carry what is wanted are used as they were found (`found_pdos`). Of TPDOs that come by themselves (types 254
and 255) the newest count; they need not be of one sample, and their samples are numbered here: one in which not every
such TPDO came anew has the number of the one before. SYNC is sent only where a PDO waits for it. Else what a PDO
carries is set by SDO in its records (0x1400 and 0x1600, 0x1800 and 0x1A00 on), the quantities packed first fit into
8 bytes each. A TPDO too short, twice, or without SYNC cannot be trusted: the bus is left.
"""

import math
import struct
import time
from collections.abc import Mapping, Sequence

from canopen.objectdictionary import ObjectDictionary, ODVariable

from config.canopen_device import CanopenDevice, Entry
from config.errors import InputError
from drivers.boundary import BadReply, NoNumber, NoReply
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import NodeBus
from drivers.canopen.pdo_mapping import (
    EACH_SYNC,
    INVALID,
    LAST_SYNCHRONOUS,
    MAPPING,
    FoundPdo,
    found_pdos,
    that_carry,
    that_takes,
)
from drivers.canopen.sdo import REALS, SdoTransfers, Setting, sheet_variable
from drivers.canopen.watcher import NodeWatcher
from fieldbus.canopen.objects import MOST_PDOS, Control, first_fit
from fieldbus.canopen.python_can import can

RPDO, TPDO = 0x1400, 0x1800
"""First communication records."""
RPDO_ID, TPDO_ID = 0x200, 0x180  # first PDO's CAN identifiers, CiA 301
FIRST_TIMERS = 3
"""Event timers within which TPDOs that come by themselves must all have come once."""


class Pdo:
    """The mapped objects of one PDO.

    Args:
        record: the index of its communication record.
        cob_id: its arbitration id.
        entries: where each of its quantities lies, by name, in the order of the bytes; a number is so many bytes of
            what is not wanted.
        variables: what the data sheet says of each.
    """

    def __init__(
        self, record: int, cob_id: int, entries: Sequence[tuple[str, Entry] | int], variables: Mapping[str, ODVariable]
    ) -> None:
        self.record, self.cob_id = record, cob_id
        named = dict(each for each in entries if not isinstance(each, int))
        self.names = tuple(named)
        self.entries = tuple(named.values())
        objects = [variables[name] for name in named]
        self.mapping = [each.index << 16 | each.subindex << 8 | len(each) for each in objects]
        letters = (f"{each}x" if isinstance(each, int) else _letter(variables[each[0]]) for each in entries)
        self.layout = struct.Struct("<" + "".join(letters))
        self._is_plain = all(entry.is_plain for entry in self.entries)
        self._is_real = [each.data_type in REALS for each in objects]

    def values(self, data: bytes | bytearray) -> dict[str, float]:
        """Return the quantities by name, in the map's units."""
        raw = self.layout.unpack_from(data)
        if not self._is_plain:
            raw = tuple(entry.value(each) for entry, each in zip(self.entries, raw, strict=True))
        return dict(zip(self.names, raw, strict=True))

    def packed(self, values: Mapping[str, float]) -> bytes:
        """Return the bytes of quantities, in the map's units.

        Raises:
            ValueError: one is not a finite number, or its object cannot hold it.
        """
        numbers = [entry.raw(values[name]) for name, entry in zip(self.names, self.entries, strict=True)]
        try:
            pairs = zip(numbers, self._is_real, strict=True)
            return self.layout.pack(*(each if is_real else round(each) for each, is_real in pairs))
        except (struct.error, OverflowError):
            raise ValueError(f"{values['command_pa']:g} does not fit") from None

    def wanted(self, sdo: SdoTransfers) -> list[Setting]:
        """Return what to set, in order; nothing where the node's PDO is so already. Raises as `SdoTransfers.upload`."""
        mapped = self.record + MAPPING
        mapping = [Setting(mapped, n, each) for n, each in enumerate(self.mapping, 1)]
        valid, kind = Setting(self.record, 1, self.cob_id), Setting(self.record, 2, EACH_SYNC)
        whole = Setting(mapped, 0, len(mapping))
        if all(map(sdo.holds, (valid, kind, whole, *mapping))):
            return []
        invalid, empty = Setting(self.record, 1, self.cob_id | INVALID), Setting(mapped, 0, 0)
        return [invalid, kind, empty, *mapping, whole, valid]


def _letter(variable: ODVariable) -> str:
    return ODVariable.STRUCT_TYPES[variable.data_type or 0].format.lstrip("<")


class PdoExchange:
    """The cycle of one node: command and SYNC out, the TPDOs of that SYNC back.

    Args:
        config: which quantities, and the reply time-out.
        sheet: the data sheet, read for this node.
        bus: the node's frames.
        watcher: takes what else comes.

    Raises:
        InputError: the data sheet has not what the map names, or not enough TPDOs.
    """

    def __init__(self, config: CanopenDevice, sheet: ObjectDictionary, bus: NodeBus, watcher: NodeWatcher) -> None:
        self._sheet, self._bus, self._watcher = sheet, bus, watcher
        self.reply_timeout_s = config.reply_timeout_s
        sampled, commanded = config.map.sampled, config.map.commanded
        self._variables = {
            name: sheet_variable(sheet, config, name, entry) for name, entry in {**sampled, **commanded}.items()
        }
        self._sampled, self._commanded = sampled, commanded
        self._groups = self._grouped(config, {name: len(self._variables[name]) // 8 for name in sampled})
        self._tpdos: dict[int, Pdo] = {}
        self._by_themselves: dict[int, Pdo] = {}
        """Those of `_tpdos` that no SYNC brings."""
        self._newest: dict[str, float] = {}
        self._came: set[int] = set()
        self._first_within_s = 0.0
        self._samples = 0
        self._use_own()
        self._sync = can.Message(arbitration_id=config.sync_cob_id, is_extended_id=False)

    @property
    def tpdo_ids(self) -> tuple[int, ...]:
        """The arbitration ids of the TPDOs in use."""
        return tuple(self._tpdos)

    @property
    def come_by_themselves(self) -> bool:
        """Whether some TPDOs come without SYNC."""
        return bool(self._by_themselves)

    def _use_own(self) -> None:
        """Use PDOs by the predefined connection set."""
        self._by_themselves, self._newest, self._came = {}, {}, set()
        self._all_came = False
        self.need_sync = True
        """Whether a PDO in use waits for SYNC."""
        self._tpdos = {
            self._tpdo_id(n): Pdo(
                TPDO + n, self._tpdo_id(n), [(each, self._sampled[each]) for each in names], self._variables
            )
            for n, names in enumerate(self._groups)
        }
        self._use_rpdo(Pdo(RPDO, RPDO_ID + self._bus.node, list(self._commanded.items()), self._variables))

    def _use_rpdo(self, rpdo: Pdo) -> None:
        self._rpdo = rpdo
        self._command = can.Message(arbitration_id=rpdo.cob_id, data=bytes(8), is_extended_id=False)

    def use_found(self, sdo: SdoTransfers) -> bool:
        """Use the node's PDOs as they were found, if they carry what is wanted, else our own; return whether they do.

        Raises:
            DriverError: as `SdoTransfers.upload`.
        """
        self._use_own()
        carrying = that_carry(found_pdos(sdo, self._sheet, TPDO), self._sampled)
        taking = that_takes(found_pdos(sdo, self._sheet, RPDO), self._commanded)
        if carrying is None or taking is None:
            return False
        self._tpdos = {each.cob_id: self._as_found(each, self._sampled) for each in carrying}
        self._use_rpdo(self._as_found(taking, self._commanded))
        unasked = [each for each in carrying if each.comes_by_itself]
        self._by_themselves = {each.cob_id: self._tpdos[each.cob_id] for each in unasked}
        self._first_within_s = FIRST_TIMERS * max((each.event_timer_s for each in unasked), default=0.0)
        self.need_sync = len(unasked) < len(carrying) or taking.transmission <= LAST_SYNCHRONOUS
        return True

    def _as_found(self, found: FoundPdo, wanted: Mapping[str, Entry]) -> Pdo:
        names = {(entry.index, entry.subindex): (name, entry) for name, entry in wanted.items()}
        return Pdo(
            found.record, found.cob_id, [names.get(place, size) for place, size in found.carried], self._variables
        )

    def wanted(self, sdo: SdoTransfers) -> list[Setting]:
        """Return what must be set, in order, for the PDOs to carry this; those not needed become invalid.

        Raises:
            DriverError: as `SdoTransfers.upload`.
        """
        if self.use_found(sdo):
            return []
        wanted = [each for pdo in (self._rpdo, *self._tpdos.values()) for each in pdo.wanted(sdo)]
        for n in range(len(self._tpdos), MOST_PDOS):
            if TPDO + n in self._sheet and not int(sdo.upload(TPDO + n, 1)) & INVALID:
                wanted.append(Setting(TPDO + n, 1, self._tpdo_id(n) | INVALID))
        return wanted

    def prepare(self, command_pa: float, control: Control) -> None:
        """Set the command that `send` sends.

        Raises:
            ValueError: the command is not a finite number, or its object cannot hold it.
        """
        data = self._rpdo.packed({"command_pa": command_pa, "control_word": control})
        self._command.data, self._command.dlc = bytearray(data), len(data)

    def catch_up(self) -> None:
        """Take in what came since the last cycle.

        Raises:
            BadReply: a TPDO, which only SYNC may bring.
            NoConnection: the node is lost.
        """
        self._bus.require_open()
        self._watcher.refusal = None
        while (message := self._bus.receive(0.0)) is not None:
            if self._takes_unasked(message):
                continue
            if message.arbitration_id in self._tpdos:
                said = "a TPDO without SYNC: another node has this id, or another master sends SYNC"
                raise self._bus.closing_fault(BadReply, NodeEvent.NODE_ID_TAKEN, said)
            self._watcher.consume(message)

    def send_command(self) -> None:
        """Send the RPDO.

        Raises:
            NoConnection: the bus is off.
        """
        self._bus.put(self._command)

    def sample(self) -> dict[str, float]:
        """Send SYNC and return the quantities of the sample that it brings, by name, in the map's units.

        Raises:
            NoReply: TPDOs are missing after the reply time-out, or heartbeats are.
            BadReply: a TPDO too short or twice.
            NoNumber: a quantity is none.
            NoConnection: the node is lost.
        """
        if self.need_sync:
            self._bus.put(self._sync)
        values = self._received()
        if self._by_themselves:
            values |= self._unasked()
        self._watcher.require_heartbeat()
        if not all(map(math.isfinite, values.values())):
            said = ", ".join(f"{name} {value}" for name, value in values.items())
            raise NoNumber(f"{self._bus.who}: a measurement that is no number: {said}")
        return values

    def _received(self) -> dict[str, float]:
        """Wait for the TPDOs of the SYNC just sent."""
        missing = {each: pdo for each, pdo in self._tpdos.items() if each not in self._by_themselves}
        values: dict[str, float] = {}
        rest_s = self.reply_timeout_s
        end_s = time.monotonic() + rest_s
        while missing:
            message = self._bus.receive(max(0.0, rest_s))
            rest_s = end_s - time.monotonic()
            if message is not None and message.arbitration_id in missing:
                values.update(self._unpacked(missing.pop(message.arbitration_id), message))
                continue
            if message is not None and not self._takes_unasked(message):
                self._consume_other(message)
            if rest_s <= 0:
                raise self._silent(len(missing))
        return values

    def _takes_unasked(self, message: can.Message) -> bool:
        """Keep what a TPDO says that comes by itself; return whether it is one."""
        pdo = self._by_themselves.get(message.arbitration_id)
        if pdo is None:
            return False
        self._newest |= self._unpacked(pdo, message)
        self._came.add(message.arbitration_id)
        return True

    def _unasked(self) -> dict[str, float]:
        """Return the newest of what came by itself, with the number of its sample; wait for the very first."""
        if not self._all_came:
            self._await_first()
            self._all_came = True
        if len(self._came) == len(self._by_themselves):
            self._samples = (self._samples + 1) % (1 << 32)
            self._came.clear()
        own = {} if "sample_counter" in self._sampled else {"sample_counter": self._samples}
        return {**self._newest, **own}

    def _await_first(self) -> None:
        end_s = time.monotonic() + max(self.reply_timeout_s, self._first_within_s)
        while len(self._came) < len(self._by_themselves):
            rest_s = end_s - time.monotonic()
            message = self._bus.receive(max(0.0, rest_s))
            if message is not None and not self._takes_unasked(message):
                self._watcher.consume(message)
            if message is None and rest_s <= 0:
                raise self._silent(len(self._by_themselves) - len(self._came))

    def _unpacked(self, pdo: Pdo, message: can.Message) -> dict[str, float]:
        if len(message.data) < pdo.layout.size:
            said = f"TPDO {pdo.record - TPDO + 1} has {len(message.data)} bytes, mapped are {pdo.layout.size}"
            raise self._bus.closing_fault(BadReply, NodeEvent.PDO_TOO_SHORT, said)
        return pdo.values(message.data)

    def _consume_other(self, message: can.Message) -> None:
        if message.arbitration_id in self._tpdos:
            said = "the same TPDO came twice after one SYNC"
            raise self._bus.closing_fault(BadReply, NodeEvent.NODE_ID_TAKEN, said)
        self._watcher.consume(message)

    def _silent(self, missing: int) -> Exception:
        """Return what it means that TPDOs are missing."""
        event = NodeEvent.HEARTBEAT_LOST if self._watcher.is_silent else NodeEvent.SYNC_LOST
        said = (
            f"{missing} of {len(self._tpdos)} TPDOs missing {1e3 * self.reply_timeout_s:g} ms "
            f"{'after SYNC' if self.need_sync else 'after the command'}, "
            f"last heartbeat {1e3 * self._watcher.silence_s:.0f} ms ago"
        )
        return self._bus.closing_fault(NoReply, event, said)

    def _grouped(self, config: CanopenDevice, sizes: dict[str, int]) -> list[list[str]]:
        groups = first_fit(sizes)
        offered = sum(TPDO + n in self._sheet for n in range(MOST_PDOS))
        if len(groups) > offered:
            raise InputError(str(config.eds), f"device.map: needs {len(groups)} TPDOs, the data sheet offers {offered}")
        return groups

    def _tpdo_id(self, n: int) -> int:
        return TPDO_ID + 0x100 * n + self._bus.node
