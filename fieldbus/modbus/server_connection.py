"""One client's connection to a Modbus TCP server: frames out of a stream of bytes, and an answer to each in turn.

    transaction  2 bytes, given back with the answer
    protocol     2 bytes, 0
    length       2 bytes: of unit and PDU, 2 to 254
    unit         1 byte
    PDU          1 to 253 bytes

By the MODBUS Messaging on TCP/IP Implementation Guide V1.0b: a frame of another protocol is discarded; frames may come
in pieces, and several at once. A length that no frame has leaves unknown where the next begins, so the connection
ends; so it does when a client does not read its answers for `SEND_TIMEOUT_S`, since what was sent of one is no frame.
"""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from socketserver import BaseRequestHandler
from typing import Protocol

HEADER = struct.Struct(">HHHB")
SHORTEST, LONGEST_FRAME_BYTES = 2, 254
"""What the length of a frame can be."""
REQUEST_PIECE_BYTES = 4096  # bytes read at once: sixteen of the largest frames
SEND_TIMEOUT_S = 1.0


class Host(Protocol):
    """What a connection asks of the server that accepted it."""

    idle_s: float
    """For how long a client may ask for nothing; 0: for ever."""

    def answer(self, unit: int, pdu: bytes, peer: str) -> bytes:
        """Return the PDU that answers one."""
        ...

    def note_use(self, peer: str) -> float:
        """Take note that a client asks for something; return how long it must wait for the answer, s."""
        ...


class ServerConnection(BaseRequestHandler):
    """Serves one client in the thread that makes it, until either side ends it."""

    request: socket.socket
    server: Host  # type: ignore[assignment]

    def handle(self) -> None:
        """Answer the client's requests."""
        peer = endpoint(self.client_address)
        self.request.settimeout(SEND_TIMEOUT_S)
        with suppress(OSError):  # it is gone, or does not read
            for transaction, unit, pdu in self._requests():
                if wait_s := self.server.note_use(peer):
                    time.sleep(wait_s)
                answer = self.server.answer(unit, pdu, peer)
                self.request.sendall(HEADER.pack(transaction, 0, len(answer) + 1, unit) + answer)

    def _requests(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield transaction, unit and PDU of each frame, until the client has no more to say or makes no sense."""
        stream = b""
        while True:
            while len(stream) < HEADER.size:
                if not (more := self._more()):
                    return
                stream += more
            transaction, protocol, length, unit = HEADER.unpack_from(stream)
            if not SHORTEST <= length <= LONGEST_FRAME_BYTES:
                return
            end = HEADER.size - 1 + length
            while len(stream) < end:
                if not (more := self._more()):
                    return
                stream += more
            if protocol == 0:
                yield transaction, unit, stream[HEADER.size : end]
            stream = stream[end:]

    def _more(self) -> bytes:
        """Return what comes next; b"" when the client has no more to say, or says nothing for too long."""
        since_s = time.monotonic()
        while True:
            try:
                return self.request.recv(REQUEST_PIECE_BYTES)
            except TimeoutError:  # that one is for sending: how long a client may be silent is another matter
                if 0.0 < self.server.idle_s < time.monotonic() - since_s:
                    return b""


def endpoint(address: tuple[object, ...]) -> str:
    """Return `host:port` of a socket's address, an IPv6 host in brackets."""
    host, port, *_ = address
    return f"[{host}]:{port}" if ":" in str(host) else f"{host}:{port}"
