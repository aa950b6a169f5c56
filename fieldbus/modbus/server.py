"""A Modbus TCP server of 16-bit registers, for both towers: the simulated slave and the supervisory registers.

Each client has a thread, so that a slow or dropped one holds up nobody (`fieldbus.modbus.connection` has the frames);
what a request means, `fieldbus.modbus.register_answers` says. A client may read any part of a value; only both words
from one request belong together.

On TCP the address of the device is its IP address: unit 0 and 255 mean "this device", as does its own number.
Any other unit is a device behind a gateway that is not there: exception 11, so that a wrong number shows at once. So
are 0 and 255 where several units are behind the port: there is no one device that they could mean.

When `MOST_CLIENTS` are connected, a new one takes the place of the one that has asked for nothing for longest, if that
is at least `UNUSED_S`; otherwise it is turned away. So clients that vanished without a word lock out nobody.
"""

import logging
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from socketserver import BaseServer, ThreadingTCPServer
from threading import Thread
from typing import Any

from pymodbus.constants import ExcCodes

from config.errors import InputError
from fieldbus.modbus.connection import Connection, endpoint
from fieldbus.modbus.exception_codes import exception_reply
from fieldbus.modbus.register_answers import RegisterAnswers, Registers
from fieldbus.modbus.tls import NOBODY, Guard, Identity, NotAuthorized, failure_reason

log = logging.getLogger(__name__)

MOST_CLIENTS = 64
UNUSED_S = 60.0
SEND_BUFFER_BYTES = 1 << 15
"""Answers that wait for a client that does not read; the system would keep megabytes for each."""
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}
"""Options by which a client that vanished is noticed within a minute, not two hours; s, s, 1, ms."""
LINGER_S, MOST_DRAINED = 0.5, 8
"""How long, and for how many pieces, what a refused client still sends is drained before the close."""
THIS_DEVICE = frozenset((0, 255))
"""Unit numbers that mean the device at this address, besides its own."""


class RegisterServer(RegisterAnswers):
    """Serves registers on Modbus TCP from `start` to `stop`.

    Args:
        registers: what is served.
        host: the address to listen on; an IPv6 address where that is meant.
        port: the TCP port; 0 takes any free one, `port` says which.
        unit: the server's own unit number.
        guard: secures every connection with TLS, and says what each client may do; None serves all in the clear.
        others: the registers of other units behind the same port. With them "this device" is nobody's number.
    """

    def __init__(
        self,
        registers: Registers,
        host: str,
        port: int,
        unit: int,
        guard: Guard | None = None,
        others: Mapping[int, Registers] | None = None,
    ) -> None:
        super().__init__(registers)
        self._address = (host, port)
        self._units: dict[int, RegisterAnswers] = {unit: self}
        if others:
            self._units |= {number: RegisterAnswers(each) for number, each in others.items()}
        else:
            self._units |= dict.fromkeys(THIS_DEVICE, self)
        self._guard = guard
        self._listener: _Listener | None = None

    def start(self) -> None:
        """Listen, and answer from threads of its own.

        Raises:
            InputError: the address or the port cannot be bound.
        """
        try:
            self._listener = _Listener(self._address, self._reply, self._guard)
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise InputError(endpoint(self._address), f"cannot listen there: {reason}") from None
        Thread(target=self._listener.serve_forever, args=(0.05,), daemon=True, name="modbus listener").start()

    @property
    def port(self) -> int:
        """The TCP port it listens on."""
        return self._listener.port if self._listener else self._address[1]

    @property
    def address(self) -> str:
        """Where it listens, `host:port`."""
        return endpoint((self._address[0], self.port))

    def stop(self) -> None:
        """Close the port and every connection."""
        if self._listener:
            self._listener.stop()
            self._listener = None

    def _reply(self, number: int, pdu: bytes, peer: str) -> bytes:
        """Return what a unit answers to a client's request."""
        unit = self._units.get(number)
        if unit is None:
            return exception_reply(pdu[0], ExcCodes.GATEWAY_NO_RESPONSE)
        return unit.answer(pdu, peer) if self._guard is None else self._permitted(self._guard, unit, pdu, peer)

    def _permitted(self, guard: Guard, unit: RegisterAnswers, pdu: bytes, peer: str) -> bytes:
        """Answer what the client's role permits; refuse the rest, as Modbus/TCP Security has it."""
        identity = self._listener.identities[peer] if self._listener else NOBODY
        try:
            guard.authorize(identity, pdu)
        except NotAuthorized as refusal:
            log.warning("%s at %s refused: %s", identity, peer, refusal)
            return exception_reply(pdu[0], ExcCodes.ILLEGAL_FUNCTION)
        return unit.answer(pdu, f"{identity} at {peer}")


