"""Modbus RTU: frames on a serial line, their check sum, and the silence that parts them.

    frame   unit, PDU, CRC-16 with its low byte first; at most 256 bytes
    t_c     = b / B                  s, one character: b bits (start, 8 data, parity, stop) at B baud
    t_3.5   = 3.5 t_c                s, least silence between two frames; 1.75 ms above 19200 baud, whatever B is

Each frame leaves in one write, so no gap of more than 1.5 characters is made inside it. One that is received is not
judged: a USB adapter hands over characters in bunches, so what the kernel shows of gaps is its own. Length and check
sum decide.
"""

from typing import Annotated, Literal, get_args

from pydantic import Field

from config.loading import Schema

BROADCAST = 0
LARGEST_FRAME = 256
LEAST_FRAME = 4
ECHO = b"\x08\0\0"
"""Function 8, sub-function 0: the device answers with the request itself. Serial lines only."""

FASTEST_SCALED_BAUD = 19200
FIXED_SILENCE_S = 1.75e-3

Baud = Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600]
BAUDS: tuple[int, ...] = get_args(Baud)
RtuUnit = Annotated[int, Field(ge=1, le=247)]


class SerialPort(Schema):
    """A serial line and how its characters look; the defaults are the specification's."""

    path: Annotated[str, Field(min_length=1)]
    """Of the serial device, such as /dev/ttyUSB0."""
    baud: Baud = 19200
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Literal[1, 2] = 1

    @property
    def character_s(self) -> float:
        """How long one character takes."""
        return (1 + 8 + (self.parity != "none") + self.stop_bits) / self.baud

    @property
    def silence_s(self) -> float:
        """The least silence between two frames."""
        return 3.5 * self.character_s if self.baud <= FASTEST_SCALED_BAUD else FIXED_SILENCE_S


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
