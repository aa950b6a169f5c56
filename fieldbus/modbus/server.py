"""A Modbus TCP server of 16-bit registers, for both towers: the simulated slave and the supervisory registers.

Each client has a thread, so that a slow or dropped one holds up nobody (`server_connection` has the frames);
what a request means, `function_codes` says. A client may read any part of a value; only both words
from one request belong together.

On TCP the address of the device is its IP address: unit 0 and 255 mean "this device", as does its own number.
Any other unit is a device behind a gateway that is not there: exception 11, so that a wrong number shows at once. So
are 0 and 255 where several units are behind the port: there is no one device that they could mean.

Who gets a place and how often each host may ask, `fieldbus.modbus.admission` says: clients that vanished without a word
lock out nobody, and one that asks without end is made to wait. On a secured port a client gets its place after its
handshake; a session ends with its certificate. Out of descriptors, no more clients are accepted for a while.
"""

import errno
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
from fieldbus.modbus.admission import Admitted, Allowance, Places, ServerLimits
from fieldbus.modbus.client_roles import NOBODY, Identity, NotAuthorized
from fieldbus.modbus.exception_codes import exception_reply
from fieldbus.modbus.function_codes import RegisterAnswers, Registers
from fieldbus.modbus.request_counts import RequestCounts
from fieldbus.modbus.server_connection import ServerConnection, endpoint
from fieldbus.modbus.tls import Guard, failure_reason

log = logging.getLogger(__name__)

SEND_BUFFER_BYTES = 1 << 15
"""Answers that wait for a client that does not read; the system would keep megabytes for each."""
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}
"""Options by which a client that vanished is noticed within a minute, not two hours; s, s, 1, ms."""
LINGER_S, MOST_DRAINED = 0.5, 8
"""How long, and for how many pieces, what a refused client still sends is drained before the close."""
REFUSALS_SAID, REFUSALS_SAID_PER_S = 50, 0.2
"""Lines on who was turned away: so many at once, then one in five seconds."""
SCARCE = frozenset((errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM))
SCARCE_WAIT_S = 0.1
Witness = Callable[[str, str, str], None]
"""Told of a session: whose it is; `connected`, `turned away`, `refused` or `gone`; and why."""


def nobody_asks(_peer: str, _what: str, _why: str) -> None:
    """Be no witness."""


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
        limits: of clients and requests.
        witness: told of sessions: `host:port` or `name (role) at host:port`, what became of it, and why.
        counts: of requests by who asked.
    """

    def __init__(
        self,
        registers: Registers,
        host: str,
        port: int,
        unit: int,
        guard: Guard | None = None,
        others: Mapping[int, Registers] | None = None,
        limits: ServerLimits | None = None,
        witness: Witness = nobody_asks,
        counts: RequestCounts | None = None,
    ) -> None:
        super().__init__(registers)
        self._counts = counts or RequestCounts()
        self._witness = witness
        self._limits = limits or ServerLimits()
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
            self._listener = _Listener(self._address, self._reply, self._guard, self._limits, self._witness)
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
        if self._guard is not None:
            return self._permitted(self._guard, unit, pdu, peer)
        self._counts.enter(None)
        return unit.answer(pdu, peer)

    def _permitted(self, guard: Guard, unit: RegisterAnswers, pdu: bytes, peer: str) -> bytes:
        """Answer what the client's role permits; refuse the rest, as Modbus/TCP Security has it."""
        identity = self._listener.identities[peer] if self._listener else NOBODY
        if why := guard.ending(identity):
            log.warning("%s at %s: %s, and its session with it", identity, peer, why)
            raise ConnectionAbortedError
        try:
            guard.authorize(identity, pdu)
        except NotAuthorized as refusal:
            log.warning("%s at %s refused: %s", identity, peer, refusal)
            self._counts.refuse()
            self._witness(f"{identity} at {peer}", "refused", str(refusal))
            return exception_reply(pdu[0], ExcCodes.ILLEGAL_FUNCTION)
        self._counts.enter(identity.role)
        return unit.answer(pdu, f"{identity} at {peer}")


