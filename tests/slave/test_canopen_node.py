"""The simulated CANopen node: frames in, frames out, its time given. Nothing here waits."""

import struct
from dataclasses import dataclass, field

import pytest
from canopen.sdo.exceptions import SdoAbortedError

from config.canopen_device import SHIPPED_EDS
from config.quantities import QUANTITIES, CommunicationAction
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from fieldbus.canopen.eds import PRODUCT_NUMBER, VENDOR_NUMBER, read_eds
from fieldbus.canopen.objects import ACTIVATE, Control, NodeState
from sim.slave.canopen_node import NO_TRANSFER, CanopenNode, DeviceStateMachine, Nmt
from sim.slave.clocks import Clock, Lockstep, RealTime
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of

pytestmark = pytest.mark.real_time

NODE, HELD_PA, PUSH_PA = 5, 17e3, 60e3
SYNC, RPDO, TPDOS = 0x80, 0x200 + NODE, (0x180 + NODE, 0x280 + NODE, 0x380 + NODE)
EMCY, HEARTBEAT = 0x80 + NODE, 0x700 + NODE
START, STOP, PRE, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130

Frame = tuple[int, bytes]


@dataclass
class Bench:
    """A node, what it sent, and its clock."""

    device: Device
    sent: list[Frame] = field(default_factory=list)
    now_ns: int = 0
    node: CanopenNode = field(init=False)

    def power_up(self, clock: Clock) -> "Bench":
        sheet = read_eds(SHIPPED_EDS, NODE)
        self.node = CanopenNode(
            NODE, sheet, self.device, clock, lambda identity, data: self.sent.append((identity, data))
        )
        self.node.boot()
        return self

    def takes(self, *frames: Frame) -> list[Frame]:
        """Return what the node sends in answer to some frames."""
        self.sent.clear()
        for identity, data in frames:
            self.node.receive(identity, data)
        return list(self.sent)

    def uploaded(self, index: int, subindex: int = 0) -> bytes:
        ((_, answer),) = self.takes((0x600 + NODE, struct.pack("<BHB4x", 0x40, index, subindex)))
        if answer[0] == 0x80:
            raise SdoAbortedError(struct.unpack("<I", answer[4:])[0])
        return answer[4 : 8 - (answer[0] >> 2 & 3)] if answer[0] & 2 else answer[4:]

    def downloaded(self, index: int, subindex: int, form: str, value: float) -> int:
        """Write an object; return the abort code, 0 if it was taken."""
        data = struct.pack("<" + form, value)
        request = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
        ((_, answer),) = (each for each in self.takes((0x600 + NODE, request)) if each[0] == 0x580 + NODE)
        return int(struct.unpack("<I", answer[4:])[0]) if answer[0] == 0x80 else 0

    def activate(self) -> None:
        assert self.downloaded(0x6040, 0, "H", ACTIVATE) == 0
        self.takes(nmt(START))


@pytest.fixture
def bench() -> Bench:
    """Give one in lockstep."""
    file = SlaveFile.model_validate({"initial": {"position_m": 0.02, "pressure_pa": HELD_PA}})
    device = device_of(file, shipped_valve("seed"))
    return Bench(device).power_up(Lockstep(device))


@pytest.fixture
def timed() -> Bench:
    """Give one in real time, its time given."""
    file = SlaveFile.model_validate({"initial": {"pressure_pa": HELD_PA}, "communication": {"timeout_s": 0.1}})
    bench = Bench(device_of(file, shipped_valve("seed")))
    return bench.power_up(RealTime(bench.device, 1000, lambda: bench.now_ns))


def nmt(command: int, node: int = NODE) -> Frame:
    return 0, bytes((command, node))


@pytest.mark.parametrize("specifier", [0x00, 0x10, 0x60, 0x70])
def test_a_segment_of_a_transfer_that_nobody_began_is_aborted(bench: Bench, specifier: int) -> None:
    """Found by fuzzing: it ended the node's thread."""
    assert bench.takes((0x600 + NODE, bytes((specifier,)) + bytes(7))) == [(0x580 + NODE, NO_TRANSFER)]
    assert bench.uploaded(0x1000) == bytes(4)


def command(pressure_pa: float, control: int = ACTIVATE) -> Frame:
    return RPDO, struct.pack("<fH", pressure_pa, control)


