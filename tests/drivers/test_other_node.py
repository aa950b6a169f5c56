"""The CANopen driver before a node that is not ours: a `LocalNode` of the library canopen, with its own SDO server.

It is somebody's running equipment: OPERATIONAL, configured by another master. Until it is known for what it should be,
nothing may be sent to it but questions; where it refuses what it is told, everything is as it was found.
"""

import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.sdo.exceptions import SdoAbortedError

from config.canopen_device import SHIPPED_EDS, SIMULATED_OBJECTS, STATUS_WORD, CanopenDevice
from drivers.boundary import BadReply, DriverError, ForeseesRefusal, NoReply, Reading, Refused
from drivers.canopen.driver import CanopenDriver, canopen_driver
from fieldbus.canopen.eds import read_eds
from fieldbus.canopen.loopback import free_channel
from fieldbus.canopen.objects import NodeState

pytestmark = pytest.mark.real_time

NODE, HELD_PA, HEARTBEAT_MS = 9, 17e3, 20
ENDS_WITHIN_S = 0.05
"""Its thread looks this often whether it is to end; by default once a second, at the end of every test."""
READ_ONLY = 0x06010002
CONFIGURATION = [
    *((0x2006, 0), (0x2007, 0), (0x1005, 0), (0x1017, 0)),
    *((record + n, sub) for n in range(3) for record in (0x1800, 0x1A00) for sub in (1, 2)),
    *((record, sub) for record in (0x1400, 0x1600) for sub in (1, 2)),
]


MASTER, WATCHED_MS = 126, 125
MORE_OBJECTS = """
[1016]
ParameterName=Consumer heartbeat time
ObjectType=0x8
SubNumber=2

[1016sub0]
ParameterName=Number of entries
ObjectType=0x7
DataType=0x0005
AccessType=const
DefaultValue=1

[1016sub1]
ParameterName=Consumer heartbeat 1
ObjectType=0x7
DataType=0x0007
AccessType=rw
DefaultValue=0
""" + "".join(
    f"\n[{record:X}sub5]\nParameterName=Event timer\nObjectType=0x7\nDataType=0x0006\nAccessType=rw\nDefaultValue=0\n"
    for record in (0x1800, 0x1801)
)
"""What some nodes have beyond ours."""


def sheet_with_more(folder: Path) -> Path:
    """Return our data sheet with consumed heartbeats and event timers."""
    text = SHIPPED_EDS.read_text()
    for record in ("1800", "1801"):
        text = text.replace(f"[{record}]\nParameterName=", f"[{record}]\n;with a timer\nParameterName=")
        head, _, rest = text.partition(f"[{record}]\n")
        text = head + f"[{record}]\n" + rest.replace("SubNumber=3", "SubNumber=4", 1)
    text = text.replace("[OptionalObjects]\nSupportedObjects=", "[OptionalObjects]\n999=0x1016\nSupportedObjects=")
    path = folder / "more.eds"
    path.write_text(text + MORE_OBJECTS)
    return path


def _local_node(sheet: Path = SHIPPED_EDS) -> Any:
    return canopen.LocalNode(NODE, read_eds(sheet, NODE))


class OtherNode:
    """The node, and what is sent on its bus."""

    def __init__(self, channel: str, sheet: Path = SHIPPED_EDS) -> None:
        self.channel = channel
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = ENDS_WITHIN_S
        self.network.connect(interface="loopback", channel=channel, ignore_config=True)
        self.node = _local_node(sheet)
        self.network.add_node(self.node)
        self.frames: list[tuple[int, bytes]] = []
        self.constant: set[int] = set()
        self.node.add_write_callback(self._refuse)
        self.node.nmt.state = "OPERATIONAL"  # before 0x1017, whose heartbeat would say first that it boots
        for name, value in (("2005", HELD_PA), ("2006", 7.0)):
            self.node.sdo[int(name, 16)].raw = value
        for index, value in ((0x2007, 2), (STATUS_WORD, 0b1111), (0x1017, HEARTBEAT_MS), (0x6040, 7)):
            self.node.sdo[index].raw = value
        self.network.subscribe(0, self.note)
        self.network.subscribe(0x600 + NODE, self.note)

    def note(self, identity: int, data: bytearray, _stamp: float) -> None:
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


