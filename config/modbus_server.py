"""A Modbus TCP server of 16-bit registers, for both towers: the simulated slave and the supervisory registers.

pyModbusTCP keeps the connections and their frames (a thread per client, so that a slow or dropped one holds up
nobody); what a request means is answered here, as the Modbus Application Protocol V1.1b3 says:

    function                  count        refused, and nothing changed
    3, 4   read               1 to 125     1 other functions
    6      write one                       2 an address outside the map, read-only, or half a value
    16     write several      1 to 123     3 a count or a value that is not allowed
    23     write, then read   1 to 121,    4 a fault of the server itself (logged)
                              1 to 125     6 a value that cannot be taken now
                                           11 another unit (see below)

One request at a time holds the lock: it is all or nothing, and what it reads is of one moment. A client may read
any part of a value; only both words from one request belong together.

On TCP the address of the device is its IP address: unit 0 and 255 mean "this device", as does its own number.
Any other unit is a device behind a gateway that is not there: exception 11, so that a wrong number shows at once.
"""

import logging
import socket
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import IntEnum
from socketserver import BaseServer, ThreadingTCPServer
from threading import Event, Lock, Thread
from typing import Any, Literal, Protocol

from pyModbusTCP.server import ModbusServer

from config.device import MOST_REGISTERS
from config.errors import InputError

log = logging.getLogger(__name__)

Table = Literal["holding", "input"]
MOST_CLIENTS = 32
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


class RegisterServer:
    """Serves registers on Modbus TCP (IPv4) from `start` to `stop`.

    Args:
        registers: what is served.
        host: the address to listen on.
        port: the TCP port; 0 takes any free one, `port` says which.
        unit: the server's own unit number.
    """

    def __init__(self, registers: Registers, host: str, port: int, unit: int) -> None:
        self.lock = Lock()
        """Held while a request is answered; hold it to change the registers from outside."""
        self._registers = registers
        self._address = (host, port)
        self._units = THIS_DEVICE | {unit}
        self._listener: _Listener | None = None
        self._functions: dict[int, Callable[[bytes, str], bytes]] = {
            3: self._read,
            4: self._read,
            6: self._write_one,
            16: self._write,
            23: self._write_then_read,
        }

    def start(self) -> None:
        """Listen, and answer from threads of its own.

        Raises:
            InputError: the address or the port cannot be had.
        """
        try:
            self._listener = _Listener(self._address, self._serve)
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise InputError("{}:{}".format(*self._address), f"cannot listen there: {reason}") from None
        Thread(target=self._listener.serve_forever, args=(0.05,), daemon=True, name="modbus listener").start()

    @property
    def port(self) -> int:
        """The TCP port it listens on."""
        return self._listener.port if self._listener else self._address[1]

    def stop(self) -> None:
        """Close the port and every connection."""
        if self._listener:
            self._listener.stop()
            self._listener = None

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

    def _serve(self, session: Any) -> None:
        """Answer the request of a pyModbusTCP session."""
        request = session.request
        if request.mbap.unit_id in self._units:
            peer = f"{session.client.address}:{session.client.port}"
            session.response.pdu.raw = self.answer(request.pdu.raw, peer)
        else:
            session.response.pdu.raw = bytes((request.pdu.raw[0] | 0x80, ExceptionCode.NO_SUCH_UNIT))

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


class _Listener(ThreadingTCPServer):
    """The listening socket and its connections, each handled by pyModbusTCP.

    Its handler asks the server it is given for two things: `evt_running`, and `engine` that answers a session.
    """

    allow_reuse_address = True
    daemon_threads = True
    request_queue_size = 128

    def __init__(self, address: tuple[str, int], engine: Callable[[Any], None]) -> None:
        self.engine = engine
        self.evt_running = Event()
        self._connections: dict[Any, str] = {}
        super().__init__(address, ModbusServer.ModbusService)
        self.evt_running.set()

    @property
    def port(self) -> int:
        return int(self.server_address[1])

    def stop(self) -> None:
        self.evt_running.clear()
        self.shutdown()
        self.server_close()
        for connection in list(self._connections):
            _hang_up(connection)

    def get_request(self) -> tuple[socket.socket, Any]:
        connection, address = super().get_request()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        return connection, address

    def verify_request(self, _request: Any, client_address: Any) -> bool:
        room = len(self._connections) < MOST_CLIENTS
        if not room:
            log.warning("%s:%s refused: %d clients are connected already", *client_address, MOST_CLIENTS)
        return room

    def process_request(self, request: Any, client_address: Any) -> None:
        self._connections[request] = "{}:{}".format(*client_address)
        log.debug("%s connected", self._connections[request])
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        if peer := self._connections.pop(request, None):
            log.debug("%s gone", peer)
        super().shutdown_request(request)

    def handle_error(self: BaseServer, _request: Any, client_address: Any) -> None:
        log.exception("connection of %s failed", client_address)


def _hang_up(connection: socket.socket) -> None:
    """End a connection that another thread waits on."""
    with suppress(OSError):  # it may be gone already
        connection.shutdown(socket.SHUT_RDWR)


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