def state(machine: DeviceStateMachine) -> int:
    return machine.state


def emergencies(frames: list[Frame]) -> list[tuple[int, int]]:
    return [struct.unpack("<HB5x", data) for identity, data in frames if identity == EMCY]


def test_it_boots_into_pre_operational_where_there_is_sdo_but_no_pdo(bench: Bench) -> None:
    assert bench.sent == [(HEARTBEAT, b"\0")]
    assert bench.node.state is Nmt.PRE_OPERATIONAL
    assert bench.takes(command(PUSH_PA), (SYNC, b"")) == []
    assert bench.device.samples == 0
    assert struct.unpack("<I", bench.uploaded(0x1018, 2)) == (PRODUCT_NUMBER,)
    assert struct.unpack("<I", bench.uploaded(0x1018, 1)) == (VENDOR_NUMBER,)


def test_operational_one_sync_gives_the_tpdos_of_one_sample(bench: Bench) -> None:
    bench.activate()
    frames = bench.takes(command(PUSH_PA), (SYNC, b""))
    assert [identity for identity, _ in frames] == list(TPDOS)
    position_m, pressure_pa = struct.unpack("<ff", frames[0][1])
    assert (position_m, pressure_pa) == (pytest.approx(bench.device.position_m), PUSH_PA)
    assert struct.unpack("<IHH", frames[1][1]) == (1, 0, NodeState.ACTIVE)
    assert struct.unpack("<Q", frames[2][1]) == (1000,)


def test_an_rpdo_is_latched_until_sync_and_the_last_one_counts(bench: Bench) -> None:
    bench.activate()
    assert bench.takes(command(30e3), command(PUSH_PA)) == []
    assert (bench.device.samples, bench.device.command_pa) == (0, HELD_PA)
    bench.takes((SYNC, b""))
    assert (bench.device.samples, bench.device.command_pa) == (1, PUSH_PA)


def test_a_sync_alone_lets_no_time_pass_in_lockstep(bench: Bench) -> None:
    bench.activate()
    first = bench.takes(command(PUSH_PA), (SYNC, b""))
    assert bench.takes((SYNC, b"")) == first
    assert bench.device.samples == 1


def test_stopped_there_is_neither_pdo_nor_sdo(bench: Bench) -> None:
    bench.activate()
    bench.takes(nmt(STOP))
    assert bench.takes(command(PUSH_PA), (SYNC, b""), (0x600 + NODE, bytes((0x40, 0, 0x10, 0, 0, 0, 0, 0)))) == []


@pytest.mark.parametrize("frame", [nmt(START, NODE + 1), (0, b"\x01"), (0, bytes((77, NODE)))])
def test_nmt_for_another_node_or_of_no_meaning_changes_nothing(bench: Bench, frame: Frame) -> None:
    assert bench.takes(frame) == []
    assert bench.node.state is Nmt.PRE_OPERATIONAL


def test_a_command_latched_before_a_stop_is_not_obeyed_after_it(bench: Bench) -> None:
    bench.activate()
    bench.takes(command(PUSH_PA), nmt(PRE), nmt(START), (SYNC, b""))
    assert bench.device.command_pa == HELD_PA


@pytest.mark.parametrize(
    ("reset", "state"), [(RESET_NODE, NodeState.DISABLED), (RESET_COMMUNICATION, NodeState.ACTIVE)]
)
def test_a_reset_reaches_pre_operational_with_the_settings_of_power_up(
    bench: Bench, reset: int, state: NodeState
) -> None:
    bench.activate()
    bench.downloaded(0x1017, 0, "H", 50)
    bench.takes(command(PUSH_PA), (SYNC, b""))
    assert bench.takes(nmt(reset)) == [(HEARTBEAT, b"\0")]
    assert bench.node.state is Nmt.PRE_OPERATIONAL
    assert bench.uploaded(0x1017) == b"\0\0"
    assert bench.node.machine.state is state
    assert bench.device.command_pa == PUSH_PA, "the I/P keeps its pressure"


