"""What a node says of itself, unasked: heartbeat, boot-up and emergencies (CiA 301, 7.2.8 and 7.2.7).

    heartbeat   0x700 + n, one byte: 0 boot-up, 4 STOPPED, 5 OPERATIONAL, 127 PRE-OPERATIONAL
    emergency   0x080 + n, error code (2 bytes), error register (1 byte), five of the manufacturer's own

A node that boots, leaves OPERATIONAL or falls silent is lost: the bus is left, and the driver must be opened again.
Emergencies are logged with their cause. One of what measures and obeys (current, voltage, hardware, software, modules)
makes the device unfit until it says that all are over (code 0), or boots. The others do not: what those of
communication and of a parameter tell of is seen or refused here as well, and a device that is too warm still measures.
"""

import logging
import math
import struct
import time

from config.canopen_device import CanopenDevice
from drivers.boundary import NoConnection, NoReply
from drivers.canopen.events import NodeEvent
from drivers.canopen.node_bus import EMERGENCY, HEARTBEAT, NodeBus
from fieldbus.canopen.emergencies import COMMAND_OUT_OF_RANGE, cause_of, is_of_the_device
from fieldbus.canopen.python_can import can

OPERATIONAL, PRE_OPERATIONAL, BOOT_UP = 5, 127, 0  # states in a heartbeat, CiA 301
NMT_STATES = {0: "booting", 4: "STOPPED", 5: "OPERATIONAL", 127: "PRE-OPERATIONAL"}


class NodeWatcher:
    """Consumer of a node's heartbeats and emergencies.

    Args:
        config: the heartbeat's time-out.
        bus: the node's frames.
    """

    def __init__(self, config: CanopenDevice, bus: NodeBus) -> None:
        self._bus = bus
        self.heartbeat_timeout_s = config.heartbeat_timeout_s
        """Silence after which the node is gone; infinite of one that has no heartbeat."""
        self._heartbeat_id, self._emergency_id = HEARTBEAT + bus.node, EMERGENCY + bus.node
        self._heard_s = -math.inf
        self._was_operational = False
        self.state: int | None = None
        """What its heartbeat said last while it was being opened."""
        self.was_interrupted = False
        """Whether it booted or was stopped since this was last set to False."""
        self.emergency = 0
        """The error code of the node's last emergency; 0 when all are over, or there was none."""
        self.is_unfit = False
        """Whether an emergency of what measures and obeys is not over."""
        self.refusal: str | None = None
        """Why the node refused a command since this was last set to None."""

    @property
    def silence_s(self) -> float:
        """Time since the last heartbeat."""
        return time.monotonic() - self._heard_s

    @property
    def is_silent(self) -> bool:
        """Whether heartbeats have been missing for longer than the time-out."""
        return self.silence_s > self.heartbeat_timeout_s

    def begin(self) -> None:
        """The node was just started: its heartbeats count from now on."""
        self._heard_s, self._was_operational = time.monotonic(), False

    def consume(self, message: can.Message) -> None:
        """Take in a frame; what is neither heartbeat nor emergency is passed over.

        Raises:
            NoConnection: the node booted, or is not OPERATIONAL any more.
        """
        code = self.consume_emergency(message)
        if code is not None:
            self.refusal = cause_of(code) if code == COMMAND_OUT_OF_RANGE else self.refusal
        elif message.arbitration_id == self._heartbeat_id and len(message.data) == 1:
            self._consume_heartbeat(message.data[0] & 0x7F)

    def note(self, message: can.Message) -> None:
        """Take in a frame while the node is not driven yet, whatever its state."""
        if self.consume_emergency(message) is None and message.arbitration_id == self._heartbeat_id and message.data:
            self.state, self._heard_s = message.data[0] & 0x7F, time.monotonic()

    def judge_state(self) -> None:
        """Take in what `note` heard meanwhile of a node that is driven.

        Raises:
            NoConnection: as `consume`.
        """
        if self.state is not None:
            self._consume_heartbeat(self.state)

    def consume_emergency(self, message: can.Message) -> int | None:
        """Log an emergency with its cause; return its code, None if the frame is something else."""
        if message.arbitration_id != self._emergency_id or len(message.data) < 3:
            return None
        code, register = struct.unpack_from("<HB", message.data)
        level, cause = (logging.WARNING, cause_of(code)) if code else (logging.INFO, "over")
        self._bus.say(level, NodeEvent.EMERGENCY, code=code, cause=cause, register=register)
        self.emergency = int(code)
        self.is_unfit = bool(code) and (self.is_unfit or is_of_the_device(code))
        return self.emergency

    def require_heartbeat(self) -> None:
        """Ask that the last heartbeat is not too old.

        Raises:
            NoReply: it is.
        """
        if self.is_silent:
            said = f"the last came {1e3 * self.silence_s:.0f} ms ago"
            raise self._bus.closing_fault(NoReply, NodeEvent.HEARTBEAT_LOST, said)

    def _consume_heartbeat(self, state: int) -> None:
        self._heard_s = time.monotonic()
        if state == BOOT_UP:
            self.is_unfit = False
            said = "it booted, and must be configured anew"
            self.was_interrupted = True
            raise self._bus.closing_fault(NoConnection, NodeEvent.NODE_RESTARTED, said)
        # One that left before the node was started may come after; a node that was not started sends no TPDO.
        self._was_operational |= state == OPERATIONAL
        if state != OPERATIONAL and self._was_operational:
            said = f"its heartbeat says {NMT_STATES.get(state, str(state))}"
            self.was_interrupted = True
            raise self._bus.closing_fault(NoConnection, NodeEvent.NOT_OPERATIONAL, said)
