"""A Modbus TCP server of 16-bit registers, for both towers: the simulated slave and the supervisory registers.

Each client has a thread, so that a slow or dropped one holds up nobody (`fieldbus.modbus.connection` has the frames);
what a request means is answered here, as the Modbus Application Protocol V1.1b3 says:

    function                  count        refused, and nothing changed
    3, 4   read               1 to 125     1 other functions
    6      write one                       2 an address outside the map, read-only, or half a value
    16     write several      1 to 123     3 a count or a value that is not allowed
    23     write, then read   1 to 121,    4 a fault of the server itself (logged)
                              1 to 125     6 a value that cannot be taken now
                                           11 another unit (see below)

One request at a time holds a unit's lock: it is all or nothing, and what it reads is of one moment. A client may read
any part of a value; only both words from one request belong together.

On TCP the address of the device is its IP address: unit 0 and 255 mean "this device", as does its own number.
Any other unit is a device behind a gateway that is not there: exception 11, so that a wrong number shows at once. So
are 0 and 255 where several units are behind the port: there is no one device that they could mean.

When `MOST_CLIENTS` are connected, a new one takes the place of the one that has asked for nothing for longest, if that
is at least `UNUSED_S`; otherwise it is turned away. So clients that vanished without a word lock out nobody.
"""

import logging
import socket
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from enum import IntEnum
from socketserver import BaseServer, ThreadingTCPServer
from threading import Lock, Thread
from typing import Any, Literal, Protocol

from config.device import MOST_REGISTERS
from config.errors import InputError
from fieldbus.modbus.connection import Connection, place
from fieldbus.modbus.tls import NOBODY, Guard, Identity, why

log = logging.getLogger(__name__)

Table = Literal["holding", "input"]
MOST_CLIENTS = 64
UNUSED_S = 60.0
SEND_BUFFER_BYTES = 1 << 15
"""Answers that wait for a client that does not read; the system would keep megabytes for each."""
KEEPALIVE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}
"""Options by which a client that vanished is noticed within a minute, not two hours; s, s, 1, ms."""
HEARING_S, MOST_LAST_WORDS = 0.5, 8
"""How long, and for how many pieces, a client that is turned away is still listened to."""
THIS_DEVICE = frozenset((0, 255))
"""Unit numbers that mean the device at this address, besides its own."""


