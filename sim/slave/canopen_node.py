"""The simulated CANopen node as pure logic: frames in, frames out, the time given.

    NMT     boot-up, then PRE-OPERATIONAL, also after a reset; PDOs only in OPERATIONAL, SDO not in STOPPED
    SYNC    the latched RPDO is obeyed, the device's time passes, the TPDOs of that one sample leave
    EMCY    what went wrong, and 0x0000 when the last of it is over; the error register says what is not
    408     control and status word: only an ACTIVE node obeys; silence makes it FAULT_HOLD until reset

A node that does not obey keeps its pressure.
"""

import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Any

from canopen import ObjectDictionary
from canopen.sdo.exceptions import SdoAbortedError
from canopen.sdo.server import SdoServer

from config.canopen_device import CONTROL_WORD, SIMULATED_OBJECTS, STATUS_WORD
from config.quantities import CommunicationAction, DeviceStatus
from fieldbus.canopen.objects import ACTIVATE, DEVICE_MODE, LOCAL, NO_FAULT, Control, DeviceMode, NodeState
from sim.slave.canopen_dictionary import (
    COMMUNICATION_END,
    LOCAL_CONTROL,
    NOT_IN_THIS_STATE,
    OUT_OF_RANGE,
    RPDO,
    TPDO,
    Dictionary,
    Pdo,
    Read,
    Write,
)
from sim.slave.clocks import Clock
from sim.slave.simulated_device import Device

ERROR_REGISTER, SYNC_ID, EMCY_ID, HEARTBEAT_MS = 0x1001, 0x1005, 0x1014, 0x1017  # objects of CiA 301
COMMAND = SIMULATED_OBJECTS.command_pa.index


class Nmt(IntEnum):
    """States of a node, as its heartbeat says them."""

    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


NO_TRANSFER = struct.pack("<BHBI", 0x80, 0, 0, 0x05040001)
"""SDO abort: command specifier not valid."""
START, STOP, ENTER_PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130  # NMT commands of CiA 301


class EmergencyCause(IntEnum):
    """Error codes of CiA 301, with their bits of the error register."""

    SILENCE = 0x8250
    RPDO_LENGTH = 0x8210
    COMMAND_RANGE = 0x6320

    @property
    def register_bits(self) -> int:
        """Generic, and communication or device profile."""
        return 1 | (1 << 5 if self is EmergencyCause.COMMAND_RANGE else 1 << 4)


class DeviceStateMachine:
    """The states of CiA 408, steered by the control word."""

    def __init__(self) -> None:
        self.state = NodeState.DISABLED
        self.mode = DeviceMode.BUS
        self._control = Control(0)

    @property
    def word(self) -> int:
        """The status word."""
        return self.state | (LOCAL if self.mode is DeviceMode.LOCAL else 0)

    @property
    def obeys(self) -> bool:
        """Whether a set point from the bus counts."""
        return self.state is NodeState.ACTIVE and self.mode is DeviceMode.BUS

    @property
    def control_word(self) -> int:
        """The last control word."""
        return self._control

    def control(self, word: int) -> None:
        """Obey a control word; a fault stays until the reset bit rises, and one more word."""
        new, before = Control(word & 0xF), self._control
        self._control = new
        if not self.state & NO_FAULT:
            if new & Control.RESET and not before & Control.RESET:
                self.state = NodeState(self.state | NO_FAULT)
            return
        states = {int(ACTIVATE): NodeState.ACTIVE, int(ACTIVATE & ~Control.ACTIVATE): NodeState.HOLD}
        self.state = states.get(new & ACTIVATE, NodeState.DISABLED)

    def fail(self) -> None:
        """Fall to the fault state."""
        held = self.state in (NodeState.HOLD, NodeState.ACTIVE, NodeState.FAULT_HOLD)
        self.state = NodeState.FAULT_HOLD if held else NodeState.FAULT_DISABLED


