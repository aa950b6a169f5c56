"""Modbus RTU: frames on a serial line, and their check sum.

    frame   unit, PDU, CRC-16 with its low byte first; at most 256 bytes

Between two frames the line is silent for 3.5 characters (`config.serial_port`). Each frame leaves in one write, so no
gap of more than 1.5 characters is made inside it. One that is received is not judged: a USB adapter hands over
characters in bunches, so what the kernel shows of gaps is its own. Length and check sum decide.
"""

BROADCAST = 0
LARGEST_FRAME = 256
LEAST_FRAME = 4
ECHO = b"\x08\0\0"
"""Function 8, sub-function 0: the device answers with the request itself. Serial lines only."""


def _crc_of(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_CRC = tuple(_crc_of(byte) for byte in range(256))


def crc(data: bytes) -> bytes:
    """Return the check sum of a frame's first part, as it follows on the wire."""
    remainder = 0xFFFF
    for byte in data:
        remainder = remainder >> 8 ^ _CRC[(remainder ^ byte) & 0xFF]
    return remainder.to_bytes(2, "little")


def framed(unit: int, pdu: bytes) -> bytes:
    """Return the frame that carries a request or a reply."""
    body = bytes((unit,)) + pdu
    return body + crc(body)


def is_whole(frame: bytes) -> bool:
    """Return whether these bytes are one frame: a length that can be, and the right check sum."""
    return LEAST_FRAME <= len(frame) <= LARGEST_FRAME and crc(frame[:-2]) == frame[-2:]