class ExceptionCode(IntEnum):
    """Why a request is refused, as the specification numbers it."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    DEVICE_BUSY = 6
    NO_SUCH_UNIT = 11


class RegisterError(Exception):
    """A request that the registers refuse."""

    def __init__(self, code: ExceptionCode) -> None:
        super().__init__(code.name)
        self.code = code


class Registers(Protocol):
    """What a server serves. Called with the lock held; what it raises, the client gets as an exception."""

    def read(self, table: Table, address: int, count: int) -> Sequence[int]:
        """Return `count` words of one moment. Changes nothing.

        Raises:
            RegisterError: ILLEGAL_ADDRESS, some of them are not there.
        """
        ...

    def write(self, address: int, words: Sequence[int], peer: str) -> None:
        """Write holding registers, all of them or none; `peer` is the client's `host:port`, for the log.

        Raises:
            RegisterError: ILLEGAL_ADDRESS, not there, not writable, or a part of a value; ILLEGAL_VALUE.
        """
        ...


class RegisterAnswers:
    """What a request for registers means, whatever it travels in.

    Args:
        registers: what is served.
    """

    def __init__(self, registers: Registers) -> None:
        self.lock = Lock()
        """Held while a request is answered; hold it to change the registers from outside. Each unit has its own."""
        self._registers = registers
        self._functions: dict[int, Callable[[bytes, str], bytes]] = {
            3: self._read,
            4: self._read,
            6: self._write_one,
            16: self._write,
            23: self._write_then_read,
        }

    def answer(self, pdu: bytes, peer: str) -> bytes:
        """Return the answer to one request, without the frame round either. Never raises."""
        function = pdu[0]
        try:
            if function not in self._functions:
                raise RegisterError(ExceptionCode.ILLEGAL_FUNCTION)
            with self.lock:
                return self._functions[function](pdu, peer)
        except RegisterError as refusal:
            code = refusal.code
        except Exception:
            log.exception("request %s of %s failed", pdu.hex(), peer)
            code = ExceptionCode.DEVICE_FAILURE
        return bytes((function | 0x80, code))

    def _read(self, pdu: bytes, _peer: str) -> bytes:
        function, address, count = _unpack(">BHH", pdu)
        _allow(1 <= count <= MOST_REGISTERS)
        return self._words(function, "holding" if function == 3 else "input", address, count)

    def _write_one(self, pdu: bytes, peer: str) -> bytes:
        _, address, word = _unpack(">BHH", pdu)
        self._registers.write(address, (word,), peer)
        return pdu

    def _write(self, pdu: bytes, peer: str) -> bytes:
        _, address, count, size = _unpack(">BHHB", pdu[:6])
        _allow(1 <= count <= 123)
        self._registers.write(address, _data(pdu[6:], count, size), peer)
        return pdu[:5]

    def _write_then_read(self, pdu: bytes, peer: str) -> bytes:
        function, read_address, read_count, address, count, size = _unpack(">BHHHHB", pdu[:10])
        _allow(1 <= read_count <= MOST_REGISTERS and 1 <= count <= 121)
        words = _data(pdu[10:], count, size)
        # The write comes first; but a read that would be refused must refuse the write with it.
        self._registers.read("holding", read_address, read_count)
        self._registers.write(address, words, peer)
        return self._words(function, "holding", read_address, read_count)

    def _words(self, function: int, table: Table, address: int, count: int) -> bytes:
        words = self._registers.read(table, address, count)
        return struct.pack(f">BB{count}H", function, 2 * count, *words)


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
            InputError: the address or the port cannot be had.
        """
        try:
            self._listener = _Listener(self._address, self._reply, self._guard)
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise InputError(place(self._address), f"cannot listen there: {reason}") from None
        Thread(target=self._listener.serve_forever, args=(0.05,), daemon=True, name="modbus listener").start()

    @property
    def port(self) -> int:
        """The TCP port it listens on."""
        return self._listener.port if self._listener else self._address[1]

    @property
    def address(self) -> str:
        """Where it listens, `host:port`."""
        return place((self._address[0], self.port))

    def stop(self) -> None:
        """Close the port and every connection."""
        if self._listener:
            self._listener.stop()
            self._listener = None

    def _reply(self, number: int, pdu: bytes, peer: str) -> bytes:
        """Return what a unit answers to a client's request."""
        unit = self._units.get(number)
        if unit is None:
            return bytes((pdu[0] | 0x80, ExceptionCode.NO_SUCH_UNIT))
        return unit.answer(pdu, peer) if self._guard is None else self._permitted(self._guard, unit, pdu, peer)

    def _permitted(self, guard: Guard, unit: RegisterAnswers, pdu: bytes, peer: str) -> bytes:
        """Answer what the client's role permits; refuse the rest, as Modbus/TCP Security has it."""
        identity = self._listener.identities[peer] if self._listener else NOBODY
        if objection := guard.objection(identity, pdu):
            log.warning("%s at %s refused: %s", identity, peer, objection)
            return bytes((pdu[0] | 0x80, ExceptionCode.ILLEGAL_FUNCTION))
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
            _hang_up(connection)

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
        room = len(self._connections) < MOST_CLIENTS or self._make_room()
        if not room:
            log.warning("%s refused: %d clients are connected already", place(client_address), MOST_CLIENTS)
        return room

    def is_used(self, peer: str) -> None:
        """Note when a client last asked for something."""
        self._used_s[peer] = time.monotonic()

    def is_gone(self, peer: str) -> None:
        """Forget a client."""
        self._used_s.pop(peer, None)

    def _make_room(self) -> bool:
        """End the connection that is unused for longest, if any is for long enough; return whether."""
        now_s = time.monotonic()
        unused_s = {each: now_s - self._used_s.get(peer, now_s) for each, peer in list(self._connections.items())}
        idlest = max(unused_s, key=unused_s.__getitem__)
        if unused_s[idlest] < UNUSED_S:
            return False
        log.warning("%s gives way: it asked for nothing for %.0f s", self._connections.get(idlest), unused_s[idlest])
        _hang_up(idlest)
        return True

    def process_request(self, request: Any, client_address: Any) -> None:
        self._connections[request] = place(client_address)
        log.debug("%s connected", self._connections[request])
        super().process_request(request, client_address)

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Handle a connection in its own thread, secured if that is asked for: its handshake holds up nobody."""
        if self._guard is None:
            super().finish_request(request, client_address)
            return
        peer = self._connections.pop(request)
        with self._guard.wrapped(request) as secured:
            self._connections[secured] = peer  # from here on the other is an empty shell
            try:
                self.identities[peer] = self._guard.shaken(secured)
                super().finish_request(secured, client_address)
            except OSError as error:
                log.warning("%s refused: %s", peer, why(error))
                _let_hear(secured)
            finally:
                self.identities.pop(peer, None)
                del self._connections[secured]

    def shutdown_request(self, request: Any) -> None:
        if peer := self._connections.pop(request, None):
            log.debug("%s gone", peer)
        super().shutdown_request(request)

    def handle_error(self: BaseServer, _request: Any, client_address: Any) -> None:
        log.exception("connection of %s failed", client_address)


def _let_hear(connection: socket.socket) -> None:
    """Let the other end read why, before the close that would drop it: its own words still under way reset the line."""
    with suppress(OSError):
        socket.socket.shutdown(connection, socket.SHUT_WR)
        connection.settimeout(HEARING_S)
        for _ in range(MOST_LAST_WORDS):
            if not socket.socket.recv(connection, 4096):
                break


def _hang_up(connection: socket.socket) -> None:
    """End a connection that another thread waits on."""
    with suppress(OSError):  # it may be gone already
        # Of the plain socket: that of a secured one drops its TLS state under the thread that waits on it.
        socket.socket.shutdown(connection, socket.SHUT_RDWR)


def _unpack(layout: str, head: bytes) -> tuple[int, ...]:
    """Return the fields of a request; one that is too short or too long has a wrong count."""
    _allow(struct.calcsize(layout) == len(head))
    return struct.unpack(layout, head)


def _data(data: bytes, count: int, size: int) -> tuple[int, ...]:
    """Return the words to write, when their number is what the request says twice."""
    _allow(size == 2 * count == len(data))
    return struct.unpack(f">{count}H", data)


def _allow(right: bool) -> None:
    if not right:
        raise RegisterError(ExceptionCode.ILLEGAL_VALUE)
