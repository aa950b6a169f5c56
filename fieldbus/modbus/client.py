"""A Modbus TCP client, on TLS where that is asked for: of the driver and of the small DCS.

pymodbus makes and reads frames and PDUs. The connection is a socket of ours: a reply must be whole within one time-out,
in however many pieces it comes, and a secured server's certificate must be that of the host called. Checked here:
transaction, protocol, length and unit. After anything but a whole reply to the request the connection is closed, so
that no late reply is ever read.

Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, sections 3.1.3 (header) and 4.3.2 (transactions).
"""

import socket
import ssl
import time
from collections.abc import Sequence

from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadHoldingRegistersResponse,
    WriteMultipleRegistersRequest,
)

from config.tls_table import Tls
from fieldbus.modbus.exception_codes import exception_code, exception_text
from fieldbus.modbus.pdu import encoded
from fieldbus.modbus.tls import client_context, failure_reason

CHUNK = 512
"""More than a frame has."""
LAST_TRANSACTION = 0xFFFF
LENGTH_ENDS = 6
"""Bytes of a frame up to its length, which counts those behind it."""
CLOSED = "the connection is closed"

_FRAMER = FramerSocket(DecodePDU(is_server=False))


class ClientError(Exception):
    """No reply to a request; the text says why, in words."""


class NotConnected(ClientError):
    """The server was not reached, or the connection has ended."""


class NobodyThere(NotConnected):
    """Nobody accepts a connection at the address."""


class ReplyTimeout(ClientError):
    """No whole reply came within the time-out."""


class UnexpectedReply(ClientError):
    """What came is no reply to the request."""

    def __init__(self, frame: bytes) -> None:
        super().__init__(f"the reply does not fit: {frame.hex(' ')}")


class Refused(ClientError):
    """The server refuses the request with an exception."""

    def __init__(self, code: int) -> None:
        super().__init__(exception_text(code))
        self.code = code


class ModbusClient:
    """A connection to a Modbus TCP server, closed until `open`.

    Args:
        host: name or address of the server.
        port: its TCP port.
        unit: the unit that is asked, 0 to 255.
        timeout_s: for connecting, and for the whole of each reply.
        tls: certificates; None talks in the clear.

    Raises:
        InputError: a file of `tls` that is not there or does not fit.
    """

    def __init__(self, host: str, port: int, unit: int, timeout_s: float, tls: Tls | None = None) -> None:
        self._address = (host, port)
        self._unit = unit
        self._timeout_s = timeout_s
        self._context = None if tls is None else client_context(tls)
        self._handshake_timeout_s = 0.0 if tls is None else tls.handshake_timeout_s
        self._socket: socket.socket | None = None
        self._received = b""
        self._transaction = 0

    def open(self) -> None:
        """Connect (anew).

        Raises:
            NotConnected: the name is not known, nobody accepts, or TLS failed.
        """
        self.close()
        self._received = b""
        try:
            plain = socket.create_connection(self._address, self._timeout_s)
        except socket.gaierror as error:
            raise NotConnected(error.strerror) from None
        except OSError:
            raise NobodyThere(f"nobody accepts a connection within {1e3 * self._timeout_s:g} ms") from None
        plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = plain if self._context is None else self._secured(plain, self._context)

    def close(self) -> None:
        """End the connection. Never raises."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def transact(self, pdu: bytes) -> bytes:
        """Return the PDU that answers a request's.

        Raises:
            NotConnected: the connection is, or was, closed.
            ReplyTimeout: no whole reply within the time-out.
            UnexpectedReply: of another transaction, protocol or unit, or no frame.
        """
        line = self._socket
        if line is None:
            raise NotConnected(CLOSED)
        self._transaction = transaction = self._transaction % LAST_TRANSACTION + 1
        try:
            line.sendall(_FRAMER.encode(pdu, self._unit, transaction))
            return self._reply(line, transaction)
        except TimeoutError:
            self.close()
            raise ReplyTimeout(f"no reply within {1e3 * self._timeout_s:g} ms") from None
        except OSError as error:
            self.close()
            raise NotConnected(failure_reason(error) if isinstance(error, ssl.SSLError) else CLOSED) from None
        except UnexpectedReply:
            self.close()
            raise

    def read_holding_registers(self, address: int, count: int) -> list[int]:
        """Return `count` words (function 3).

        Raises:
            ClientError: as `transact`; `Refused` where the server does.
        """
        request = encoded(ReadHoldingRegistersRequest(address=address, count=count))
        size = 2 * count
        reply = self._ask(request, bytes((request[0], size)), 2 + size)
        answer = ReadHoldingRegistersResponse()
        answer.decode(reply[1:])
        return list(answer.registers)

    def write_registers(self, address: int, words: Sequence[int]) -> None:
        """Write words (function 16).

        Raises:
            ClientError: as `transact`; `Refused` where the server does.
        """
        request = encoded(WriteMultipleRegistersRequest(address=address, registers=words))
        echo = request[:5]
        self._ask(request, echo, len(echo))

    def _ask(self, request: bytes, head: bytes, size: int) -> bytes:
        """Return the reply PDU to a request, which must begin with `head` and have a size in bytes."""
        reply = self.transact(request)
        if (code := exception_code(request, reply)) is not None:
            raise Refused(code)
        if len(reply) != size or not reply.startswith(head):
            self.close()
            raise UnexpectedReply(reply)
        return reply

    def _reply(self, line: socket.socket, transaction: int) -> bytes:
        """Return the PDU of the next frame, which must be the reply to a transaction."""
        due_s = time.monotonic() + self._timeout_s
        stream = self._received or _some(line)
        in_pieces = False
        while True:
            if stream[2:5].strip(b"\0"):  # another protocol, or longer than a frame
                raise UnexpectedReply(stream)
            used, unit, answered, pdu = _FRAMER.decode(stream)
            if used:
                break
            if b"\0\0" <= stream[4:6] < b"\0\2":  # no frame is that short; pymodbus would wait for more
                raise UnexpectedReply(stream)
            in_pieces = True
            if (left_s := due_s - time.monotonic()) <= 0:
                raise TimeoutError
            line.settimeout(left_s)
            stream += _some(line)
        if in_pieces:
            line.settimeout(self._timeout_s)
        if answered != transaction or unit != self._unit or used != LENGTH_ENDS + stream[LENGTH_ENDS - 1]:
            raise UnexpectedReply(stream)
        self._received = stream[used:]
        return pdu

    def _secured(self, plain: socket.socket, context: ssl.SSLContext) -> ssl.SSLSocket:
        plain.settimeout(self._handshake_timeout_s)
        try:
            secured = context.wrap_socket(plain, server_hostname=self._address[0])
        except OSError as error:
            plain.close()
            raise NotConnected(failure_reason(error)) from None
        secured.settimeout(self._timeout_s)
        return secured


def _some(line: socket.socket) -> bytes:
    data = line.recv(CHUNK)
    if not data:
        raise ConnectionResetError
    return data
