"""The electronic data sheet of our device, made from the table of quantities, and the reader of anybody's.

    python -m fieldbus.canopen.eds > config/profiles/positioner.eds

A data sheet (CiA 306) lists every object of a device: name, type, access, default, whether a PDO can carry it. Ours has
the quantities of `config.quantities` as REAL32 or unsigned objects with units in their names, CiA 408 control and
status words beside them, and PDOs that carry one sample by default.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from config.canopen_device import CONTROL_WORD, SIMULATED_OBJECTS, STATUS_WORD
from config.errors import InputError
from config.plain_file import read_plain
from config.quantities import QUANTITIES, WRITABLE
from config.register_format import Format, WireType
from fieldbus.canopen.objects import DEVICE_MODE, MOST_PDOS, DeviceMode, first_fit

if TYPE_CHECKING:
    from canopen import ObjectDictionary

DATA_TYPE: dict[WireType, int] = {
    "int16": 0x03,
    "int32": 0x04,
    "uint16": 0x06,
    "uint32": 0x07,
    "float32": 0x08,
    "float64": 0x11,
    "uint64": 0x1B,
}
INTEGER8, UNSIGNED8, UNSIGNED16, UNSIGNED32, VISIBLE_STRING = 0x02, 0x05, 0x06, 0x07, 0x09  # data types of CiA 301
BYTES = {INTEGER8: 1, UNSIGNED8: 1, UNSIGNED16: 2, UNSIGNED32: 4}
BYTES |= {code: 2 * Format(wire).words for wire, code in DATA_TYPE.items()}
VAR, RECORD = 7, 9  # object types of CiA 301

VENDOR_NUMBER, PRODUCT_NUMBER, REVISION = 0, 0x49505054, 0x00010000
"""CiA has given the project no vendor number; the product is "IPPT", an I/P with position transmitter."""
NAME = "I/P with position transmitter"


@dataclass(frozen=True, slots=True)
class Variable:
    """One entry of the dictionary."""

    name: str
    type: int
    access: str
    default: str = "0"
    mappable: bool = False

    def lines(self, section: str) -> Iterator[str]:
        """Yield its section."""
        yield f"[{section}]"
        yield f"ParameterName={self.name}"
        yield f"ObjectType=0x{VAR:X}"
        yield f"DataType=0x{self.type:04X}"
        yield f"AccessType={self.access}"
        yield f"DefaultValue={self.default}"
        yield f"PDOMapping={int(self.mappable)}"


@dataclass(frozen=True, slots=True)
class Compound:
    """A record or array: its sub-entries from 1 on; entry 0 holds their number."""

    name: str
    kind: int
    members: tuple[Variable, ...]
    entries: int | None = None
    """What sub-entry 0 says by default, if it can be written."""

    def lines(self, section: str) -> Iterator[str]:
        """Yield its sections."""
        count = len(self.members) if self.entries is None else self.entries
        access = "const" if self.entries is None else "rw"
        number = Variable("Number of entries", UNSIGNED8, access, str(count))
        yield f"[{section}]"
        yield f"ParameterName={self.name}"
        yield f"ObjectType=0x{self.kind:X}"
        yield f"SubNumber={len(self.members) + 1}"
        for n, member in enumerate((number, *self.members)):
            yield ""
            yield from member.lines(f"{section}sub{n:X}")


Object = Variable | Compound


def eds_text() -> str:
    """Return the data sheet of the simulated device."""
    objects = dictionary()
    parts = {
        "MandatoryObjects": [index for index in objects if index in (0x1000, 0x1001, 0x1018)],
        "OptionalObjects": [
            index for index in objects if index not in (0x1000, 0x1001, 0x1018) and not 0x2000 <= index < 0x6000
        ],
        "ManufacturerObjects": [index for index in objects if 0x2000 <= index < 0x6000],
    }
    lines = [*_head()]
    for part, indices in parts.items():
        lines += ["", f"[{part}]", f"SupportedObjects={len(indices)}"]
        lines += [f"{n}=0x{index:04X}" for n, index in enumerate(indices, 1)]
        for index in indices:
            lines += ["", *objects[index].lines(f"{index:04X}")]
    return "\n".join(lines) + "\n"


def dictionary() -> dict[int, Object]:
    """Return the objects of our device, by index."""
    return dict(sorted({**_communication(), **_quantities(), **_profile()}.items()))


def _head() -> Iterator[str]:
    yield "; Made by `python -m fieldbus.canopen.eds` from the table of quantities; do not edit."
    yield from ("[FileInfo]", "FileName=positioner.eds", "FileVersion=1", "FileRevision=0", "EDSVersion=4.0")
    yield f"Description={NAME}"
    yield from ("CreationTime=12:00AM", "CreationDate=01-01-2026", "CreatedBy=positioner", "")
    yield from ("[DeviceInfo]", "VendorName=positioner", f"VendorNumber=0x{VENDOR_NUMBER:08X}", f"ProductName={NAME}")
    yield from (f"ProductNumber=0x{PRODUCT_NUMBER:08X}", f"RevisionNumber=0x{REVISION:08X}", "OrderCode=IPPT")
    yield from (f"BaudRate_{rate}=1" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
    yield from ("SimpleBootUpMaster=0", "SimpleBootUpSlave=1", "Granularity=8", "DynamicChannelsSupported=0")
    yield from ("GroupMessaging=0", "NrOfRXPDO=1", f"NrOfTXPDO={MOST_PDOS}", "LSS_Supported=0", "")
    yield from ("[DummyUsage]", *(f"Dummy{n:04d}=0" for n in range(1, 8)))


def _communication() -> dict[int, Object]:
    objects: dict[int, Object] = {
        0x1000: Variable("Device type", UNSIGNED32, "ro", "0x00000000"),
        0x1001: Variable("Error register", UNSIGNED8, "ro"),
        0x1005: Variable("COB-ID SYNC message", UNSIGNED32, "rw", "0x00000080"),
        0x1008: Variable("Manufacturer device name", VISIBLE_STRING, "const", NAME),
        0x1014: Variable("COB-ID EMCY", UNSIGNED32, "ro", "$NODEID+0x80"),
        0x1017: Variable("Producer heartbeat time_ms", UNSIGNED16, "rw"),
        0x1018: Compound(
            "Identity object",
            RECORD,
            (
                Variable("Vendor-ID", UNSIGNED32, "ro", f"0x{VENDOR_NUMBER:08X}"),
                Variable("Product code", UNSIGNED32, "ro", f"0x{PRODUCT_NUMBER:08X}"),
                Variable("Revision number", UNSIGNED32, "ro", f"0x{REVISION:08X}"),
                Variable("Serial number", UNSIGNED32, "ro"),
            ),
        ),
    }
    objects[0x1400] = _channel("RPDO 1 communication", "$NODEID+0x200")
    objects[0x1600] = _mapping("RPDO 1 mapping", list(SIMULATED_OBJECTS.commanded))
    groups = first_fit({name: _bytes(name) for name in SIMULATED_OBJECTS.sampled})
    for n in range(MOST_PDOS):
        group = groups[n] if n < len(groups) else []
        cob_id = f"$NODEID+0x{0x180 + 0x100 * n:03X}" if group else f"$NODEID+0x{0x80000180 + 0x100 * n:08X}"
        objects[0x1800 + n] = _channel(f"TPDO {n + 1} communication", cob_id)
        objects[0x1A00 + n] = _mapping(f"TPDO {n + 1} mapping", group)
    return objects


def _channel(name: str, cob_id: str) -> Compound:
    number = Variable("COB-ID", UNSIGNED32, "rw", cob_id)
    return Compound(name, RECORD, (number, Variable("Transmission type", UNSIGNED8, "rw", "1")))


def _mapping(name: str, names: Sequence[str]) -> Compound:
    entries = {**SIMULATED_OBJECTS.sampled, **SIMULATED_OBJECTS.commanded}
    mapped = [f"0x{entries[each].index:04X}{entries[each].subindex:02X}{8 * _bytes(each):02X}" for each in names]
    mapped += ["0x00000000"] * (8 - len(mapped))
    members = tuple(Variable(f"Mapped object {n}", UNSIGNED32, "rw", each) for n, each in enumerate(mapped, 1))
    return Compound(name, RECORD, members, entries=len(names))


def _bytes(name: str) -> int:
    types = {each.name: DATA_TYPE[each.type] for each in QUANTITIES}
    return BYTES[types.get(name, UNSIGNED16)]


def _quantities() -> dict[int, Object]:
    """Return the quantities as objects; only the command is worth a PDO among those that are set."""
    entries = SIMULATED_OBJECTS.places
    return {
        entries[each.name].index: Variable(
            each.name,
            DATA_TYPE[each.type],
            "ro" if each.name not in WRITABLE else "rww" if each.name == "command_pa" else "rw",
            mappable=each.name == "command_pa" or each.name not in WRITABLE,
        )
        for each in QUANTITIES
    }


def _profile() -> dict[int, Object]:
    return {
        CONTROL_WORD: Variable("control_word", UNSIGNED16, "rww", mappable=True),
        STATUS_WORD: Variable("status_word", UNSIGNED16, "ro", mappable=True),
        DEVICE_MODE: Variable("device_mode", INTEGER8, "rw", str(int(DeviceMode.BUS))),
    }


def read_eds(path: Path, node: int) -> "ObjectDictionary":
    """Read a data sheet for a node.

    Raises:
        InputError: it cannot be read, or is none.
    """
    import configparser

    import canopen

    text = read_plain(path, "an electronic data sheet")
    try:
        if "[DeviceInfo]" not in text:
            raise ValueError("section [DeviceInfo] is missing")
        found = canopen.import_od(str(path), node)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except (configparser.Error, ValueError, KeyError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"is not an electronic data sheet: {' '.join(str(error).split())}") from None
    if 0x1018 not in found:
        raise InputError(str(path), "is not an electronic data sheet of a node: object 0x1018 (identity) is missing")
    return found


if __name__ == "__main__":
    print(eds_text(), end="")