class _Listener(ThreadingTCPServer):
    """The listening socket and its connections, of which it is the `Host`."""

    allow_reuse_address = True
    daemon_threads = True
    request_queue_size = 128

    def __init__(
        self,
        address: tuple[str, int],
        answer: Callable[[int, bytes, str], bytes],
        guard: Guard | None,
        limits: ServerLimits,
        witness: Witness,
    ) -> None:
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self.answer = answer
        self.identities: dict[str, Identity] = {}
        """Who is at the other end of each secured connection, by its `host:port`."""
        self._guard = guard
        self._witness = witness
        self.idle_s = limits.idle_s
        self._connections: dict[Any, str] = {}
        self._places = Places(limits)
        self._sayable = Allowance(REFUSALS_SAID_PER_S, REFUSALS_SAID)
        self._unsaid = 0
        super().__init__(address, ServerConnection)

    @property
    def port(self) -> int:
        return int(self.server_address[1])

    def stop(self) -> None:
        self.shutdown()
        self.server_close()
        for connection in list(self._connections):
            _disconnect(connection)

    def get_request(self) -> tuple[socket.socket, Any]:
        try:
            connection, address = super().get_request()
        except OSError as error:
            if error.errno in SCARCE:
                self._say_refused("new clients", error.strerror or "")
                time.sleep(SCARCE_WAIT_S)  # the one that knocks goes on knocking: asked at once, this would spin
            raise
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in KEEPALIVE.items():
            if hasattr(socket, option):  # not every system has all of them
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        return connection, address

    def verify_request(self, _request: Any, client_address: Any) -> bool:
        peer, host = endpoint(client_address), str(client_address[0])
        if self._guard is None:
            return self._has_place(peer, host)
        if refusal := self._places.knock(peer, host):
            self._say_refused(peer, refusal)
        return refusal is None

    def note_use(self, peer: str) -> float:
        """Note a request; return how long it must wait."""
        return self._places.use(peer, time.monotonic())

    def _has_place(self, peer: str, host: str) -> bool:
        """Give a client a place, or say why not."""
        admitted = self._places.take(peer, host, time.monotonic())
        if admitted.refusal:
            self._say_refused(peer, admitted.refusal)
        if admitted.gone:
            self._dismiss(admitted)
        if admitted.refusal is None:
            self._witness(self._said(peer), "connected", "")
        return admitted.refusal is None

    def _said(self, peer: str) -> str:
        """Return what a peer is called: with the name and role of its certificate, where it has shown one."""
        identity = self.identities.get(peer)
        return peer if identity is None else f"{identity} at {peer}"

    def _dismiss(self, admitted: Admitted) -> None:
        """End the connection that gives way."""
        log.warning("%s gives way: it asked for nothing for %.0f s", admitted.gone, admitted.unused_s)
        for connection, peer in list(self._connections.items()):
            if peer == admitted.gone:
                _disconnect(connection)

    def _say_refused(self, peer: str, reason: str) -> None:
        """Log a refusal; of many, some, with how many were passed over."""
        if not self._sayable.may(time.monotonic()):
            self._unsaid += 1
            return
        unsaid, self._unsaid = self._unsaid, 0
        more = f" ({unsaid} more were refused)" if unsaid else ""
        log.warning("%s refused: %s%s", peer, reason, more)
        self._witness(peer, "turned away", f"{reason}{more}")

    def process_request(self, request: Any, client_address: Any) -> None:
        self._connections[request] = endpoint(client_address)
        log.debug("%s connected", self._connections[request])
        super().process_request(request, client_address)

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Handle a connection in its own thread, secured if that is asked for: its handshake holds up nobody."""
        if self._guard is None:
            super().finish_request(request, client_address)
            return
        with self._guard.wrap(request) as secured:
            peer = self._connections[secured] = self._connections.pop(request)  # from here on that is an empty shell
            try:
                self.identities[peer] = self._guard.handshake(secured)
                if self._has_place(peer, str(client_address[0])):
                    super().finish_request(secured, client_address)
                    self._witness(self._said(peer), "gone", "")
            except OSError as error:
                self._say_refused(peer, failure_reason(error))
                _linger(secured)
            finally:
                self._places.leave(peer)
                self.identities.pop(peer, None)
                del self._connections[secured]

    def shutdown_request(self, request: Any) -> None:
        if peer := self._connections.pop(request, None):
            self._places.leave(peer)
            log.debug("%s gone", peer)
            self._witness(peer, "gone", "")
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