def test_the_heartbeat_says_the_state_at_its_period(timed: Bench) -> None:
    timed.downloaded(0x1017, 0, "H", 50)
    timed.sent.clear()
    for ms in range(1000, 1200):
        timed.node.pass_time(1e-3 * ms)
    assert timed.sent == [(HEARTBEAT, b"\x7f")] * 4
    timed.takes(nmt(START))
    timed.sent.clear()
    timed.node.pass_time(1.25)
    assert timed.sent == [(HEARTBEAT, b"\x05")]


def test_a_short_rpdo_is_an_emergency_and_not_obeyed(bench: Bench) -> None:
    bench.activate()
    frames = bench.takes((RPDO, b"\0\0\0"), (SYNC, b""))
    assert emergencies(frames) == [(0x8210, 0b10001)]
    assert (bench.device.samples, bench.device.command_pa) == (0, HELD_PA)
    assert bench.uploaded(0x1001) == b"\x11"
    assert emergencies(bench.takes(command(PUSH_PA), (SYNC, b""))) == [(0, 0)]
    assert bench.uploaded(0x1001) == b"\x00"


@pytest.mark.parametrize("pressure_pa", [-1.0, 1e6, float("nan"), float("inf")])
def test_a_command_beyond_the_supply_is_an_emergency_each_time(bench: Bench, pressure_pa: float) -> None:
    bench.activate()
    for _ in range(2):
        frames = bench.takes(command(pressure_pa), (SYNC, b""))
        assert emergencies(frames) == [(0x6320, 0b100001)]
        assert frames[0][0] == EMCY, "before the sample"
    assert (bench.device.samples, bench.device.command_pa) == (0, HELD_PA)


def test_silence_is_an_emergency_and_a_fault_until_reset(timed: Bench) -> None:
    timed.activate()
    timed.downloaded(0x2007, 0, "H", CommunicationAction.FILL)
    timed.takes(command(PUSH_PA), (SYNC, b""))
    timed.now_ns = 150_000_000
    frames = timed.takes((SYNC, b""))
    assert emergencies(frames) == [(0x8250, 0b10001)]
    assert timed.device.command_pa == 420e3
    assert timed.node.machine.state is NodeState.FAULT_HOLD
    timed.takes(command(PUSH_PA), (SYNC, b""))
    assert timed.device.command_pa == 420e3, "a fault does not obey"
    for control in (ACTIVATE | Control.RESET, ACTIVATE):
        frames = timed.takes(command(PUSH_PA, control), (SYNC, b""))
    assert timed.device.command_pa == PUSH_PA
    assert emergencies(frames) == [(0, 0)]


def test_only_an_active_node_obeys_and_time_passes_all_the_same(bench: Bench) -> None:
    bench.takes(nmt(START))
    for control, state in ((0, NodeState.DISABLED), (1, NodeState.DISABLED), (3, NodeState.HOLD)):
        frames = bench.takes(command(PUSH_PA, control), (SYNC, b""))
        assert struct.unpack("<IHH", frames[1][1])[2] == state
        assert bench.device.command_pa == HELD_PA
    assert bench.device.samples == 3
    bench.takes(command(PUSH_PA, 7), (SYNC, b""))
    assert bench.device.command_pa == PUSH_PA


def test_the_reset_bit_counts_only_when_it_rises() -> None:
    machine = DeviceStateMachine()
    machine.control(ACTIVATE)
    machine.control(ACTIVATE | Control.RESET)
    machine.fail()
    machine.control(ACTIVATE | Control.RESET)
    assert state(machine) == NodeState.FAULT_HOLD, "it was up before"
    machine.control(ACTIVATE)
    machine.control(ACTIVATE | Control.RESET)
    assert state(machine) == NodeState.HOLD
    machine.control(ACTIVATE)
    assert state(machine) == NodeState.ACTIVE


def test_a_disabled_node_that_fails_is_disabled_after_reset() -> None:
    machine = DeviceStateMachine()
    machine.fail()
    assert state(machine) == NodeState.FAULT_DISABLED
    machine.control(Control.RESET)
    assert state(machine) == NodeState.DISABLED


