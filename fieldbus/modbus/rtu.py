"""Modbus RTU: frames on a serial line, made and checked by pymodbus.

    frame   unit, PDU, CRC-16 with its low byte first; at most 256 bytes

Between two frames the line is silent for 3.5 characters (`config.serial_port`). Each frame leaves in one write, so no
gap of more than 1.5 characters is made inside it. One that is received is not judged: a USB adapter hands over
characters in bunches, so what the kernel shows of gaps is its own. Length and check sum decide. pymodbus's search for a
frame in what was received is not used: it passes over noise behind a frame, and knows no frame of a function that is
not served, which must be answered too. What a bad frame leads to: `drivers.modbus_rtu`, `sim.slave.rtu_server`.

Source: MODBUS over Serial Line Specification and Implementation Guide V1.02, section 2.5.1.
"""

from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU

BROADCAST = 0  # unit that all devices obey and none answers
LARGEST_FRAME = 256  # bytes, Modbus over serial line
LEAST_FRAME = 4  # bytes: unit, function, check sum
NO_TRANSACTION = 0  # a serial line has no numbers of transactions
ECHO = b"\x08\0\0"
"""Function 8, sub-function 0: the device answers with the request itself. Serial lines only."""

_FRAMER = FramerRTU(DecodePDU(is_server=False))


def framed(unit: int, pdu: bytes) -> bytes:
    """Return the frame that carries a request or a reply."""
    return _FRAMER.encode(pdu, unit, NO_TRANSACTION)


def is_whole(frame: bytes) -> bool:
    """Return whether these bytes are one frame: a length that can be, and the right check sum."""
    return LEAST_FRAME <= len(frame) <= LARGEST_FRAME and FramerRTU.check_CRC(frame[:-2], int.from_bytes(frame[-2:]))
