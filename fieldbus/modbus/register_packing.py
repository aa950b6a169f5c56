"""Several values in one run of registers, packed and unpacked at once: the hot path of a cycle."""

import struct
from collections.abc import Iterable, Sequence
from operator import itemgetter
from typing import Any

from config.modbus_map import Place
from config.register_format import LETTER, Format


class Layout:
    """Values in one run of registers.

    Args:
        places: the address and format of each value, in the order in which values are given and returned.
    """

    def __init__(self, places: Sequence[tuple[int, Format]]) -> None:
        self.address = min(address for address, _ in places)
        self.words = max(address + form.words for address, form in places) - self.address
        self._values = struct.Struct(">" + "".join(LETTER[form.type] for _, form in places))
        source = [
            2 * (address - self.address + (word if form.word_order == "big" else form.words - 1 - word))
            + (byte if form.byte_order == "big" else 1 - byte)
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


def layout(places: Iterable[Place]) -> Layout:
    """Return the layout of some places in one run of registers."""
    return Layout([(place.address, place.format) for place in places])
