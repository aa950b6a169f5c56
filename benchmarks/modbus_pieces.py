"""What the pieces of pymodbus cost beside ours, each alone and in turn: the best of many rounds, in microseconds.

The figures of the decision record on the library (docs/decisions/0012-pymodbus.md). A cycle has one request and one
reply of 11 registers; a DCS that polls asks for up to 125, in the interpreter that runs the cycle.
"""

import struct
import time
from collections.abc import Callable, Mapping, Sequence

from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersResponse,
    ReadWriteMultipleRegistersRequest,
    ReadWriteMultipleRegistersResponse,
)

from config.register_format import Format
from fieldbus.modbus.function_codes import decoded
from fieldbus.modbus.register_packing import Layout
from fieldbus.modbus.server_connection import HEADER

ROUNDS, CALLS = 300, 50
CYCLE_WORDS, MOST_WORDS = 11, 125
REQUEST = bytes((23,)) + ReadWriteMultipleRegistersRequest(0, CYCLE_WORDS, CYCLE_WORDS, [1, 2]).encode()
FRAMER = FramerSocket(DecodePDU(is_server=False))
REPLY = bytes((23, 2 * CYCLE_WORDS)) + bytes(2 * CYCLE_WORDS)
FRAME = FRAMER.encode(REPLY, 1, 5)
SAMPLE = Layout([(0, Format("float32")), (2, Format("float32")), (4, Format("uint32")), (6, Format("uint64"))])
END = 2 * SAMPLE.words


def report() -> list[str]:
    """Return lines: a piece, pymodbus's time, ours."""
    lines = [f"{'us, the best of many':46}{'pymodbus':>10}{'ours':>10}"]
    for name, ways in pieces().items():
        theirs_us, ours_us = best_us(ways)
        lines.append(f"{name:46}{theirs_us:10.1f}{ours_us:10.1f}")
    return lines


def pieces() -> Mapping[str, Sequence[Callable[[], object]]]:
    """Return the pieces: pymodbus's way, and ours."""
    few, most = [7] * CYCLE_WORDS, [7] * MOST_WORDS

    def registers_of_reply() -> object:
        reply = ReadWriteMultipleRegistersResponse()
        reply.decode(REPLY[1:])
        return reply.registers

    return {
        "request framed": (
            lambda: FRAMER.encode(REQUEST, 1, 5),
            lambda: HEADER.pack(5, 0, len(REQUEST) + 1, 1) + REQUEST,
        ),
        "reply out of its frame (decode)": (
            lambda: FRAMER.decode(FRAME),
            lambda: (HEADER.unpack_from(FRAME), FRAME[HEADER.size :]),
        ),
        "reply out of its frame, decoded (handleFrame)": (
            lambda: FRAMER.handleFrame(FRAME, 1, 5),
            lambda: (HEADER.unpack_from(FRAME), SAMPLE.unpack(FRAME[HEADER.size + 2 : HEADER.size + 2 + END])),
        ),
        "registers of a reply": (registers_of_reply, lambda: SAMPLE.unpack(REPLY[2 : 2 + END])),
        "server: request of function 23 decoded": (
            lambda: decoded(REQUEST),
            lambda: (struct.unpack(">BHHHHB", REQUEST[:10]), struct.unpack(">2H", REQUEST[10:])),
        ),
        "server: reply of 11 registers": (
            lambda: ReadWriteMultipleRegistersResponse(registers=few).encode(),
            lambda: struct.pack(f">BB{CYCLE_WORDS}H", 23, 2 * CYCLE_WORDS, *few),
        ),
        "server: reply of 125 registers": (
            lambda: ReadHoldingRegistersResponse(registers=most).encode(),
            lambda: struct.pack(f">BB{MOST_WORDS}H", 3, 2 * MOST_WORDS, *most),
        ),
    }


def best_us(ways: Sequence[Callable[[], object]]) -> list[float]:
    """Return the best time of each, the ways taking turns."""
    best_s = [float("inf")] * len(ways)
    for _ in range(ROUNDS):
        for index, way in enumerate(ways):
            start_s = time.perf_counter()
            for _ in range(CALLS):
                way()
            best_s[index] = min(best_s[index], (time.perf_counter() - start_s) / CALLS)
    return [1e6 * each for each in best_s]


if __name__ == "__main__":
    print("\n".join(report()))
