"""A CAN bus between processes of one machine, without kernel support: python-can's interface `loopback`.

    can.Bus(interface="loopback", channel="29500")

Every end is a UDP socket on 127.0.0.1, bound to the first free of the bus's `CHANNEL_ENDS` ports from `channel` on. A
frame goes to each other end as a datagram of its own, never back to its sender. A newcomer asks the system which of
the ports are taken, says hello to each, and may send at once; by the hello the others know it, before its first
frame.

    hello   the arbitration ids wanted, as (id, mask) pairs, none: all
    frame   arbitration id with flags, up to 8 data bytes
    ack     nothing more; sent when `ACK_EVERY` frames were taken and none went the other way
    bye     the sender is gone
    wake    from a sender's thread to its own end: take what came before this

Each also carries which end sent it, the number of the last frame sent to that end, and of the last taken from it.

Nothing is lost between ends that read: a sender waits for the end that has `WINDOW` frames it has not taken, and that
many from every other end fit into the receive buffer that Linux grants by default. An end that does not read for
`DEAF_S` is left out until it speaks again, so that a stopped process does not hold up the bus; what it missed it counts
and logs. What is not a datagram of this bus, or was not sent from the port of the end that it names, is dropped: who
is not an end can say nothing for one. Classical CAN only.
"""

import errno
import logging
import math
import random
import select
import socket
import struct
import time
from collections import deque
from contextlib import suppress
from threading import Event, Lock, RLock
from typing import Any

from fieldbus.canopen.python_can import can

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
CHANNEL_ENDS = 16
"""Ends on one bus; so many ports from its channel on belong to it."""
WINDOW, ACK_EVERY = 32, 16  # unread frames that a sender waits for; how often they are acknowledged
DEAF_S = 0.05
WAIT_IN_KERNEL_S = 0.005
"""The longest wait in the kernel; a reader waits again and again."""
BUS_LOOK_S = 0.001
"""A sender whose end has not begun to read for as long looks whether a hello is waiting."""
RECEIVE_BUFFER_BYTES = 1 << 20
FIRST_CHANNEL, LAST_CHANNEL = 20000, 32000
"""Where `free_channel` looks: below the ports that the system hands out by itself."""

HEAD = struct.Struct("<4sBBII")
FRAME = struct.Struct("<4sBBIII")
"""The head, and a frame's arbitration id."""
IDENTITY = struct.Struct("<I")
FILTER = struct.Struct("<II")
TIMEOUT = struct.Struct("@ll")
MAGIC = b"pCAN"
HELLO, DATA, ACK, BYE, WAKE = range(5)
LONGEST = HEAD.size + CHANNEL_ENDS * FILTER.size
EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
ID_BITS = ERROR - 1


class Peer:
    """Another end: what went to it and came from it."""

    __slots__ = ("acked", "address", "deaf", "filters", "port", "received", "sent", "told", "wanted")

    def __init__(self, port: int) -> None:
        self.port = port
        self.address = (HOST, port)
        self.sent = self.acked = self.received = self.told = 0
        self.deaf = False
        self.filters: tuple[tuple[int, int], ...] = ()
        self.wanted: dict[int, bool] = {}

    def wants(self, identity: int) -> bool:
        """Return whether this end asked for an arbitration id."""
        wanted = self.wanted.get(identity)
        if wanted is None:
            wanted = not self.filters or any((identity ^ each) & mask == 0 for each, mask in self.filters)
            self.wanted[identity] = wanted
        return wanted

    def met(self, number: int, filters: tuple[tuple[int, int], ...]) -> None:
        """Begin anew: it said hello."""
        self.received, self.told, self.sent, self.acked = number, number, 0, 0
        self.filters, self.wanted, self.deaf = filters, {}, False


