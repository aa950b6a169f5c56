"""What the CANopen driver makes of a node or a bus that fails: each a named event, and recovery by `open` alone.

The node below is the simulated one, honest until it is given a fault: what becomes of each frame it sends.
"""

import logging
import struct
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import can
import pytest

from config.canopen_device import SHIPPED_EDS, SIMULATED_OBJECTS, STATUS_WORD, CanBus, CanopenDevice, Entry
from config.errors import InputError
from config.quantities import DeviceStatus
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers.boundary import BadReply, DriverError, NoConnection, NoNumber, NoReply, Refused
from drivers.canopen import pdo, watcher
from drivers.canopen.driver import CanopenDriver
from drivers.canopen.events import NodeEvent
from fieldbus.canopen.loopback import free_channel
from fieldbus.canopen.objects import NodeState
from sim.slave import canopen_slave
from sim.slave.canopen_slave import NodeServer
from sim.slave.clocks import Clock, Lockstep, RealTime
from sim.slave.slave import device_of
from tests.recovery import taken_up

pytestmark = pytest.mark.real_time

NODE, HELD_PA, PUSH_PA = 5, 17e3, 60e3
FILE = SlaveFile.model_validate({"initial": {"position_m": 0.02, "pressure_pa": HELD_PA}})
PATIENT_S = 2.0
"""Where time is no matter, so that a busy machine is none."""
TPDO_1, HEARTBEAT, ANSWER = 0x180 + NODE, 0x700 + NODE, 0x580 + NODE

Fault = Callable[[int, bytes], list[tuple[int, bytes]]]
"""From the arbitration id and data of a frame that the node sends to the frames that leave."""


def honest(identity: int, data: bytes) -> list[tuple[int, bytes]]:
    return [(identity, data)]


def without(*identities: int) -> Fault:
    return lambda identity, data: [] if identity in identities else [(identity, data)]


class Scripted(NodeServer):
    """A node whose frames a fault may change. Its time is given where it is not in lockstep."""

    def __init__(self, channel: str, clock: str = "lockstep") -> None:
        self.fault: Fault = honest
        self.now_ns = 0
        self.device = device_of(FILE, shipped_valve("seed"))
        clocks: dict[str, Callable[[], Clock]] = {
            "lockstep": lambda: Lockstep(self.device),
            "given": lambda: RealTime(self.device, 1000, lambda: self.now_ns),
        }
        super().__init__(CanBus(channel=channel, node=NODE), self.device, clocks[clock](), "test")

    def send(self, identity: int, data: bytes) -> None:
        for each in self.fault(identity, data):
            super().send(*each)


def config(channel: str, **more: object) -> CanopenDevice:
    return CanopenDevice.model_validate({"channel": channel, "node": NODE, "reply_timeout_s": PATIENT_S, **more})


