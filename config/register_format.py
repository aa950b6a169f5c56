"""Numbers as 16-bit registers: the one place where a value becomes words on the wire and back.

A value of several words is sent most significant word first (`big`) or last (`little`). Inside a word the most
significant byte comes first, as the Modbus specification has it; some devices send it last. Of a float of the bytes
A B C D, A the most significant:

    word_order   byte_order   on the wire
    big          big          A B C D
    little       big          C D A B
    big          little       B A D C
    little       little       D C B A
"""

import math
import struct
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

WireType = Literal["uint16", "int16", "uint32", "int32", "uint64", "float32", "float64"]
Order = Literal["big", "little"]

LETTER: dict[WireType, str] = {
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
"""Of the module `struct`, for each type."""


LARGEST_FLOAT32 = (2 - 2**-23) * 2.0**127


@dataclass(frozen=True, slots=True)
class Format:
    """How one value lies in registers."""

    type: WireType
    word_order: Order = "big"
    byte_order: Order = "big"
    """Of the two bytes of a word."""

    @property
    def words(self) -> int:
        """How many registers the value takes."""
        return struct.calcsize(">" + LETTER[self.type]) // 2

    @property
    def is_float(self) -> bool:
        """Whether the value is a floating-point number."""
        return self.type in ("float32", "float64")

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the greatest value."""
        if self.type == "float32":
            return -LARGEST_FLOAT32, LARGEST_FLOAT32
        if self.type == "float64":
            return -sys.float_info.max, sys.float_info.max
        bits = 16 * self.words
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if self.type.startswith("int") else (0, (1 << bits) - 1)

    def holds(self, value: float) -> bool:
        """Return whether a value is whole where it must be."""
        return self.is_float or (math.isfinite(value) and value == int(value))

    def encode(self, value: float) -> list[int]:
        """Return the registers of a value; nothing is rounded to a whole number, which may mean something else.

        Raises:
            ValueError: the type cannot hold the value (out of range, no number or none that is whole).
        """
        if not self.is_float:
            if not self.holds(value):
                raise ValueError(f"{value} does not fit {self.type}")
            value = int(value)
        try:
            packed = struct.pack(">" + LETTER[self.type], value)
        except (struct.error, OverflowError):
            raise ValueError(f"{value} does not fit {self.type}") from None
        words = list(struct.unpack(self._words_format, packed))
        return words if self.word_order == "big" else words[::-1]

    def decode(self, words: Sequence[int]) -> float:
        """Return the value in as many registers as `words` says; a float even of a whole-number type.

        Raises:
            ValueError: not that many registers.
        """
        if len(words) != self.words:
            raise ValueError(f"{self.type} takes {self.words} registers, not {len(words)}")
        ordered = words if self.word_order == "big" else words[::-1]
        (value,) = struct.unpack(">" + LETTER[self.type], struct.pack(self._words_format, *ordered))
        return float(value)

    @property
    def _words_format(self) -> str:
        return f"{'>' if self.byte_order == 'big' else '<'}{self.words}H"
