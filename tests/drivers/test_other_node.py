"""The CANopen driver before a node that is not ours: a `LocalNode` of the library canopen, with its own SDO server.

It is somebody's running equipment: OPERATIONAL, configured by another master. Until it is known for what it should be,
nothing may be sent to it but questions; where it refuses what it is told, everything is as it was found.
"""

import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError

from config.canopen_device import SHIPPED_EDS, STATUS_WORD, CanopenDevice
from drivers.boundary import BadReply, DriverError, NoReply, Refused
from drivers.canopen.driver import CanopenDriver
from fieldbus.canopen.eds import read_eds
from fieldbus.canopen.loopback import free_channel

pytestmark = pytest.mark.real_time

NODE, HELD_PA, HEARTBEAT_MS = 9, 17e3, 20
READ_ONLY = 0x06010002
CONFIGURATION = [
    *((0x2006, 0), (0x2007, 0), (0x1005, 0), (0x1017, 0)),
    *((record + n, sub) for n in range(3) for record in (0x1800, 0x1A00) for sub in (1, 2)),
    *((record, sub) for record in (0x1400, 0x1600) for sub in (1, 2)),
]


def _local_node() -> Any:
    return canopen.LocalNode(NODE, read_eds(SHIPPED_EDS, NODE))


class OtherNode:
    """The node, and what is sent on its bus."""

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self.network = canopen.Network()
        self.network.connect(interface="loopback", channel=channel, ignore_config=True)
        self.node = _local_node()
        self.network.add_node(self.node)
        self.frames: list[tuple[int, bytes]] = []
        self.constant: set[int] = set()
        self.node.add_write_callback(self._refuse)
        for name, value in (("2005", HELD_PA), ("2006", 7.0)):
            self.node.sdo[int(name, 16)].raw = value
        for index, value in ((0x2007, 2), (STATUS_WORD, 0b1111), (0x1017, HEARTBEAT_MS), (0x6040, 7)):
            self.node.sdo[index].raw = value
        self.node.nmt.state = "OPERATIONAL"
        self.node.nmt.start_heartbeat(HEARTBEAT_MS)
        self.network.subscribe(0, self._note)
        self.network.subscribe(0x600 + NODE, self._note)

    def _note(self, identity: int, data: bytearray, _stamp: float) -> None:
        self.frames.append((identity, bytes(data)))

    def _refuse(self, **write: object) -> None:
        if write["index"] in self.constant:
            raise SdoAbortedError(READ_ONLY)

    @property
    def configuration(self) -> list[bytes]:
        """What its objects hold."""
        return [bytes(self.node.get_data(*where)) for where in CONFIGURATION]

    def settles(self, state: str) -> bool:
        """Whether its NMT state becomes this."""
        end_s = time.monotonic() + 10.0
        while self.node.nmt.state != state and time.monotonic() < end_s:
            time.sleep(1e-3)
        return bool(self.node.nmt.state == state)

    def hears(self, identity: int, data: bytes) -> bool:
        """Whether this frame comes."""
        end_s = time.monotonic() + 10.0
        while (identity, data) not in self.frames and time.monotonic() < end_s:
            time.sleep(1e-3)
        return (identity, data) in self.frames

    def answer_sync(self, tpdos: dict[int, bytes]) -> None:
        """Send these at each SYNC from now on."""

        def answer(*_: object) -> None:
            for identity, data in tpdos.items():
                self.network.send_message(identity, data)

        self.network.subscribe(0x80, answer)

    def close(self) -> None:
        self.node.nmt.stop_heartbeat()
        self.network.disconnect()


@pytest.fixture
def other() -> Iterator[OtherNode]:
    node = OtherNode(free_channel())
    yield node
    node.close()


def driver_of(other: OtherNode, **more: object) -> CanopenDriver:
    described = {"channel": other.channel, "node": NODE, "reply_timeout_s": 2.0, "heartbeat_s": 5.0, **more}
    return CanopenDriver(CanopenDevice.model_validate(described))


def test_a_node_that_is_another_than_its_data_sheet_is_only_asked(other: OtherNode, tmp_path: Path) -> None:
    sheet = tmp_path / "other.eds"
    sheet.write_text(SHIPPED_EDS.read_text().replace("0x49505054", "0x00000408"))
    before = other.configuration
    with pytest.raises(BadReply, match="wrong EDS"):
        driver_of(other, eds=sheet).open()
    assert other.frames, "it was asked"
    assert {(identity, data[0] & 0xE0) for identity, data in other.frames} == {(0x600 + NODE, 0x40)}, "uploads alone"
    assert (other.node.nmt.state, other.configuration) == ("OPERATIONAL", before)


@pytest.mark.parametrize("constant", [0x1A01, 0x1017, 0x6040])
def test_a_node_that_refuses_a_setting_is_left_as_it_was_found(other: OtherNode, constant: int) -> None:
    other.node.sdo[0x1A01][1].raw = 0x20010020
    before = other.configuration
    other.constant = {constant}
    with pytest.raises(Refused, match="SDO abort"):
        driver_of(other).open()
    assert other.hears(0, bytes((128, NODE))), "it had been made PRE-OPERATIONAL"
    assert other.settles("OPERATIONAL")
    assert other.configuration == before


