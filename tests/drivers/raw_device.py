"""A Modbus device of sockets and arithmetic alone: its frames and registers are its own, its habits a test's.

Holding registers, some of them float32. It knows functions 3, 6, 16 and 23.
"""

import socket
import struct
import time
from dataclasses import dataclass, field
from threading import Thread


@dataclass(frozen=True)
class Habits:
    """What it does that others do not."""

    framing: str = "mbap"
    silent_on: tuple[int, ...] = ()
    """Functions that it passes over without a word."""
    pause_s: float = 0.0
    """A request that comes sooner after a reply is passed over."""
    deaf_s: float = 0.0
    """So is one that comes sooner after the connection."""
    transaction: int | None = None
    """The number that all its replies have."""
    unit: int | None = None
    """The unit that all its replies have."""
    twice_every: int = 0
    """Each so many-th reply is sent twice."""
    swapped: tuple[bool, bool] = (False, False)
    """Whether words of a float, and bytes of a word, come the other way round."""


@dataclass
class RawDevice:
    """Listens from the start on a free port."""

    habits: Habits
    words: dict[int, int] = field(default_factory=dict)
    functions: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._lines: list[socket.socket] = []
        Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for line in self._lines:
            line.close()

    def put_float(self, address: int, value: float) -> None:
        data = self._arranged(struct.pack(">f", value))
        self.words[address], self.words[address + 1] = struct.unpack(">HH", data)

    def get_float(self, address: int) -> float:
        data = struct.pack(">HH", self.words[address], self.words[address + 1])
        (value,) = struct.unpack(">f", self._arranged(data))
        return float(value)

    def _arranged(self, data: bytes) -> bytes:
        by_words, by_bytes = self.habits.swapped
        a, b, c, d = data
        if by_words:
            a, b, c, d = c, d, a, b
        return bytes((b, a, d, c) if by_bytes else (a, b, c, d))

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._listener.accept()
            except OSError:
                return
            self._lines.append(line)
            Thread(target=self._serve, args=(line,), daemon=True).start()

    def _serve(self, line: socket.socket) -> None:
        deaf_until_s = time.monotonic() + self.habits.deaf_s
        try:
            while request := line.recv(300):
                if time.monotonic() < deaf_until_s:
                    continue
                if reply := self._framed_answer(request):
                    every = self.habits.twice_every
                    line.sendall(reply * 2 if every and len(self.functions) % every == 0 else reply)
                    deaf_until_s = time.monotonic() + self.habits.pause_s
        except OSError:
            pass

    def _framed_answer(self, request: bytes) -> bytes:
        if self.habits.framing == "rtu":
            if len(request) < 4 or crc(request[:-2]) != request[-2:]:
                return b""
            unit, pdu = request[0], self._answer(request[1:-2])
            frame = bytes((unit if self.habits.unit is None else self.habits.unit,)) + pdu
            return frame + crc(frame) if pdu else b""
        transaction, protocol, _, unit = struct.unpack_from(">HHHB", request)
        if protocol != 0 or not (pdu := self._answer(request[7:])):
            return b""
        transaction = transaction if self.habits.transaction is None else self.habits.transaction
        unit = unit if self.habits.unit is None else self.habits.unit
        return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu

    def _answer(self, pdu: bytes) -> bytes:
        self.functions.append(pdu[0])
        if pdu[0] in self.habits.silent_on:
            return b""
        match pdu[0]:
            case 3:
                return self._read(3, *struct.unpack_from(">HH", pdu, 1))
            case 6:
                address, word = struct.unpack_from(">HH", pdu, 1)
                self.words[address] = word
                return pdu
            case 16:
                self._write(int.from_bytes(pdu[1:3]), int.from_bytes(pdu[3:5]), pdu[6:])
                return pdu[:5]
            case 23:
                read_at, count, at, words = struct.unpack_from(">HHHH", pdu, 1)
                self._write(at, words, pdu[10:])
                return self._read(23, read_at, count)
        return bytes((pdu[0] | 0x80, 1))

    def _read(self, function: int, address: int, count: int) -> bytes:
        words = [self.words.get(address + each, 0) for each in range(count)]
        return struct.pack(f">BB{count}H", function, 2 * count, *words)

    def _write(self, address: int, count: int, data: bytes) -> None:
        for each, word in enumerate(struct.unpack(f">{count}H", data[: 2 * count])):
            self.words[address + each] = word


def crc(frame: bytes) -> bytes:
    """Return CRC-16 of a serial line, low byte first."""
    rest = 0xFFFF
    for byte in frame:
        rest ^= byte
        for _ in range(8):
            rest = rest >> 1 ^ (0xA001 if rest & 1 else 0)
    return struct.pack("<H", rest)