def test_sdo_reads_every_quantity_and_sets_those_that_can_be_set(bench: Bench) -> None:
    bench.activate()
    forms = {"float32": "f", "uint16": "H", "uint32": "I"}
    for n, quantity in enumerate(QUANTITIES):
        if quantity.type in forms:
            (value,) = struct.unpack("<" + forms[quantity.type], bench.uploaded(0x2000 + n))
            assert value == pytest.approx(float(getattr(bench.device, quantity.name)))
    assert bench.downloaded(0x2006, 0, "f", 2.5) == 0
    assert bench.device.communication_timeout_s == 2.5
    assert bench.downloaded(0x2005, 0, "f", 30e3) == 0
    assert (bench.device.command_pa, bench.device.samples) == (30e3, 1)


@pytest.mark.parametrize(
    ("index", "subindex", "form", "value", "code"),
    [
        (0x3000, 0, "I", 0, 0x06020000),
        (0x1018, 9, "I", 0, 0x06090011),
        (0x2000, 1, "f", 0, 0x06090011),
        (0x2000, 0, "f", 0, 0x06010002),
        (0x1017, 0, "I", 0, 0x06070010),
        (0x2006, 0, "f", -1, 0x06090030),
        (0x2006, 0, "f", float("nan"), 0x06090030),
        (0x2007, 0, "H", 3, 0x06090030),
        (0x2005, 0, "f", 1e6, 0x06090030),
        (0x6042, 0, "b", 9, 0x06090030),
        (0x1A00, 0, "B", 1, 0x08000022),  # the PDO is valid
        (0x1A03, 0, "B", 9, 0x06040042),
        (0x1A03, 0, "B", 1, 0x06040041),  # nothing is mapped in the entry
        (0x1800, 2, "B", 0, 0x06090030),
        (0x1800, 2, "B", 255, 0x06090030),
    ],
)
def test_what_sdo_may_not_is_aborted_with_its_reason(
    bench: Bench, index: int, subindex: int, form: str, value: float, code: int
) -> None:
    bench.activate()
    assert bench.downloaded(index, subindex, form, value) == code
    assert (bench.device.samples, bench.device.command_pa) == (0, HELD_PA)


def test_a_command_by_sdo_needs_an_active_node_that_is_not_local(bench: Bench) -> None:
    assert bench.downloaded(0x2005, 0, "f", PUSH_PA) == 0x08000022
    bench.activate()
    assert bench.downloaded(0x6042, 0, "b", 2) == 0
    assert bench.downloaded(0x2005, 0, "f", PUSH_PA) == 0x08000021
    assert bench.device.command_pa == HELD_PA


def test_a_pdo_is_mapped_anew_and_travels_every_second_sync(bench: Bench) -> None:
    bench.activate()
    assert bench.downloaded(0x1800, 1, "I", 0x80000185) == 0
    assert bench.downloaded(0x1800, 2, "B", 2) == 0
    assert bench.downloaded(0x1A00, 0, "B", 0) == 0
    assert bench.downloaded(0x1A00, 1, "I", 0x20030040) == 0
    assert bench.downloaded(0x1A00, 2, "I", 0x20040010) == 0
    assert bench.downloaded(0x1A00, 0, "B", 2) == 0x06040042, "ten bytes are too many"
    assert bench.downloaded(0x1A00, 1, "I", 0x20000020) == 0
    assert bench.downloaded(0x1A00, 0, "B", 2) == 0
    assert bench.downloaded(0x1A00, 1, "I", 0x20000020) == 0x08000022, "while entry 0 says two"
    assert bench.downloaded(0x1800, 1, "I", 0x195) == 0
    with_it, without = (bench.takes((SYNC, b"")) for _ in range(2))
    if len(with_it) < len(without):
        with_it, without = without, with_it
    assert [identity for identity, _ in with_it] == [0x195, *TPDOS[1:]]
    assert [identity for identity, _ in without] == list(TPDOS[1:])
    assert struct.unpack("<fH", with_it[0][1]) == (pytest.approx(0.02), 0)


@pytest.mark.parametrize("data", [b"", b"\x40", bytes(7), bytes((0xFF,)) * 8, bytes((0x60,)) + bytes(7)])
def test_torn_or_wild_sdo_requests_move_nothing(bench: Bench, data: bytes) -> None:
    bench.activate()
    bench.takes((0x600 + NODE, data))
    assert (bench.device.samples, bench.node.state) == (0, Nmt.OPERATIONAL)
    assert struct.unpack("<I", bench.uploaded(0x1018, 2)) == (PRODUCT_NUMBER,)
