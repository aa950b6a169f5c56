"""How requests and replies lie in a stream of TCP; frames are made and read by pymodbus.

    mbap   transaction (2 bytes), protocol 0 (2), length of what follows (2), unit (1), PDU
    rtu    unit (1), PDU, CRC-16: the frames of a serial line, which a plain converter hands through

A frame of a serial line has neither number nor length: how long a reply is follows from its function, and whose it is
from there being one request at a time.

Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, section 3.1.3; MODBUS over Serial Line V1.02, 2.5.1.
"""

from typing import Protocol

from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU

from fieldbus.modbus.client_errors import DuplicatedReply, OtherTransaction, OtherUnit, SerialFrame, UnexpectedReply
from fieldbus.modbus.exception_codes import EXCEPTION
from fieldbus.modbus.rtu import LEAST_FRAME, framed, is_whole

LENGTH_ENDS = 6
"""Bytes of a frame up to its length, which counts those behind it."""
LAST_TRANSACTION = 0xFFFF  # 16 bits
ANSWERED = (3, 4, 6, 16, 23)
"""Functions that are asked for."""

_DECODER = DecodePDU(is_server=False)
_FRAMER = FramerSocket(_DECODER)


class Framing(Protocol):
    """How one connection frames; owned by its client."""

    @property
    def is_numbered(self) -> bool:
        """Whether a reply says which request it answers."""
        ...

    def request(self, pdu: bytes) -> bytes:
        """Return the frame of the next request."""
        ...

    def reply(self, stream: bytes) -> tuple[int, bytes] | None:
        """Return how many bytes the reply to it took, and its PDU; None, it is not whole yet.

        Raises:
            UnexpectedReply: what comes is no reply to it.
        """
        ...


class MbapFraming:
    """Modbus TCP.

    Args:
        unit: the unit that is asked.
        reply_unit: what its replies say; None, the same.
        echoes_transaction: whether a reply has the number of its request, as the specification asks.
    """

    def __init__(self, unit: int, reply_unit: int | None = None, *, echoes_transaction: bool = True) -> None:
        self._unit = unit
        self._reply_unit = unit if reply_unit is None else reply_unit
        self.is_numbered = echoes_transaction
        self._transaction = 0

    def request(self, pdu: bytes) -> bytes:
        """Return the frame of the next request."""
        self._transaction = transaction = self._transaction % LAST_TRANSACTION + 1
        return _FRAMER.encode(pdu, self._unit, transaction)

    def reply(self, stream: bytes) -> tuple[int, bytes] | None:
        """Return the reply as `Framing` has it."""
        if stream[2:5].strip(b"\0"):  # another protocol, or longer than a frame
            raise SerialFrame(stream) if is_whole(stream) else UnexpectedReply(stream)
        used, unit, answered, pdu = _FRAMER.decode(stream)
        if not used:
            if b"\0\0" <= stream[4:6] < b"\0\2":  # no frame is that short; pymodbus would wait for more
                raise UnexpectedReply(stream)
            return None
        if answered != self._transaction and self.is_numbered:
            if answered == (self._transaction - 1 or LAST_TRANSACTION):
                raise DuplicatedReply(stream)
            raise OtherTransaction(stream, answered, self._transaction)
        if unit != self._reply_unit:
            raise OtherUnit(stream, unit, self._reply_unit)
        if used != LENGTH_ENDS + stream[LENGTH_ENDS - 1]:
            raise UnexpectedReply(stream)
        return used, pdu


class SerialFraming:
    """Frames of a serial line on TCP.

    Args:
        unit: the unit that is asked.
        reply_unit: what its replies say; None, the same.
    """

    is_numbered = False

    def __init__(self, unit: int, reply_unit: int | None = None) -> None:
        self._unit = unit
        self._reply_unit = unit if reply_unit is None else reply_unit

    def request(self, pdu: bytes) -> bytes:
        """Return the frame of the next request."""
        return framed(self._unit, pdu)

    def reply(self, stream: bytes) -> tuple[int, bytes] | None:
        """Return the reply as `Framing` has it."""
        if len(stream) < LEAST_FRAME:
            return None
        if stream[1] & ~EXCEPTION not in ANSWERED:
            raise UnexpectedReply(stream)
        kind = _DECODER.lookupPduClass(stream)
        assert kind is not None
        size = kind.calculateRtuFrameSize(stream)
        if len(stream) < size:
            return None
        frame = stream[:size]
        if not is_whole(frame):
            raise UnexpectedReply(stream, "a check sum that is wrong")
        if frame[0] != self._reply_unit:
            raise OtherUnit(stream, frame[0], self._reply_unit)
        return size, frame[1:-2]
