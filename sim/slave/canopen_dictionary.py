"""The object dictionary of the simulated CANopen node: what SDO reads and writes, and how PDOs are composed of it.

Objects, their types and what they are at power-up come from the data sheet (`fieldbus.canopen.eds`). Those of
the device itself are read from it and written to it; the rest are numbers kept here. The rules of CiA 301 hold: a
mapping is changed while its PDO is not valid, entry 0 last, and only what a PDO can carry is mapped.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canopen import ObjectDictionary
from canopen.objectdictionary import ODVariable
from canopen.sdo.exceptions import SdoAbortedError

from fieldbus.canopen.objects import PDO_BYTES

NO_ACCESS_READ, NO_ACCESS_WRITE = 0x06010001, 0x06010002  # abort codes of CiA 301
NO_OBJECT, NO_SUBINDEX, NO_DATA = 0x06020000, 0x06090011, 0x08000024  # abort codes of CiA 301
NOT_MAPPABLE, PDO_TOO_LONG, WRONG_LENGTH = 0x06040041, 0x06040042, 0x06070010  # abort codes of CiA 301
OUT_OF_RANGE, LOCAL_CONTROL, NOT_IN_THIS_STATE = 0x06090030, 0x08000021, 0x08000022  # abort codes of CiA 301

INVALID = 1 << 31
"""Of a PDO's COB-ID."""
LAST_SYNCHRONOUS = 240  # transmission type, CiA 301
RPDO, TPDO, MAPPING = 0x1400, 0x1800, 0x200
"""First communication records; the mapping of each lies 0x200 higher."""
COMMUNICATION_END = 0x2000  # objects of the device begin here

Read = Callable[[], float]
Write = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Pdo:
    """A valid PDO: when it travels and what it carries."""

    cob_id: int
    transmission: int
    layout: struct.Struct
    objects: tuple[int, ...]


class Dictionary:
    """What SDO reads and writes; has the methods that canopen's SDO server asks of its node.

    Args:
        sheet: the data sheet, read for this node.
        reads: how to read the objects that are the device's, by index.
        writes: how to write them; each may raise `SdoAbortedError`.
    """

    def __init__(self, sheet: ObjectDictionary, reads: dict[int, Read], writes: dict[int, Write]) -> None:
        self.object_dictionary = sheet
        self._reads, self._writes = reads, writes
        self.writes = 0
        self._values: dict[tuple[int, int], Any] = {}
        self.reset(0)

    def reset(self, first: int, end: int = 0x10000) -> None:
        """Give the objects of a range their values at power-up."""
        for index in self.object_dictionary:
            if first <= index < end and index not in self._reads:
                found = self.object_dictionary[index]
                members = [found] if isinstance(found, ODVariable) else found.values()
                for each in members:
                    self._values[each.index, each.subindex] = each.default

    def value(self, index: int, subindex: int = 0) -> int:
        """Return a number kept here."""
        return int(self._values[index, subindex])

    def pdos(self, first: int) -> list[Pdo]:
        """Return the valid PDOs of a direction."""
        records = [index for index in self.object_dictionary if first <= index < first + MAPPING]
        return [self._pdo(index) for index in records if not self.value(index, 1) & INVALID]

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """Return an object's bytes.

        Raises:
            SdoAbortedError: there is none, or it cannot be read.
        """
        variable = self._variable(index, subindex)
        if check_readable and not variable.readable:
            raise SdoAbortedError(NO_ACCESS_READ)
        value = self._reads[index]() if index in self._reads else self._values[index, subindex]
        if value is None:
            raise SdoAbortedError(NO_DATA)
        return bytes(variable.encode_raw(value))

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Write an object.

        Raises:
            SdoAbortedError: there is none, it cannot be written, or not that; nothing changed.
        """
        variable = self._variable(index, subindex)
        if check_writable and not variable.writable:
            raise SdoAbortedError(NO_ACCESS_WRITE)
        if 8 * len(data) != len(variable):
            raise SdoAbortedError(WRONG_LENGTH)
        value: Any = variable.decode_raw(bytes(data))
        if index in self._writes:
            self._writes[index](value)
            return
        if RPDO <= index < TPDO + MAPPING + MAPPING:
            self._check_pdo(index, subindex, int(value))
        self._values[index, subindex] = value
        self.writes += 1

    def _variable(self, index: int, subindex: int) -> ODVariable:
        if index not in self.object_dictionary:
            raise SdoAbortedError(NO_OBJECT)
        found = self.object_dictionary[index]
        if isinstance(found, ODVariable):
            if subindex:
                raise SdoAbortedError(NO_SUBINDEX)
            return found
        if subindex not in found:
            raise SdoAbortedError(NO_SUBINDEX)
        return found[subindex]

    def _check_pdo(self, index: int, subindex: int, value: int) -> None:
        is_mapping = bool(index & MAPPING)
        record = index & ~MAPPING
        if is_mapping:
            if not self.value(record, 1) & INVALID or (subindex and self.value(index, 0)):
                raise SdoAbortedError(NOT_IN_THIS_STATE)
            if subindex == 0 and value:
                self._check_mapping(index, value)
            return
        if subindex == 2 and not (0 if record < TPDO else 1) <= value <= LAST_SYNCHRONOUS:
            raise SdoAbortedError(OUT_OF_RANGE)

    def _check_mapping(self, index: int, count: int) -> None:
        if count > 8:
            raise SdoAbortedError(PDO_TOO_LONG)
        receives = index < TPDO
        size = 0
        for mapped in (self.value(index, n) for n in range(1, count + 1)):
            try:
                variable = self._variable(mapped >> 16, (mapped >> 8) & 0xFF)
            except SdoAbortedError:
                raise SdoAbortedError(NOT_MAPPABLE) from None
            allowed = variable.writable if receives else variable.readable
            if not variable.pdo_mappable or not allowed or len(variable) != mapped & 0xFF:
                raise SdoAbortedError(NOT_MAPPABLE)
            size += len(variable) // 8
        if size > PDO_BYTES:
            raise SdoAbortedError(PDO_TOO_LONG)

    def _pdo(self, record: int) -> Pdo:
        mapping = record + MAPPING
        mapped = [self.value(mapping, n) for n in range(1, self.value(mapping, 0) + 1)]
        letters = (ODVariable.STRUCT_TYPES[self._type(each)].format for each in mapped)
        return Pdo(
            self.value(record, 1) & 0x7FF,
            self.value(record, 2),
            struct.Struct("<" + "".join(letter.lstrip("<") for letter in letters)),
            tuple(each >> 16 for each in mapped),
        )

    def _type(self, mapped: int) -> int:
        kind = self._variable(mapped >> 16, (mapped >> 8) & 0xFF).data_type
        assert kind is not None
        return kind