SET_POINT, PRESSURE_IS = 0x2005, 0x2001


@pytest.mark.parametrize(
    ("status_word", "shown_pa", "told", "held_pa"),
    [
        (NodeState.FAULT_DISABLED, 40.0, "vent", 0.0),
        (NodeState.DISABLED, 16.9e3, "vent", HELD_PA),
        (NodeState.FAULT_HOLD, 16.9e3, "hold", HELD_PA),
        (NodeState.FAULT_HOLD, 250e3, "fill", 250e3),
        (NodeState.ACTIVE, 40.0, "vent", HELD_PA),
        (NodeState.FAULT_DISABLED, None, "vent", 0.0),
        (NodeState.FAULT_HOLD, None, "hold", HELD_PA),
    ],
)
def test_a_node_that_vented_or_filled_and_kept_its_set_point_is_given_what_it_does_before_it_is_made_active(
    other: OtherNode, status_word: int, shown_pa: float | None, told: str, held_pa: float
) -> None:
    """Else it would go to its set point with ACTIVE: a valve that moves at start or reconnection."""
    other.node.sdo[STATUS_WORD].raw = status_word
    other.node.sdo[PRESSURE_IS].raw = shown_pa or 0.0
    objects = SIMULATED_OBJECTS.model_dump(exclude_none=True)
    if shown_pa is None:
        del objects["pressure_pa"]
    told_words: list[tuple[int, float]] = []
    other.node.add_write_callback(
        lambda index, **_: told_words.append((index, other.node.sdo[SET_POINT].raw)) if index == 0x6040 else None
    )
    driver = driver_of(other, map=objects, communication_action=told)
    assert driver.open() == pytest.approx(held_pa)
    driver.close()
    assert told_words, "it was made ACTIVE"
    assert {set_point_pa for _, set_point_pa in told_words} == {held_pa}


def test_a_node_without_heartbeat_lives_by_its_pdos(other: OtherNode, monkeypatch: pytest.MonkeyPatch) -> None:
    read = other.node.get_data

    def lacking(index: int, *more: Any, **named: Any) -> bytes:
        if index == 0x1017:
            raise SdoAbortedError(0x06020000)
        return bytes(read(index, *more, **named))

    monkeypatch.setattr(other.node, "get_data", lacking)
    driver = driver_of(other, reply_timeout_s=1.0)
    assert driver.open() == HELD_PA
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
    other.network.subscribe(0x341, other.note)
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


def test_a_node_that_says_that_it_boots_is_asked_again_what_it_does(other: OtherNode) -> None:
    """A boot-up frame that came late left a node stopped that ran when it was found."""
    fix_pdos(other)
    asks_heartbeat = b"\x40" + struct.pack("<H", 0x1017)

    def boot(_identity: int, data: bytearray, _stamp: float) -> None:
        if data.startswith(asks_heartbeat):
            other.network.send_message(0x700 + NODE, b"\0")

    other.network.subscribe(0x600 + NODE, boot)
    with pytest.raises(Refused, match="SDO abort"):
        driver_of(other).open()
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


def test_pdos_that_come_by_themselves_with_a_timer_are_used_as_they_are(tmp_path: Path) -> None:
    """The newest counts; a sample is new when every such TPDO came anew. No SYNC is sent where none is waited for."""
    other = OtherNode(free_channel(), sheet_with_more(tmp_path))
    try:
        for record in (0x1800, 0x1801):
            other.node.sdo[record][5].raw = 20
        fix_pdos(other, transmission=255)
        other.constant = set()
        other.node.sdo[0x1400][2].raw = 255
        other.constant = {index + record for index in (0, 0x200) for record in (*MAPPED, 0x1802, 0x1803)}
        other.network.subscribe(0x80, other.note)
        before = other.configuration
        driver = driver_of(other, map=OBJECTS)
        assert driver.open() == HELD_PA
        assert driver.capabilities.sample_counter
        other.network.send_message(0x1C1, struct.pack("<If", 1, 0.025))
        other.network.send_message(0x2C1, struct.pack("<ff", 7.0, 41e3))
        readings = [driver.exchange(33e3), driver.exchange(33e3)]
        other.network.send_message(0x2C1, struct.pack("<ff", 7.0, 42e3))
        readings.append(_until(driver, lambda each: each.pressure_pa == pytest.approx(42e3)))
        other.network.send_message(0x1C1, struct.pack("<If", 1, 0.026))
        readings.append(_until(driver, lambda each: each.position_m == pytest.approx(0.026)))
        driver.close()
        assert [each.sample_counter for each in readings] == [1, 1, 1, 2]
        assert other.configuration[4:] == before[4:], "no PDO was told anything"
        assert 0x80 not in {identity for identity, _ in other.frames}
    finally:
        other.close()