class _Listener(ThreadingTCPServer):
    """The listening socket and its connections, of which it is the `Host`."""

    allow_reuse_address = True
    daemon_threads = True
    request_queue_size = 128

    def __init__(
        self, address: tuple[str, int], answer: Callable[[int, bytes, str], bytes], guard: Guard | None
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self.answer = answer
        self.identities: dict[str, Identity] = {}
        """Who is at the other end of each secured connection, by its `host:port`."""
        self._guard = guard
        self._connections: dict[Any, str] = {}
        self._used_s: dict[str, float] = {}
        super().__init__(address, Connection)

    @property
    def port(self) -> int:
        return int(self.server_address[1])

    def stop(self) -> None:
        self.shutdown()
        self.server_close()
        for connection in list(self._connections):
            _disconnect(connection)

    def get_request(self) -> tuple[socket.socket, Any]:
        connection, address = super().get_request()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEPALIVE.items():
            if hasattr(socket, option):  # not every system has all of them
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        return connection, address

    def verify_request(self, _request: Any, client_address: Any) -> bool:
        room = len(self._connections) < MOST_CLIENTS or self._evict_idlest()
        if not room:
            log.warning("%s refused: %d clients are connected already", endpoint(client_address), MOST_CLIENTS)
        return room

    def note_use(self, peer: str) -> None:
        """Note when a client last asked for something."""
        self._used_s[peer] = time.monotonic()

    def note_end(self, peer: str) -> None:
        """Forget a client."""
        self._used_s.pop(peer, None)

    def _evict_idlest(self) -> bool:
        """End the connection that is unused for longest, if any is for long enough; return whether."""
        now_s = time.monotonic()
        unused_s = {each: now_s - self._used_s.get(peer, now_s) for each, peer in list(self._connections.items())}
        idlest = max(unused_s, key=unused_s.__getitem__)
        if unused_s[idlest] < UNUSED_S:
            return False
        log.warning("%s gives way: it asked for nothing for %.0f s", self._connections.get(idlest), unused_s[idlest])
        _disconnect(idlest)
        return True

    def process_request(self, request: Any, client_address: Any) -> None:
        self._connections[request] = endpoint(client_address)
        log.debug("%s connected", self._connections[request])
        super().process_request(request, client_address)

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Handle a connection in its own thread, secured if that is asked for: its handshake holds up nobody."""
        if self._guard is None:
            super().finish_request(request, client_address)
            return
        peer = self._connections.pop(request)
        with self._guard.wrap(request) as secured:
            self._connections[secured] = peer  # from here on the other is an empty shell
            try:
                self.identities[peer] = self._guard.handshake(secured)
                super().finish_request(secured, client_address)
            except OSError as error:
                log.warning("%s refused: %s", peer, failure_reason(error))
                _linger(secured)
            finally:
                self.identities.pop(peer, None)
                del self._connections[secured]

    def shutdown_request(self, request: Any) -> None:
        if peer := self._connections.pop(request, None):
            log.debug("%s gone", peer)
        super().shutdown_request(request)

    def handle_error(self: BaseServer, _request: Any, client_address: Any) -> None:
        log.exception("connection of %s failed", client_address)


def _linger(connection: socket.socket) -> None:
    """Close lingeringly: send no more, and drain, so that the other end reads its TLS alert.

    A close with bytes unread resets the connection, and the alert would be lost (RFC 1122, section 4.2.2.13).
    """
    with suppress(OSError):
        socket.socket.shutdown(connection, socket.SHUT_WR)
        connection.settimeout(LINGER_S)
        for _ in range(MOST_DRAINED):
            if not socket.socket.recv(connection, 4096):
                break


def _disconnect(connection: socket.socket) -> None:
    """End a connection that another thread waits on."""
    with suppress(OSError):  # it may be gone already
        # Of the plain socket: that of a secured one drops its TLS state under the thread that waits on it.
        socket.socket.shutdown(connection, socket.SHUT_RDWR)
