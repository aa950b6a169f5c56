"""The CAN bus as the driver of one node uses it: frames out and in, in the thread that calls.

No thread receives behind the caller's back. Arbitration ids are those of the predefined connection set
(CiA 301, 7.3.3), n the node id:

    0x000      NMT             0x580 + n  SDO answer       0x180, 0x280, .. + n  TPDOs
    0x080 + n  EMCY            0x600 + n  SDO request      0x200 + n             RPDO
    0x700 + n  heartbeat, boot-up
"""

import logging
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from config.canopen_device import CanopenDevice
from drivers.boundary import DriverError, NoConnection
from drivers.canopen.events import NodeEvent
from fieldbus.canopen.python_can import can

log = logging.getLogger(__package__)

NMT, EMERGENCY, SDO_ANSWER, SDO_REQUEST, HEARTBEAT = (
    0x000,
    0x080,
    0x580,
    0x600,
    0x700,
)  # CiA 301; the node's number is added
WHOLE_ID = 0x7FF  # all 11 bits
CAN_ERROR_BUS_OFF = 0x40
"""Of an error frame's id, as SocketCAN has them."""


class NodeBus:
    """The frames of one node.

    Args:
        config: bus and node id.
    """

    def __init__(self, config: CanopenDevice) -> None:
        self.node = config.node
        self.who = f"{config.interface} {config.channel} node {config.node}"
        self._arguments: dict[str, Any] = config.bus_arguments
        self._send_timeout_s = config.reply_timeout_s
        self._bus: can.BusABC | None = None

    def open(self, identities: Iterable[int]) -> None:
        """Join the bus, to receive some arbitration ids.

        Raises:
            NoConnection: the bus cannot be opened.
        """
        try:
            self._bus = can.Bus(can_filters=_filters(identities), **self._arguments)
        except Exception as error:  # somebody else's interface: it may raise anything
            said = " ".join(str(error).split())
            raise self.fault(NoConnection, NodeEvent.BUS_OFF, f"the bus cannot be opened: {said}") from None

    def hear(self, identities: Iterable[int]) -> None:
        """Receive these arbitration ids from now on.

        Raises:
            NoConnection: the bus is not open.
        """
        self.require_open().set_filters(_filters(identities))

    def close(self) -> None:
        """Leave the bus, if it was joined. Never raises."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(can.CanError, OSError):
                bus.shutdown()

    def send(self, identity: int, data: bytes) -> None:
        """Send a data frame.

        Raises:
            NoConnection: the bus is not open, or off.
        """
        self.put(can.Message(arbitration_id=identity, data=data, is_extended_id=False))

    def put(self, message: can.Message) -> None:
        """Send a frame.

        Raises:
            NoConnection: the bus is not open, or off.
        """
        bus = self._bus or self.require_open()
        try:
            bus.send(message, self._send_timeout_s)
        except (can.CanError, OSError) as error:
            raise self._off(str(error)) from None

    def receive(self, timeout_s: float) -> can.Message | None:
        """Return the next data frame, None if none comes within the time-out.

        A remote frame asks a node for what it sends: it is another master's, and says nothing of the node.

        Raises:
            NoConnection: the bus is not open, or off.
        """
        bus = self._bus or self.require_open()
        while True:
            try:
                message = bus.recv(timeout_s)
            except (can.CanError, OSError) as error:
                raise self._off(str(error)) from None
            if message is None or not (message.is_error_frame or message.is_remote_frame):
                return message
            if message.is_error_frame and message.arbitration_id & CAN_ERROR_BUS_OFF:
                raise self._off("the controller says so")
            timeout_s = 0.0  # of no node; what lies behind it counts

    def require_open(self) -> can.BusABC:
        """Return the bus.

        Raises:
            NoConnection: it is not open.
        """
        if self._bus is None:
            raise NoConnection(f"{self.who}: the driver is not open")
        return self._bus

    def fault(self, kind: type[DriverError], event: NodeEvent, text: str) -> DriverError:
        """Return an error that names the node, the event, and what is known of it."""
        error = kind(f"{self.who}: {event}: {text}")
        error.kind = event
        return error

    def closing_fault(self, kind: type[DriverError], event: NodeEvent, text: str) -> DriverError:
        """Leave the bus, on which nothing can be trusted any more; return the error."""
        self.close()
        return self.fault(kind, event, text)

    def say(self, level: int, event: NodeEvent, **fields: object) -> None:
        """Log an event that does not end the connection."""
        log.log(level, event, extra={"fields": {"device": self.who, **fields}})

    def _off(self, said: str) -> DriverError:
        return self.closing_fault(NoConnection, NodeEvent.BUS_OFF, " ".join(said.split()))


def _filters(identities: Iterable[int]) -> list[can.typechecking.CanFilter]:
    return [{"can_id": each, "can_mask": WHOLE_ID, "extended": False} for each in identities]