class LoopbackBus(can.BusABC):
    """One end of a bus. One thread may receive while others send.

    Args:
        channel: the bus's first port.
        can_filters: as python-can has them; other ends then do not even send what does not match.

    Raises:
        CanInitializationError: the channel is no port, or all ends of the bus are taken.
    """

    def __init__(self, channel: Any = "29500", can_filters: Any = None, **kwargs: object) -> None:
        self._base = _base(channel)
        self._frames: deque[can.Message] = deque()
        self.peers: dict[int, Peer] = {}
        self._taking, self._sending = Lock(), RLock()
        self._wakes, self._woken = 0, Event()
        self._looked_s = -math.inf
        self.lost_frames = 0
        self.socket, self.port = self._bound()
        self.end = self.port - self._base
        self.channel_info = f"loopback {self._base}"
        for port in range(self._base, self._base + CHANNEL_ENDS):
            if port != self.port and _taken(port):
                self.peers[port] = Peer(port)
        super().__init__(channel, can_filters, **kwargs)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 - it waits `DEAF_S` at most
        """Send a frame to every other end.

        Raises:
            CanOperationError: the end is closed, or the frame is none of classical CAN.
        """
        if msg.is_fd or len(msg.data) > 8:
            raise can.CanOperationError("the loopback bus carries classical CAN only, up to 8 bytes")
        identity = flagged = msg.arbitration_id
        if msg.is_extended_id or msg.is_remote_frame or msg.is_error_frame:
            flagged |= EXTENDED * msg.is_extended_id | REMOTE * msg.is_remote_frame | ERROR * msg.is_error_frame
        data = bytes(msg.data)
        with self._sending:
            now_s = time.monotonic()
            if now_s - self._looked_s > BUS_LOOK_S:
                self._looked_s = now_s
                self._take_all()
            for peer in self.peers.values():
                if peer.deaf or not (msg.is_error_frame or peer.wants(identity)):
                    continue
                if peer.sent - peer.acked >= WINDOW and not self._has_room(peer):
                    continue
                peer.sent += 1
                peer.told = peer.received
                self._put(peer, FRAME.pack(MAGIC, DATA, self.end, peer.sent, peer.received, flagged) + data)

    def fileno(self) -> int:
        """Return the socket, readable when something came."""
        return self.socket.fileno()

    def shutdown(self) -> None:
        """Leave the bus."""
        if not self._is_shutdown:
            for peer in self.peers.values():
                with suppress(can.CanOperationError):
                    self._tell(peer, BYE)
        super().shutdown()
        self.socket.close()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next frame, None after the time-out: as python-can's own, without its detours.

        Raises:
            CanOperationError: the end is closed.
        """
        end_s = None if timeout is None else time.monotonic() + timeout
        while True:
            frame, accepted = self._recv_internal(timeout)
            if frame is None or accepted or self._filters is None or self._matches_filters(frame):
                return frame
            timeout = None if end_s is None else max(0.0, end_s - time.monotonic())

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        frames = self._frames
        self._looked_s = now_s = time.monotonic()
        end_s = None if timeout is None else now_s + timeout
        while True:
            with self._taking:
                wait_s = WAIT_IN_KERNEL_S if end_s is None else min(WAIT_IN_KERNEL_S, end_s - time.monotonic())
                if not frames and not self._take(0.0 if wait_s <= 0 else wait_s) and wait_s <= 0:
                    return None, False
                if frames:
                    frame = frames.popleft()
                    return frame, frame.is_error_frame

    def _apply_filters(self, filters: Any) -> None:
        """Tell the others what is wanted here; too many filters are applied here alone."""
        pairs = [FILTER.pack(each["can_id"], each["can_mask"]) for each in filters or ()]
        wanted = b"".join(pairs) if len(pairs) <= CHANNEL_ENDS else b""
        with self._sending:
            for peer in self.peers.values():
                self._tell(peer, HELLO, wanted)

    def _bound(self) -> tuple[socket.socket, int]:
        """Return a socket on the first free port of the bus."""
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, TIMEOUT.pack(0, round(1e6 * WAIT_IN_KERNEL_S)))
        for port in range(self._base, self._base + CHANNEL_ENDS):
            try:
                end.bind((HOST, port))
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    break
                continue
            return end, port
        end.close()
        raise can.CanInitializationError(f"loopback {self._base}: all of its {CHANNEL_ENDS} ends are taken")

    def _tell(self, peer: Peer, kind: int, body: bytes = b"") -> None:
        peer.told = peer.received
        self._put(peer, HEAD.pack(MAGIC, kind, self.end, peer.sent, peer.received) + body)

    def _put(self, peer: Peer, datagram: bytes) -> None:
        try:
            self.socket.sendto(datagram, peer.address)
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: {error.strerror}") from None

    def _take_all(self) -> None:
        """Take what came, or have the thread that reads take it."""
        self._wakes += 1
        self._woken.clear()
        while not self._taking.acquire(blocking=False):
            with suppress(OSError):  # closed meanwhile: the reader ends, and lets go
                self.socket.sendto(HEAD.pack(MAGIC, WAKE, self.end, self._wakes, 0), (HOST, self.port))
            if self._woken.wait(WAIT_IN_KERNEL_S):
                return
        try:
            while self._take(0.0):
                pass
        finally:
            self._taking.release()

    def _take(self, wait_s: float) -> bool:
        """Take one datagram from the socket; return whether there was one. The caller holds `_taking`."""
        flags = 0
        if wait_s < WAIT_IN_KERNEL_S:
            flags = socket.MSG_DONTWAIT
            if wait_s:
                self._await(wait_s)
        try:
            datagram, sender = self.socket.recvfrom(LONGEST + 1, flags)
        except BlockingIOError:
            return False
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: {error.strerror}") from None
        if HEAD.size <= len(datagram) <= LONGEST:
            magic, kind, end, number, taken = HEAD.unpack_from(datagram)
            if sender != (HOST, self._base + end):
                pass
            elif end == self.end:
                if magic == MAGIC and kind == WAKE and number == self._wakes:
                    self._woken.set()
            elif magic == MAGIC and end < CHANNEL_ENDS:
                port = self._base + end
                self._handle(self.peers.get(port) or self._newcomer(port), kind, number, taken, datagram)
        return True

    def _handle(self, peer: Peer, kind: int, number: int, taken: int, datagram: bytes) -> None:
        if peer.deaf:
            peer.deaf, peer.acked = False, peer.sent
        elif peer.acked < taken <= peer.sent:
            peer.acked = taken
        if kind == DATA:
            if FRAME.size <= len(datagram) <= FRAME.size + 8:
                self._receive(peer, number, datagram)
        elif kind == HELLO:
            if (len(datagram) - HEAD.size) % FILTER.size == 0:
                peer.met(number, tuple(FILTER.iter_unpack(datagram[HEAD.size :])))
        elif kind == BYE:
            self._forget(peer)

    def _newcomer(self, port: int) -> Peer:
        # A new dict: a sender may be going through the old one.
        peer = Peer(port)
        self.peers = {**self.peers, port: peer}
        return peer

    def _forget(self, gone: Peer) -> None:
        self.peers = {port: peer for port, peer in self.peers.items() if peer is not gone}

    def _receive(self, peer: Peer, number: int, datagram: bytes) -> None:
        missed = number - peer.received - 1
        if missed > 0 and peer.received:  # the first may be for the one who had this port before
            self.lost_frames += missed
            log.warning("%s: %d frames from end %d lost: nobody read here", self.channel_info, missed, peer.port)
        elif missed < 0:  # it begins anew since our last hello
            peer.told = number - 1
        peer.received = number
        if number - peer.told >= ACK_EVERY:
            self._tell(peer, ACK)
        (flagged,) = IDENTITY.unpack_from(datagram, HEAD.size)
        self._frames.append(
            can.Message(
                time.time(),
                flagged & ID_BITS,
                bool(flagged & EXTENDED),
                bool(flagged & REMOTE),
                bool(flagged & ERROR),
                self.channel_info,
                None,
                datagram[FRAME.size :],
            )
        )

    def _has_room(self, peer: Peer) -> bool:
        """Wait until an end has taken some of what it got; return whether it did. One that was killed is forgotten."""
        end_s = time.monotonic() + DEAF_S
        port = peer.port
        if not _taken(port):
            self._forget(peer)
            return False
        while True:
            self._take_all()
            if peer.sent - peer.acked < WINDOW:
                return True
            if time.monotonic() > end_s:
                log.info("%s: end %d does not read, left out until it speaks", self.channel_info, port)
                peer.deaf = True
                return False
            self._await(1e-3)  # returns at once if there is something, then a reader may be at it
            time.sleep(1e-4)

    def _await(self, wait_s: float) -> None:
        try:
            select.select((self.socket,), (), (), wait_s)
        except (OSError, ValueError):  # closed meanwhile
            raise can.CanOperationError(f"{self.channel_info}: the end is closed") from None


def free_channel() -> str:
    """Return a channel none of whose ports is in use.

    Raises:
        CanInitializationError: there is none.
    """
    channels = list(range(FIRST_CHANNEL, LAST_CHANNEL, CHANNEL_ENDS))
    random.shuffle(channels)
    for base in channels:
        if not any(_taken(port) for port in range(base, base + CHANNEL_ENDS)):
            return str(base)
    raise can.CanInitializationError("loopback: no free channel")


def _base(channel: Any) -> int:
    text = str(channel)
    if not text.isdecimal() or not 1024 <= int(text) <= 65536 - CHANNEL_ENDS:
        raise can.CanInitializationError(
            f"loopback: channel {text!r} is not a port from 1024 to {65536 - CHANNEL_ENDS}"
        )
    return int(text)


def _taken(port: int) -> bool:
    """Return whether anybody listens on a port: an empty datagram to a free one is refused at once."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setblocking(False)
        probe.connect((HOST, port))
        try:
            probe.send(b"")
            probe.recv(1)
        except BlockingIOError:
            return True
        except OSError:
            return False
    return True