def _until(driver: CanopenDriver, holds: Callable[[Reading], bool]) -> Reading:
    """Exchange until a reading is as asked."""
    end_s = time.monotonic() + 10.0
    while not holds(reading := driver.exchange(33e3)):
        assert time.monotonic() < end_s
    return reading


def test_a_node_that_shall_watch_its_master_hears_its_heartbeat(tmp_path: Path) -> None:
    other = OtherNode(free_channel(), sheet := sheet_with_more(tmp_path))
    try:
        fix_pdos(other)
        other.answer_sync({0x1C1: struct.pack("<If", 77, 0.025), 0x2C1: struct.pack("<ff", 7.0, 41e3)})
        other.network.subscribe(0x700 + MASTER, other.note)
        driver = driver_of(
            other, map=OBJECTS, eds=sheet, master_node=MASTER, master_heartbeat_s=0.05, heartbeats_missed=2.5
        )
        driver.open()
        driver.exchange(33e3)
        assert other.hears(0x700 + MASTER, b"\x05")
        assert other.node.sdo[0x1016][1].raw == MASTER << 16 | WATCHED_MS
        driver.close()
        other.constant |= {0x1016}
        driver.open()
        driver.close()
    finally:
        other.close()


def test_a_node_that_watches_nobody_is_not_told_to(other: OtherNode) -> None:
    with pytest.raises(Refused, match="watches no heartbeat"):
        driver_of(other, master_node=MASTER).open()
    assert other.node.nmt.state == "OPERATIONAL"


def test_the_code_of_an_emergency_is_read_until_it_is_over(other: OtherNode) -> None:
    fix_pdos(other)
    other.answer_sync({0x1C1: struct.pack("<If", 77, 0.025), 0x2C1: struct.pack("<ff", 7.0, 41e3)})
    driver = driver_of(other, map=OBJECTS)
    driver.open()
    assert driver.exchange(33e3).emergency == 0
    for code in (0x4210, 0x0000):
        other.node.emcy.send(code, 0x09)
        assert _until(driver, lambda each, code=code: each.emergency == code).status == 0  # type: ignore[misc]
    driver.close()


def test_a_set_point_that_another_master_wrote_is_read_back(other: OtherNode) -> None:
    fix_pdos(other)
    other.answer_sync({0x1C1: struct.pack("<If", 77, 0.025), 0x2C1: struct.pack("<ff", 7.0, 41e3)})
    driver = driver_of(other, map=OBJECTS)
    driver.open()
    driver.exchange(33e3)
    other.node.sdo[COMMAND].raw = 70e3
    assert driver.held_pa() == 70e3
    driver.close()


def test_a_watcher_says_what_driving_would_be_refused(other: OtherNode, tmp_path: Path) -> None:
    """By the data sheet, before anybody drives it."""
    fixed = tmp_path / "fixed.eds"
    text = SHIPPED_EDS.read_text()
    head, mark, rest = text.partition("[1A01sub1]")
    fixed.write_text(head + mark + rest.replace("AccessType=rw", "AccessType=ro", 1))
    other.node.sdo[0x1A01][1].raw = 0x20010020
    before = other.configuration
    watching = canopen_driver(CanopenDevice(channel=other.channel, node=NODE, reply_timeout_s=2.0, only_watch=True))
    watching.open()
    assert isinstance(watching, ForeseesRefusal)
    assert watching.refused() is None
    watching.close()
    described = {"channel": other.channel, "node": NODE, "reply_timeout_s": 2.0, "only_watch": True, "eds": fixed}
    watching = canopen_driver(CanopenDevice.model_validate(described))
    watching.open()
    assert isinstance(watching, ForeseesRefusal)
    assert watching.refused() == "0x1a01 sub 1 would have to be set, and the data sheet lets nobody"
    watching.close()
    assert other.configuration == before
