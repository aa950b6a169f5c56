"""The PDOs of a node as it was found: what its records say they carry (CiA 301, 7.5.2.35 to 7.5.2.38).

    0x1400, 0x1800 + n   communication   sub 1 COB-ID, bit 31 set where the PDO is not in use; sub 2 transmission type;
                                         sub 5 event timer, ms
    0x1600, 0x1A00 + n   mapping         sub 0 how many, sub 1 on: index << 16 | sub-index << 8 | bits

Some nodes have PDOs that cannot be changed, and others serve another master, too. Where they carry all that is wanted
they are used as they are, and nothing is told: TPDOs sent at each SYNC, whatever else is in them, or by themselves with
an event timer, without which a stem at rest could not be told from a sensor that has died; one RPDO with what is
commanded and nothing else, for what else is in it would be commanded, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from canopen.objectdictionary import ObjectDictionary

from config.canopen_device import Entry
from drivers.canopen.sdo import SdoTransfers
from fieldbus.canopen.objects import MOST_PDOS, PDO_BYTES

MAPPING = 0x200
"""From a communication record to the mapping of the same PDO."""
INVALID = 1 << 31
"""Of a PDO's COB-ID."""
COB_ID = (1 << 11) - 1
EACH_SYNC, LAST_SYNCHRONOUS, BY_ITSELF = 1, 240, (254, 255)
"""Transmission types."""
EVENT_TIMER_MS = 5
"""Sub-index."""
Place = tuple[int, int]
"""Index and sub-index."""


@dataclass(frozen=True, slots=True)
class FoundPdo:
    """A PDO in use: its communication record, and what it carries in order, each with its bytes."""

    record: int
    cob_id: int
    transmission: int
    carried: tuple[tuple[Place, int], ...]
    event_timer_s: float = 0.0
    """The longest time from one to the next; 0: there is none."""

    @property
    def comes_by_itself(self) -> bool:
        """Whether it is sent without SYNC, and often enough that its silence says something."""
        return self.transmission in BY_ITSELF and self.event_timer_s > 0

    @property
    def places(self) -> frozenset[Place]:
        """What it carries."""
        return frozenset(place for place, _ in self.carried)


def found_pdos(sdo: SdoTransfers, sheet: ObjectDictionary, first_record: int) -> list[FoundPdo]:
    """Return the PDOs in use of one direction; those that carry parts of bytes are left out.

    Args:
        sdo: of the node.
        sheet: its data sheet.
        first_record: 0x1400 or 0x1800.

    Raises:
        DriverError: as `SdoTransfers.upload`.
    """
    found = []
    for record in range(first_record, first_record + MOST_PDOS):
        if record not in sheet or (identity := int(sdo.upload(record, 1))) & INVALID:
            continue
        count = int(sdo.upload(record + MAPPING, 0))
        mapped = [int(sdo.upload(record + MAPPING, n)) for n in range(1, count + 1)] if count <= PDO_BYTES else []
        if mapped and not any(each & 0x7 for each in mapped):
            carried = tuple(((each >> 16, each >> 8 & 0xFF), (each & 0xFF) // 8) for each in mapped)
            transmission = int(sdo.upload(record, 2))
            timer_ms = sdo.whole_number(record, EVENT_TIMER_MS) if transmission in BY_ITSELF else 0
            found.append(FoundPdo(record, identity & COB_ID, transmission, carried, 1e-3 * timer_ms))
    return found


def that_carry(found: list[FoundPdo], wanted: Mapping[str, Entry]) -> list[FoundPdo] | None:
    """Return those TPDOs that bring all quantities, each once, at SYNC or by themselves; None where they do not."""
    places = {(entry.index, entry.subindex) for entry in wanted.values()}
    carrying = [each for each in found if each.places & places]
    brought = [place for each in carrying for place, _ in each.carried if place in places]
    usable = all(each.transmission == EACH_SYNC or each.comes_by_itself for each in carrying)
    if sorted(brought) != sorted(places) or not usable:
        return None
    return carrying


def that_takes(found: list[FoundPdo], wanted: Mapping[str, Entry]) -> FoundPdo | None:
    """Return the RPDO that takes what is commanded and nothing else; None where there is none, or more than one."""
    places = sorted((entry.index, entry.subindex) for entry in wanted.values())
    taking = [each for each in found if sorted(place for place, _ in each.carried) == places]
    return taking[0] if len(taking) == 1 else None
