"""The CANopen driver before a node that is not ours: a `LocalNode` of the library canopen, with its own SDO server.

It is somebody's running equipment: OPERATIONAL, configured by another master. Until it is known for what it should be,
nothing may be sent to it but questions; where it refuses what it is told, everything is as it was found.
"""

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
    assert (0, bytes((128, NODE))) in other.frames, "it had been made PRE-OPERATIONAL"
    assert other.settles("OPERATIONAL")
    assert other.configuration == before


def test_a_node_that_is_as_wanted_is_told_nothing_but_to_be_active(other: OtherNode) -> None:
    """Its SYNC, mappings and time-outs may be constants then."""
    first = driver_of(other, heartbeat_s=1e-3 * HEARTBEAT_MS)
    first.open()
    first.close()
    other.frames.clear()
    other.constant = {index for index, _ in CONFIGURATION}
    again = driver_of(other, heartbeat_s=1e-3 * HEARTBEAT_MS)
    assert again.open() == HELD_PA
    again.close()
    told = [(identity, data) for identity, data in other.frames if identity == 0 or data[0] & 0xE0 == 0x20]
    assert {data[1:3] for identity, data in told if identity} == {b"\x40\x60"}, "the control word"
    assert [data for identity, data in told if not identity] == [bytes((1, NODE))], "and started, never stopped"


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
