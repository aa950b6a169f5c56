"""Wires that carry what a true device says, spoilt as bytes say: what comes at a client, a driver or a node.

Each reply takes one byte that says what becomes of it, and what that needs from the bytes behind it; when they are used
up, replies come as they are. Nothing here waits: a reply that does not come is a time-out at once.
"""

import struct
import time
from collections import deque
from collections.abc import Callable
from itertools import islice
from typing import Any

import can

from fieldbus.modbus.function_codes import RegisterAnswers
from fieldbus.modbus.rtu import framed

Answer = Callable[[bytes], bytes]
Frame = Callable[[bytes], bytes]


class Bytes:
    """Bytes that are used up."""

    def __init__(self, data: bytes) -> None:
        self._rest = iter(data)

    def number(self) -> int:
        """Return the next; 0 when there are no more."""
        return next(self._rest, 0)

    def some(self, most: int) -> bytes:
        """Return as many as the next says, as far as there are."""
        return bytes(islice(self._rest, self.number() % (most + 1)))


def spoilt(reply: bytes, pdu_at: slice, frame: Frame, said: Bytes) -> list[bytes]:
    """Return the pieces in which a reply comes; `frame` makes a right frame of a PDU."""
    ways: tuple[Callable[[], list[bytes]], ...] = (
        lambda: [reply],
        lambda: [said.some(255)],
        lambda: [frame(said.some(253))],
        lambda: [_one_other(reply, said)],
        lambda: [reply[: said.number() % len(reply)]],
        lambda: [reply, said.some(64)],
        lambda: [frame(_one_other(reply[pdu_at], said))],
        lambda: [reply[: (at := said.number() % len(reply))], reply[at:]],
    )
    return ways[said.number() % len(ways)]()


def _one_other(data: bytes, said: Bytes) -> bytes:
    """Return them with one byte another."""
    changed = bytearray(data)
    changed[said.number() % len(data)] = said.number()
    return bytes(changed)


class SpoiltSocket:
    """A socket of a Modbus TCP client: behind it is a server, whose replies are spoilt."""

    def __init__(self, server: RegisterAnswers, said: Bytes) -> None:
        self._server, self._said = server, said
        self._pieces: deque[bytes] = deque()

    def sendall(self, request: bytes) -> None:
        head = request[:4]

        def frame(pdu: bytes) -> bytes:
            return head + struct.pack(">HB", len(pdu) + 1, request[6]) + pdu

        reply = frame(self._server.answer(request[7:], "fuzz"))
        self._pieces.extend(spoilt(reply, slice(7, None), frame, self._said))

    def recv(self, _most: int) -> bytes:
        if not self._pieces:
            raise TimeoutError
        return self._pieces.popleft()

    def settimeout(self, _timeout_s: float) -> None:
        pass

    def close(self) -> None:
        pass


class SpoiltLine:
    """A serial line of a Modbus RTU driver: behind it is a device, whose replies are spoilt."""

    is_open = True

    def __init__(self, server: RegisterAnswers, said: Bytes) -> None:
        self._server, self._said = server, said
        self._pieces: deque[bytes] = deque()

    def open(self) -> None:
        pass

    def close(self) -> None:
        pass

    def send(self, frame: bytes, _within_s: float) -> float:
        unit, pdu = frame[0], frame[1:-2]
        reply = framed(unit, self._server.answer(pdu, "fuzz"))
        self._pieces = deque(spoilt(reply, slice(1, -2), lambda other: framed(unit, other), self._said))
        return time.monotonic()

    def receive(self, _until_s: float) -> bytes:
        return self._pieces.popleft() if self._pieces else b""


class HeardLine:
    """A serial line of a server: it sends into nothing."""

    def send(self, frame: bytes, _within_s: float) -> float:
        return 0.0


class SpoiltBus:
    """A CAN bus of a driver: on it is a node, whose frames are spoilt; four that are lost are a bus that is off."""

    LOST_FRAMES = 4
    KNOWN = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)

    def __init__(self, node: int, said: Bytes) -> None:
        self._node, self._said = node, said
        self._frames: deque[can.Message] = deque()
        self._lost = 0
        self.take: Callable[[int, bytes], None] = lambda _identity, _data: None

    def sent(self, identity: int, data: bytes) -> None:
        """Take what the node sends."""
        said = self._said
        kind = said.number() % 6
        if kind == 1:
            data = said.some(8)
        elif kind == 2:
            self._frames.append(_frame(self.KNOWN[said.number() % len(self.KNOWN)] + self._node, said.some(8)))
        elif kind == 3:
            self._lost += 1
            return
        elif kind == 4 and data:
            data = _one_other(data, said)
        elif kind == 5:
            self._frames.append(_frame(identity, data))
        self._frames.append(_frame(identity, data))

    def send(self, message: can.Message, _timeout_s: float | None = None) -> None:
        self.take(message.arbitration_id, bytes(message.data))

    def recv(self, _timeout_s: float | None = None) -> can.Message | None:
        if self._frames:
            return self._frames.popleft()
        self._lost += 1
        if self._lost > self.LOST_FRAMES and _timeout_s:
            raise can.CanOperationError("nothing more comes")
        return None

    def set_filters(self, _filters: Any) -> None:
        pass

    def shutdown(self) -> None:
        pass


def _frame(identity: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=identity, data=data, is_extended_id=False)