@pytest.fixture(autouse=True)
def nobody_listened_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A node alone on its channel looks whether its id is free, and waits for no answer."""
    monkeypatch.setattr(canopen_slave, "LISTEN_S", 0.0)


@pytest.fixture
def channel() -> str:
    return free_channel()


@pytest.fixture
def node(channel: str) -> Iterator[Scripted]:
    node = Scripted(channel)
    node.start()
    yield node
    node.stop()


@pytest.fixture
def driver(node: Scripted, channel: str) -> Iterator[CanopenDriver]:
    driver = CanopenDriver(config(channel, heartbeat_s=PATIENT_S))
    driver.open()
    assert driver.exchange(PUSH_PA).sample_counter == 1
    yield driver
    driver.close()


@pytest.fixture
def third(channel: str) -> Iterator[can.BusABC]:
    """Another end of the bus."""
    with can.Bus(interface="loopback", channel=channel, ignore_config=True) as bus:
        yield bus


def frame(identity: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=identity, data=data, is_extended_id=False)


def fails(kind: type[DriverError], event: NodeEvent, act: Callable[[], object]) -> str:
    """Return the one line that is said, which names the node and then the event."""
    with pytest.raises(DriverError) as caught:
        act()
    assert type(caught.value) is kind, caught.value
    text = str(caught.value)
    assert "\n" not in text
    assert text.split(f"node {NODE}: ")[1].startswith(event), text
    return text


def recovers(driver: CanopenDriver, node: Scripted) -> None:
    """No call works until `open`, and then the newest measurement comes."""
    for act in (driver.read, lambda: driver.write(PUSH_PA), lambda: driver.exchange(PUSH_PA)):
        with pytest.raises(NoConnection):
            act()
    node.fault = honest
    reading = taken_up(driver, PUSH_PA)
    assert reading.sample_counter == node.device.sample_counter
    assert reading.position_m == pytest.approx(node.device.position_m, rel=1e-6)
    assert reading.status == 0


def in_time(holds: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(1e-3)


def test_sync_that_nobody_answers(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = without(TPDO_1)
    text = fails(NoReply, NodeEvent.SYNC_LOST, lambda: driver.exchange(PUSH_PA))
    assert "1 of 3 TPDOs missing 2000 ms after SYNC" in text
    recovers(driver, node)


def test_a_node_that_talks_of_all_else_does_not_keep_the_driver_beyond_its_time_out(
    driver: CanopenDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In virtual time: a heartbeat every millisecond for ever, and no TPDO."""
    now_s = [time.monotonic()]

    class Clock:
        monotonic = staticmethod(lambda: now_s[0])

    def babble(_timeout_s: float) -> can.Message:
        now_s[0] += 1e-3
        return frame(HEARTBEAT, b"\x05")

    for each in (pdo, watcher):
        monkeypatch.setattr(each, "time", Clock)
    monkeypatch.setattr(driver.bus, "receive", babble)
    start_s = now_s[0]
    fails(NoReply, NodeEvent.SYNC_LOST, driver.pdos.sample)
    assert now_s[0] - start_s == pytest.approx(PATIENT_S, abs=2e-3)


def test_a_stale_tpdo_behind_an_error_frame_is_not_taken_for_fresh(
    driver: CanopenDriver, third: can.BusABC, node: Scripted
) -> None:
    stale = struct.pack("<ff", 0.09, PUSH_PA)
    third.send(can.Message(arbitration_id=4, is_error_frame=True, data=bytes(8), is_extended_id=False))
    third.send(frame(TPDO_1, stale))
    text = fails(BadReply, NodeEvent.NODE_ID_TAKEN, lambda: driver.exchange(PUSH_PA))
    assert "a TPDO without SYNC" in text
    recovers(driver, node)


def test_a_heartbeat_that_stops_while_samples_come(node: Scripted, channel: str) -> None:
    driver = CanopenDriver(config(channel, heartbeat_s=0.02))
    driver.open()
    node.fault = without(HEARTBEAT)

    def cycle_on() -> None:
        end_s = time.monotonic() + 60
        while time.monotonic() < end_s:
            driver.exchange(PUSH_PA)

    fails(NoReply, NodeEvent.HEARTBEAT_LOST, cycle_on)
    recovers(driver, node)
    driver.close()


