"""A wire for Modbus TCP that is spoilt on demand: a proxy that knows frames.

    python -m positioner.testing.fault_proxy PORT      says where it listens; then takes lines as the agent does

Frames by the MBAP header (MODBUS Messaging on TCP/IP Implementation Guide V1.0b, section 3.1.3): transaction,
protocol, length, unit. The standard library alone: it needs nothing of ours.
"""

import json
import socket
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread

from positioner.testing.wire_faults import WIRE_FAULTS, Spoiler

HEADER = struct.Struct(">HHHB")


Carry = Callable[[socket.socket, int, Spoiler], None]
"""What carries between a connection and a port of this machine, until one of them ends."""


@contextmanager
def spoilt_wire(port: int, spoiler: Spoiler, carry: Carry | None = None) -> Iterator[int]:
    """Carry between the port given, on this machine, and whoever connects; say on which port.

    Args:
        port: of the device.
        spoiler: says what is spoilt.
        carry: by what; None: by frames of Modbus TCP.
    """
    listener = socket.create_server(("127.0.0.1", 0))
    Thread(target=_accept, args=(listener, port, spoiler, carry or _carry), daemon=True).start()
    try:
        yield listener.getsockname()[1]
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def _accept(listener: socket.socket, port: int, spoiler: Spoiler, carry: Carry) -> None:
    while True:
        try:
            near, _ = listener.accept()
        except OSError:
            return
        Thread(target=carry, args=(near, port, spoiler), daemon=True).start()


def _carry(near: socket.socket, port: int, spoiler: Spoiler) -> None:
    spoiler.forget()
    with near, suppress(OSError), socket.create_connection(("127.0.0.1", port)) as far:
        while frame := _frame(near):
            if spoiler.takes_request():
                continue
            far.sendall(frame)
            for reply in spoiler.replies(_frame(far)):
                near.sendall(reply)


def _frame(line: socket.socket) -> bytes:
    """Return the next frame; b"" at the end."""
    head = line.recv(HEADER.size, socket.MSG_WAITALL)
    if len(head) < HEADER.size:
        return b""
    return head + line.recv(HEADER.unpack(head)[2] - 1, socket.MSG_WAITALL)


def main(port: int) -> None:
    """Carry until nobody gives orders any more."""
    spoiler = Spoiler(late_s=0.0)
    with spoilt_wire(port, spoiler) as here:
        print(f"listening on 127.0.0.1:{here}", flush=True)
        for line in sys.stdin:
            print(json.dumps(_obey(spoiler, **json.loads(line)["given"])), flush=True)


def _obey(spoiler: Spoiler, kind: str = "", count: int = 0, late_s: float = 0.0) -> dict[str, object]:
    """Spoil what comes next where a kind is named; answer how much of it is left to be spoilt."""
    if kind:
        if kind not in WIRE_FAULTS:
            return {"error": f"kind: allowed are {', '.join(WIRE_FAULTS)}, got {kind!r}"}
        spoiler.late_s = late_s
        spoiler.begin(kind, count)
    return {"value": spoiler.left}


if __name__ == "__main__":
    main(int(sys.argv[1]))
