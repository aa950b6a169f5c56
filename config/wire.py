"""Numbers as 16-bit registers: the one place where a value becomes words on the wire and back.

A value of several words is sent most significant word first (`big`) or last (`little`); inside a word the most
significant byte always comes first, as the Modbus specification has it.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, Literal

WireType = Literal["uint16", "int16", "uint32", "int32", "uint64", "float32", "float64"]
WordOrder = Literal["big", "little"]

_LETTER: dict[WireType, str] = {
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}


@dataclass(frozen=True, slots=True)
class Format:
    """How one value lies in registers."""

    type: WireType
    word_order: WordOrder = "big"

    @property
    def words(self) -> int:
        """How many registers the value takes."""
        return struct.calcsize(">" + _LETTER[self.type]) // 2

    @property
    def is_float(self) -> bool:
        """Whether the value is a floating-point number."""
        return self.type in ("float32", "float64")

    def encode(self, value: float) -> list[int]:
        """Return the registers of a value; whole-number types are rounded to nearest.

        Raises:
            ValueError: the type cannot hold the value (out of range, or not a number where it must be one).
        """
        if not self.is_float:
            if not math.isfinite(value):
                raise ValueError(f"{value} does not fit {self.type}")
            value = round(value)
        try:
            packed = struct.pack(">" + _LETTER[self.type], value)
        except (struct.error, OverflowError):
            raise ValueError(f"{value} does not fit {self.type}") from None
        words = list(struct.unpack(f">{self.words}H", packed))
        return words if self.word_order == "big" else words[::-1]

    def decode(self, words: Sequence[int]) -> float:
        """Return the value in as many registers as `words` says; a float even of a whole-number type.

        Raises:
            ValueError: not that many registers.
        """
        if len(words) != self.words:
            raise ValueError(f"{self.type} takes {self.words} registers, not {len(words)}")
        ordered = words if self.word_order == "big" else words[::-1]
        (value,) = struct.unpack(">" + _LETTER[self.type], struct.pack(f">{self.words}H", *ordered))
        return float(value)


class Layout:
    """Several values in one run of registers, packed and unpacked at once: the hot path of a cycle.

    Args:
        places: the address and format of each value, in the order in which values are given and returned.
    """

    def __init__(self, places: Sequence[tuple[int, Format]]) -> None:
        self.address = min(address for address, _ in places)
        self.words = max(address + form.words for address, form in places) - self.address
        self._values = struct.Struct(">" + "".join(_LETTER[form.type] for _, form in places))
        source = [
            2 * (address - self.address + (word if form.word_order == "big" else form.words - 1 - word)) + byte
            for address, form in places
            for word in range(form.words)
            for byte in (0, 1)
        ]
        # Values that already lie one after another, in order, need no rearranging.
        self._source = None if source == list(range(2 * self.words)) else source
        self._gather = itemgetter(*source)

    def pack(self, values: Sequence[float]) -> bytes:
        """Return the run of registers as bytes; whole-number types take an int; what lies between is zero.

        Raises:
            ValueError: a value that its type cannot hold.
        """
        try:
            packed = self._values.pack(*values)
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{list(values)} does not fit: {error}") from None
        if self._source is None:
            return packed
        run = bytearray(2 * self.words)
        for source, byte in zip(self._source, packed, strict=True):
            run[source] = byte
        return bytes(run)

    def unpack(self, run: bytes) -> tuple[Any, ...]:
        """Return the values in a run of `words` registers: int of whole-number types, else float."""
        return self._values.unpack(run if self._source is None else bytes(self._gather(run)))