def test_a_pdo_too_short_is_never_a_measurement(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [(identity, data[:5] if identity == TPDO_1 else data)]
    assert "TPDO 1 has 5 bytes, mapped are 8" in fails(
        BadReply, NodeEvent.PDO_TOO_SHORT, lambda: driver.exchange(PUSH_PA)
    )
    recovers(driver, node)


def test_a_measurement_that_is_no_number_is_refused_and_the_next_taken(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [
        (identity, struct.pack("<ff", float("nan"), 0) if identity == TPDO_1 else data)
    ]
    with pytest.raises(NoNumber, match="no number: position_m nan"):
        driver.exchange(PUSH_PA)
    node.fault = honest
    assert driver.exchange(PUSH_PA).sample_counter == 3


def test_an_sdo_abort_names_the_object_and_the_reason(driver: CanopenDriver, node: Scripted) -> None:
    def abort_mapping(identity: int, data: bytes) -> list[tuple[int, bytes]]:
        aborted = identity == ANSWER and data[1:4] == b"\x01\x1a\x02"
        return [(identity, b"\x80\x01\x1a\x02" + struct.pack("<I", 0x06040041) if aborted else data)]

    node.fault = abort_mapping
    text = fails(Refused, NodeEvent.SDO_ABORT, driver.open)
    assert "0x1a01 sub 2: Code 0x06040041, Object cannot be mapped to the PDO" in text
    recovers(driver, node)


def test_an_sdo_request_that_is_not_answered(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [] if identity == ANSWER and data[1:3] == b"\x17\x10" else [(identity, data)]
    assert "0x1017 sub 0" in fails(NoReply, NodeEvent.SDO_TIMEOUT, driver.open)
    recovers(driver, node)


STALE = b"\x43\x05\x20\x00" + struct.pack("<f", 99e3)
"""The answer to an earlier request: a pressure held long ago."""


def test_late_answers_to_what_was_asked_before_are_passed_over(driver: CanopenDriver, node: Scripted) -> None:
    """A slow node still answers what was asked before the bus was left; none of it is this session's."""
    node.fault = lambda identity, data: [(ANSWER, STALE)] * 40 * (data[0] == 0x80) + [(identity, data)]
    assert driver.open() == PUSH_PA
    node.fault = lambda identity, data: [(ANSWER, STALE)] if data[0] == 0x80 else [(identity, data)]
    driver.sdo.timeout_s = 0.1
    fails(NoConnection, NodeEvent.NO_NODE, driver.open)


def test_a_node_that_does_not_name_what_it_refuses_is_no_worse(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [(identity, b"\x80\0\0\0" + data[4:] if data[0] == 0x80 else data)]
    assert driver.open() == PUSH_PA


def test_an_answer_to_nothing_asked_is_never_taken_for_another(driver: CanopenDriver, node: Scripted) -> None:
    """A pressure held long ago comes before the one asked for: it is told apart, and counted."""
    late = [False]

    def once(identity: int, data: bytes) -> list[tuple[int, bytes]]:
        is_late = identity == ANSWER and data[1:4] == b"\x18\x10\x02" and not late[0]
        late[0] |= is_late
        return [(ANSWER, STALE), (identity, data)] if is_late else [(identity, data)]

    node.fault = once
    assert "answers to" in fails(BadReply, NodeEvent.NODE_ID_TAKEN, driver.open), (
        "a held pressure of 99 kPa was not taken"
    )
    recovers(driver, node)


def test_what_another_master_is_told_of_the_same_object_does_not_confirm_a_write(
    driver: CanopenDriver, node: Scripted
) -> None:
    """The answer to its read names the object that is written, and is of another kind."""
    driver.open()
    entry = config("any").map.command_pa
    read = b"\x43" + struct.pack("<HB", entry.index, entry.subindex) + struct.pack("<f", 99e3)

    def told_too(identity: int, data: bytes) -> list[tuple[int, bytes]]:
        confirms = identity == ANSWER and data[0] == 0x60
        return [(ANSWER, read), (identity, data)] if confirms else [(identity, data)]

    node.fault = told_too
    driver.sdo.set(entry, PUSH_PA)
    node.fault = lambda identity, data: [(ANSWER, read)] if data[0] == 0x60 else [(identity, data)]
    driver.sdo.timeout_s = 0.1
    with pytest.raises(NoReply, match="no answer"):
        driver.sdo.set(entry, PUSH_PA)


def test_every_request_answered_twice_is_two_nodes(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [(identity, data)] * (2 if identity == ANSWER else 1)
    assert "answers to" in fails(BadReply, NodeEvent.NODE_ID_TAKEN, driver.open)
    recovers(driver, node)


def test_a_data_sheet_of_another_device(node: Scripted, channel: str, tmp_path: Path) -> None:
    other = tmp_path / "other.eds"
    other.write_text(SHIPPED_EDS.read_text().replace("0x49505054", "0x00000408"))
    driver = CanopenDriver(config(channel, eds=other))
    text = fails(BadReply, NodeEvent.WRONG_EDS, driver.open)
    assert "it says product 0x49505054, other.eds is of 0x00000408" in text
    assert node.device.samples == 0, "and nothing was moved"


def test_a_data_sheet_that_lacks_what_the_map_names(channel: str, tmp_path: Path) -> None:
    lacking = SIMULATED_OBJECTS.model_copy(update={"pressure_pa": Entry(index=0x2FFF)})
    with pytest.raises(
        InputError, match=r"positioner.eds: device.map.pressure_pa: the data sheet has no number at 0x2fff"
    ):
        CanopenDriver(config(channel, map=lacking))


def test_scale_and_offset_of_the_map_hold_both_ways(node: Scripted, channel: str) -> None:
    halved = SIMULATED_OBJECTS.model_copy(
        update={"command_pa": Entry(index=0x2005, scale=0.5), "position_m": Entry(index=0x2000, scale=2.0, offset=1.0)}
    )
    driver = CanopenDriver(config(channel, map=halved))
    assert driver.open() == 0.5 * HELD_PA
    assert driver.exchange(20e3).position_m == pytest.approx(1.0 + 2.0 * node.device.position_m)
    assert node.device.command_pa == 40e3
    driver.close()


def test_two_nodes_of_one_id_are_told_and_one_is_enough(
    driver: CanopenDriver, node: Scripted, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canopen_slave, "LISTEN_S", 10.0)  # it ends with the answer
    twin = Scripted(channel)
    with pytest.raises(InputError, match=r"bus\.node: 5 is taken by another node"):
        twin.start()
    forced = Scripted(channel)
    forced.begin()  # without listening first
    forced.node.receive(0, bytes((1, NODE)))
    with pytest.raises(DriverError):  # its boot-up, then twice the TPDOs
        _ = [driver.exchange(PUSH_PA) for _ in range(10)]

    def open_and_cycle() -> None:
        driver.open()  # both answer, and if one is too slow to be noticed by then, it answers SYNC
        in_time(lambda: driver.exchange(PUSH_PA) is None)

    fails(BadReply, NodeEvent.NODE_ID_TAKEN, open_and_cycle)
    forced.stop()
    recovers(driver, node)


def test_samples_of_two_nodes_are_told_apart(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = lambda identity, data: [(identity, data)] * (2 if identity == TPDO_1 else 1)
    fails(BadReply, NodeEvent.NODE_ID_TAKEN, lambda: [driver.exchange(PUSH_PA) for _ in range(3)])
    recovers(driver, node)


def test_bus_off(driver: CanopenDriver, node: Scripted, third: can.BusABC) -> None:
    third.send(can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8), is_extended_id=False))
    fails(NoConnection, NodeEvent.BUS_OFF, lambda: driver.exchange(PUSH_PA))
    recovers(driver, node)


def test_an_interface_that_is_not_there() -> None:
    driver = CanopenDriver(config("nowhere0", interface="socketcan"))
    fails(NoConnection, NodeEvent.BUS_OFF, driver.open)
    driver = CanopenDriver(config("x", interface="nosuch"))
    assert "'nosuch' not supported" in fails(NoConnection, NodeEvent.BUS_OFF, driver.open)


@pytest.mark.parametrize(
    ("command", "event"),
    [(129, NodeEvent.NODE_RESTARTED), (130, NodeEvent.NODE_RESTARTED), (2, NodeEvent.NOT_OPERATIONAL)],
)
def test_a_node_that_another_master_resets_or_stops(
    driver: CanopenDriver, node: Scripted, third: can.BusABC, command: int, event: NodeEvent
) -> None:
    node.node.send_message(HEARTBEAT, bytes((5,)))
    third.send(frame(0, bytes((command, NODE))))
    in_time(lambda: node.node.state != 5)
    if command == 2:
        node.node.send_message(HEARTBEAT, bytes((4,)))
    fails(NoConnection, event, lambda: driver.exchange(PUSH_PA))
    if command == 2:
        driver.sdo.timeout_s = 0.05
        fails(NoConnection, NodeEvent.NO_NODE, driver.open)
        assert node.node.state == 4, "it is left as the other master wants it"
        driver.sdo.timeout_s = PATIENT_S
        third.send(frame(0, bytes((128, NODE))))
        in_time(lambda: node.node.state == 127)
    driver.open()
    statuses = [driver.read().status for _ in range(2)]
    assert statuses == [DeviceStatus.NOT_READY, 0], "the first sample is a fault of the device, however quick it was"
    driver.close()
    recovers(driver, node)


def test_a_node_that_was_stopped_is_one_though_its_tpdo_was_missed_before_its_heartbeat_said_so(
    driver: CanopenDriver, node: Scripted, third: can.BusABC
) -> None:
    third.send(frame(0, bytes((128, NODE))))
    in_time(lambda: node.node.state == 127)
    driver.pdos.reply_timeout_s = 0.05
    fails(NoReply, NodeEvent.SYNC_LOST, lambda: driver.exchange(PUSH_PA))
    driver.pdos.reply_timeout_s = PATIENT_S
    beat = (HEARTBEAT, bytes((127,)))
    node.fault = lambda identity, data: [(identity, data), beat] if identity == ANSWER else [(identity, data)]
    driver.open()
    node.fault = honest
    statuses = [driver.read().status for _ in range(2)]
    assert statuses == [DeviceStatus.NOT_READY, 0], "another master wanted it so: that is a fault, not a lost sample"


def test_a_tpdo_that_is_lost_is_no_stop_of_the_node(driver: CanopenDriver, node: Scripted) -> None:
    node.fault = without(TPDO_1)
    driver.pdos.reply_timeout_s = 0.05
    fails(NoReply, NodeEvent.SYNC_LOST, lambda: driver.exchange(PUSH_PA))
    driver.pdos.reply_timeout_s = PATIENT_S
    node.fault = honest
    driver.open()
    assert driver.read().status == 0


def test_a_heartbeat_from_before_the_start_is_not_taken_for_a_stop(driver: CanopenDriver, node: Scripted) -> None:
    node.node.send_message(HEARTBEAT, bytes((127,)))
    assert driver.exchange(PUSH_PA).sample_counter == 2


def test_a_node_operated_locally_is_no_actuator_and_says_why(
    driver: CanopenDriver, node: Scripted, third: can.BusABC, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    before_pa = node.device.command_pa
    third.send(frame(0x600 + NODE, b"\x2f\x42\x60\x00\x02\0\0\0"))
    in_time(lambda: node.node.machine.mode == 2)
    reading = driver.exchange(PUSH_PA + 1e3)
    assert reading.status == DeviceStatus.NOT_READY
    assert node.device.command_pa == before_pa, "it did not obey"
    third.send(frame(0x600 + NODE, b"\x2f\x42\x60\x00\x01\0\0\0"))
    in_time(lambda: node.node.machine.mode == 1)
    driver.exchange(PUSH_PA + 1e3)
    assert driver.exchange(PUSH_PA + 1e3).status == 0
    assert node.device.command_pa == PUSH_PA + 1e3
    told = [
        (each.message, each.__dict__["fields"].get("why")) for each in caplog.records if each.name == "drivers.canopen"
    ]
    assert told == [(NodeEvent.NOT_ACTIVE, "it is operated locally"), (NodeEvent.ACTIVE, None)]


def test_a_node_operated_locally_that_is_found_so_is_left_where_it_is(
    driver: CanopenDriver, node: Scripted, third: can.BusABC
) -> None:
    """Its set point is of before, and it would go there when it is given back."""
    driver.close()
    third.send(frame(0x600 + NODE, b"\x2f\x42\x60\x00\x02\0\0\0"))
    in_time(lambda: node.node.machine.mode == 2)
    local_pa = PUSH_PA / 2
    assert SIMULATED_OBJECTS.pressure_pa is not None
    node.node.reads[SIMULATED_OBJECTS.pressure_pa.index] = lambda: local_pa
    assert driver.open() == local_pa
    assert driver.exchange(local_pa).status == DeviceStatus.NOT_READY
    third.send(frame(0x600 + NODE, b"\x2f\x42\x60\x00\x01\0\0\0"))
    in_time(lambda: node.node.machine.mode == 1)
    driver.exchange(local_pa)
    assert driver.exchange(local_pa).status == 0
    assert node.device.command_pa == local_pa


def test_silence_makes_the_node_act_and_its_fault_is_reset_when_the_master_is_back(
    channel: str, caplog: pytest.LogCaptureFixture
) -> None:
    node = Scripted(channel, "given")
    node.start()
    driver = CanopenDriver(config(channel, communication_timeout_s=0.5, communication_action="vent", heartbeat_s=5))
    driver.open()
    node.now_ns += 10_000_000
    assert (driver.exchange(PUSH_PA).status, node.device.command_pa) == (0, PUSH_PA)
    node.now_ns += 600_000_000
    silent = driver.read()
    assert (silent.status, node.device.command_pa) == (DeviceStatus.COMMUNICATION_LOST | DeviceStatus.NOT_READY, 0.0)
    assert node.node.machine.state is NodeState.FAULT_HOLD
    readings = [driver.exchange(PUSH_PA) for _ in range(4)]
    assert readings[0].status & DeviceStatus.NOT_READY
    assert (readings[-1].status, node.device.command_pa) == (0, PUSH_PA)
    emergencies = [each.__dict__["fields"] for each in caplog.records if each.message == NodeEvent.EMERGENCY]
    assert (emergencies[0]["code"], emergencies[0]["register"]) == (0x8250, 0b10001)
    assert emergencies[0]["cause"] == "no RPDO within the communication time-out"
    driver.close()
    node.stop()


def test_a_fault_of_the_node_is_reset_by_open(driver: CanopenDriver, node: Scripted) -> None:
    node.node.machine.fail()
    driver.open()
    assert driver.exchange(PUSH_PA).status == 0


def test_a_status_word_that_is_no_state_is_no_actuator(driver: CanopenDriver, node: Scripted) -> None:
    node.node.reads[STATUS_WORD] = lambda: 0b0000
    assert driver.exchange(PUSH_PA).status == DeviceStatus.NOT_READY


def says(code: int) -> can.Message:
    return frame(0x80 + NODE, struct.pack("<HB5x", code, 1 if code else 0))


@pytest.mark.parametrize("code", [0x2310, 0x3100, 0x5000, 0x5530, 0x6100, 0x7000])
def test_an_emergency_of_what_measures_and_obeys_is_a_fault_until_all_are_over(
    driver: CanopenDriver, third: can.BusABC, code: int
) -> None:
    third.send(says(code))
    third.send(says(0x8130))
    in_time(lambda: driver.exchange(PUSH_PA).emergency == 0x8130)
    assert driver.exchange(PUSH_PA).status == DeviceStatus.DEVICE_FAULT, "a later one does not hide it"
    third.send(says(0))
    in_time(lambda: driver.exchange(PUSH_PA).status == 0)


@pytest.mark.parametrize("code", [0x4210, 0x8130, 0x8250, 0x6310, 0xFF42])
def test_an_emergency_of_warmth_communication_a_parameter_or_the_makers_own_is_none(
    driver: CanopenDriver, third: can.BusABC, code: int
) -> None:
    third.send(says(code))
    in_time(lambda: driver.exchange(PUSH_PA).emergency == code)
    assert driver.exchange(PUSH_PA).status == 0


def shows(driver: CanopenDriver, code: int) -> bool:
    return driver.exchange(PUSH_PA).emergency == code


def test_a_remote_frame_for_a_tpdo_is_no_node_clash(driver: CanopenDriver, third: can.BusABC) -> None:
    """Another master may ask for a TPDO: its frame has the same identifier, and no data."""
    asks = can.Message(arbitration_id=TPDO_1, is_remote_frame=True, dlc=8, is_extended_id=False)
    for code in (0x8130, 0x8120, 0x8130):
        third.send(asks)
        third.send(says(code))
        in_time(partial(shows, driver, code))  # the remote frame has come when this one has