def test_a_node_that_is_as_wanted_is_told_nothing_but_to_be_active(other: OtherNode) -> None:
    """Its SYNC, mappings and time-outs may be constants then."""
    first = driver_of(other, heartbeat_s=1e-3 * HEARTBEAT_MS)
    first.open()
    first.close()
    assert other.hears(0, bytes((1, NODE)))
    other.frames.clear()
    other.constant = {index for index, _ in CONFIGURATION}
    again = driver_of(other, heartbeat_s=1e-3 * HEARTBEAT_MS)
    assert again.open() == HELD_PA
    again.close()
    assert other.hears(0, bytes((1, NODE))), "it is started"
    told = [(identity, data) for identity, data in other.frames if identity == 0 or data[0] & 0xE0 == 0x20]
    assert {data[1:3] for identity, data in told if identity} == {b"\x40\x60"}, "the control word"
    assert [data for identity, data in told if not identity] == [bytes((1, NODE))], "never stopped"


def test_a_node_without_heartbeat_lives_by_its_pdos(other: OtherNode, monkeypatch: pytest.MonkeyPatch) -> None:
    read = other.node.get_data

    def lacking(index: int, *more: Any, **named: Any) -> bytes:
        if index == 0x1017:
            raise SdoAbortedError(0x06020000)
        return bytes(read(index, *more, **named))

    monkeypatch.setattr(other.node, "get_data", lacking)
    driver = driver_of(other, reply_timeout_s=1.0)
    assert driver.open() == HELD_PA
    assert not driver._watcher.is_silent
    with pytest.raises(NoReply, match="SYNC not answered"):
        driver.exchange(HELD_PA)
    driver.close()


def test_a_stopped_node_is_named_and_left_stopped(other: OtherNode, monkeypatch: pytest.MonkeyPatch) -> None:
    """By CiA 301 a STOPPED node answers no SDO; the library's does, so it is kept from it."""
    other.node.nmt.state = "STOPPED"
    monkeypatch.setattr(other.node.sdo, "on_request", lambda *_: None)
    other.network.unsubscribe(0x600 + NODE)
    driver = driver_of(other, reply_timeout_s=0.3)
    with pytest.raises(DriverError, match="node not OPERATIONAL: its heartbeat says STOPPED; it is left so"):
        driver.open()
    assert not [frame for frame in other.frames if frame[0] == 0]
    assert other.node.nmt.state == "STOPPED"


POSITION, PRESSURE, COUNTER, COMMAND = 0x2000, 0x2001, 0x2002, 0x2005
OBJECTS = {"position_m": {"index": POSITION}, "pressure_pa": {"index": PRESSURE}, "command_pa": {"index": COMMAND}}
MAPPED = {0x1800: [(COUNTER, 32), (POSITION, 32)], 0x1801: [(0x2006, 32), (PRESSURE, 32)], 0x1400: [(COMMAND, 32)]}
"""Another master's: each TPDO begins with what nobody here wants."""
COB_IDS = {0x1800: 0x1C1, 0x1801: 0x2C1, 0x1400: 0x341}


def fix_pdos(other: OtherNode, transmission: int = 1) -> None:
    """Give the node PDOs of its own, on arbitration ids of its own, which it lets nobody change."""
    for record, mapped in MAPPED.items():
        other.node.sdo[record][1].raw = COB_IDS[record]
        other.node.sdo[record][2].raw = 1 if record == 0x1400 else transmission
        other.node.sdo[record + 0x200][0].raw = len(mapped)
        for n, (index, bits) in enumerate(mapped, 1):
            other.node.sdo[record + 0x200][n].raw = index << 16 | bits
    for n in (2, 3):
        other.node.sdo[0x1800 + n][1].raw = 1 << 31 | 0x180 + 0x100 * n + NODE
    other.constant = {index + record for index in (0, 0x200) for record in (*MAPPED, 0x1802, 0x1803)}


def test_pdos_that_cannot_be_changed_are_used_as_they_are(other: OtherNode) -> None:
    fix_pdos(other)
    before = other.configuration
    other.answer_sync({0x1C1: struct.pack("<If", 77, 0.025), 0x2C1: struct.pack("<ff", 7.0, 41e3)})
    other.network.subscribe(0x341, other._note)
    driver = driver_of(other, map=OBJECTS)
    assert driver.open() == HELD_PA
    reading = driver.exchange(33e3)
    driver.close()
    assert reading.position_m == pytest.approx(0.025)
    assert reading.pressure_pa == pytest.approx(41e3)
    assert other.hears(0x341, struct.pack("<f", 33e3))
    assert other.configuration[4:] == before[4:], "no PDO was told anything"


def test_fixed_pdos_that_lack_what_is_wanted_are_refused_and_left(other: OtherNode) -> None:
    fix_pdos(other)
    before = other.configuration
    with pytest.raises(Refused, match="SDO abort"):
        driver_of(other).open()
    assert other.configuration[4:] == before[4:]
    assert other.settles("OPERATIONAL")


def test_fixed_pdos_that_come_by_themselves_are_refused(other: OtherNode) -> None:
    """Whether such a sample is new, nothing tells."""
    fix_pdos(other, transmission=255)
    with pytest.raises(Refused, match="SDO abort"):
        driver_of(other, map=OBJECTS).open()


def test_what_else_an_rpdo_takes_would_be_commanded(other: OtherNode) -> None:
    fix_pdos(other)
    other.constant = set()
    other.node.sdo[0x1600][0].raw = 2
    other.node.sdo[0x1600][2].raw = 0x20060020
    other.constant = {0x1400, 0x1600}
    with pytest.raises(Refused, match="SDO abort"):
        driver_of(other, map=OBJECTS).open()