class CanopenNode:
    """A node on a bus.

    Args:
        number: its node id.
        sheet: its data sheet, read for that id.
        device: what it is.
        clock: lets the device's time pass.
        send: takes an arbitration id and the data of a frame.
    """

    def __init__(
        self,
        number: int,
        sheet: ObjectDictionary,
        device: Device,
        clock: Clock,
        send: Callable[[int, bytes], None],
    ) -> None:
        self.number = number
        self.machine = DeviceStateMachine()
        self.state = Nmt.PRE_OPERATIONAL
        self._device, self._clock, self._send = device, clock, send
        self._power_up = (device.communication_timeout_s, device.communication_action)
        self._troubles: dict[EmergencyCause, None] = {}
        self._latched: dict[int, bytes] = {}
        self._syncs = 0
        self._beat_s = 0.0
        self.reads = self._readings()
        self._dictionary = Dictionary(sheet, self.reads, self._settings())
        server: Any = SdoServer
        self._sdo = server(0x600 + number, 0x580 + number, self._dictionary)
        self._sdo.network = self
        self._compose()

    def boot(self) -> None:
        """Say that it is there, and be PRE-OPERATIONAL."""
        self.state = Nmt.PRE_OPERATIONAL
        self._latched.clear()
        self._send(0x700 + self.number, b"\0")

    def receive(self, identity: int, data: bytes) -> None:
        """Take in a frame."""
        if identity == self._sync_id:
            if self.state is Nmt.OPERATIONAL:
                self._sync()
        elif identity in self._rpdos:
            if self.state is Nmt.OPERATIONAL:
                self._latch(identity, data)
        elif identity == 0:
            if len(data) == 2 and data[1] in (0, self.number):
                self._manage(data[0])
        elif identity == 0x600 + self.number and self.state is not Nmt.STOPPED and len(data) == 8:
            self._serve(data)

    def pass_time(self, now_s: float) -> None:
        """Do what is due by itself: the heartbeat, and what silence does. Before `now_s`, nothing is."""
        self._watch()
        period_s = self._beat_period_s
        if period_s and now_s >= self._beat_s:
            late = now_s - self._beat_s >= period_s
            self._beat_s = (now_s if late else self._beat_s) + period_s
            self._send(0x700 + self.number, bytes((self.state,)))

    def send_message(self, identity: int, data: bytes) -> None:
        """Send a frame: what canopen's SDO server asks of its network."""
        self._send(identity, bytes(data))

    def _manage(self, command: int) -> None:
        states = {
            START: Nmt.OPERATIONAL,
            STOP: Nmt.STOPPED,
            ENTER_PRE_OPERATIONAL: Nmt.PRE_OPERATIONAL,
        }
        if command in states:
            self.state = states[command]
            self._latched.clear()
        elif command in (RESET_NODE, RESET_COMMUNICATION):
            self._dictionary.reset(0, COMMUNICATION_END if command == RESET_COMMUNICATION else 0x10000)
            if command == RESET_NODE:
                self.machine = DeviceStateMachine()
                self._troubles.clear()
                self._device.supervise(*self._power_up)
            self._compose()
            self.boot()

    def _serve(self, request: bytes) -> None:
        before = self._dictionary.writes
        try:
            self._sdo.on_request(0x600 + self.number, request, 0.0)
        except struct.error:  # a segment of a transfer that nobody began: canopen aborts it by the object's number
            self._send(0x580 + self.number, NO_TRANSFER)
        if self._dictionary.writes != before:
            self._compose()

    def _compose(self) -> None:
        """Take PDOs, SYNC and heartbeat from the dictionary; `wanted_ids` are the arbitration ids that matter."""
        self._beat_period_s = 1e-3 * self._dictionary.value(HEARTBEAT_MS)
        self._sync_id = self._dictionary.value(SYNC_ID) & 0x7FF
        self._rpdos = {pdo.cob_id: pdo for pdo in self._dictionary.pdos(RPDO)}
        self._tpdos = self._dictionary.pdos(TPDO)
        self.wanted_ids = frozenset((0, self._sync_id, 0x600 + self.number, *self._rpdos))

    def _latch(self, identity: int, data: bytes) -> None:
        if len(data) < self._rpdos[identity].layout.size:
            self._raise(EmergencyCause.RPDO_LENGTH)
            return
        self._clear(EmergencyCause.RPDO_LENGTH)
        self._latched[identity] = data

    def _sync(self) -> None:
        self._syncs += 1
        for identity, data in self._latched.items():
            self._obey(self._rpdos[identity], data)
        self._latched.clear()
        self._clock.catch_up()
        self._watch()
        for pdo in self._tpdos:
            if self._syncs % pdo.transmission == 0:
                self._send(pdo.cob_id, pdo.layout.pack(*(self.reads[each]() for each in pdo.objects)))

    def _obey(self, pdo: Pdo, data: bytes) -> None:
        values = dict(zip(pdo.objects, pdo.layout.unpack_from(data), strict=True))
        if CONTROL_WORD in values:
            self.machine.control(values[CONTROL_WORD])
        if COMMAND not in values:
            return
        if not self.machine.obeys:
            self._clock.idle()
            return
        try:
            self._clock.command(values[COMMAND])
        except ValueError:
            self._raise(EmergencyCause.COMMAND_RANGE)
        else:
            self._clear(EmergencyCause.COMMAND_RANGE)

    def _watch(self) -> None:
        if self._device.status & DeviceStatus.COMMUNICATION_LOST:
            if EmergencyCause.SILENCE not in self._troubles:
                self.machine.fail()
                self._raise(EmergencyCause.SILENCE)
        else:
            self._clear(EmergencyCause.SILENCE)

    def _raise(self, trouble: EmergencyCause) -> None:
        self._troubles[trouble] = None
        self._emergency(trouble)

    def _clear(self, trouble: EmergencyCause) -> None:
        if trouble in self._troubles:
            del self._troubles[trouble]
            if not self._troubles:
                self._emergency(0)

    def _emergency(self, code: int) -> None:
        if self.state is not Nmt.STOPPED:
            self._send(self._dictionary.value(EMCY_ID) & 0x7FF, struct.pack("<HB5x", code, self._error_register()))

    def _error_register(self) -> int:
        bits = 0
        for trouble in self._troubles:
            bits |= trouble.register_bits
        return bits

    def _readings(self) -> dict[int, Read]:
        device = self._device

        def of(name: str) -> Read:
            return lambda: float(getattr(device, name)) if name.endswith(("_m", "_pa", "_s")) else getattr(device, name)

        return {entry.index: of(name) for name, entry in SIMULATED_OBJECTS.places.items()} | {
            ERROR_REGISTER: self._error_register,
            CONTROL_WORD: lambda: self.machine.control_word,
            STATUS_WORD: lambda: self.machine.word,
            DEVICE_MODE: lambda: self.machine.mode,
        }

    def _settings(self) -> dict[int, Write]:
        device, entries = self._device, SIMULATED_OBJECTS

        def supervise(timeout_s: float, action: float) -> None:
            self._clock.catch_up()
            try:
                device.supervise(timeout_s, CommunicationAction(int(action)))
            except ValueError:
                raise SdoAbortedError(OUT_OF_RANGE) from None

        def mode(value: float) -> None:
            try:
                self.machine.mode = DeviceMode(int(value))
            except ValueError:
                raise SdoAbortedError(OUT_OF_RANGE) from None

        assert entries.communication_timeout_s is not None
        assert entries.communication_action is not None
        return {
            COMMAND: self._command,
            entries.communication_timeout_s.index: lambda value: supervise(value, device.communication_action),
            entries.communication_action.index: lambda value: supervise(device.communication_timeout_s, value),
            CONTROL_WORD: lambda value: self.machine.control(int(value)),
            DEVICE_MODE: mode,
        }

    def _command(self, command_pa: float) -> None:
        if self.machine.mode is DeviceMode.LOCAL:
            raise SdoAbortedError(LOCAL_CONTROL)
        if not self.machine.obeys:
            raise SdoAbortedError(NOT_IN_THIS_STATE)
        try:
            self._clock.command(command_pa)
        except ValueError:
            raise SdoAbortedError(OUT_OF_RANGE) from None
