"""A Modbus client on TCP, with TLS where that is asked for: of the driver and of the small DCS.

pymodbus makes and reads frames and PDUs (`framing`). The connection is a socket of ours: a reply must be whole within
one time-out, in however many pieces it comes, and a secured server's certificate must be that of the host called.
After anything but a whole reply to the request the connection is closed, so that no late reply is ever read.

Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, section 4.3.2 (transactions).
"""

import socket
import ssl
import time
from collections.abc import Sequence
from contextlib import suppress

from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadHoldingRegistersResponse,
    WriteMultipleRegistersRequest,
)

from config.tls_table import Tls
from fieldbus.modbus.client_errors import (
    ClientError,
    DuplicatedReply,
    NobodyThere,
    NotConnected,
    Refused,
    ReplyTimeout,
    UnexpectedReply,
)
from fieldbus.modbus.exception_codes import exception_code
from fieldbus.modbus.framing import Framing, MbapFraming
from fieldbus.modbus.host_address import HostAddress, connected
from fieldbus.modbus.pdu import encoded
from fieldbus.modbus.tls import client_context, failure_reason

REPLY_PIECE_BYTES = 512
"""More than a frame has."""
CLOSED = "the connection is closed"


class ModbusClient:
    """A connection to a Modbus server on TCP, closed until `open`.

    Args:
        host: name or address of the server.
        port: its TCP port.
        unit: the unit that is asked, 0 to 255.
        timeout_s: for connecting, and for the whole of each reply.
        tls: certificates; None talks in the clear.
        framing: how frames lie in the stream; None, as the specification of Modbus TCP has it.

    Raises:
        InputError: a file of `tls` that is not there or does not fit.
    """

    def __init__(
        self,
        host: str,
        port: int,
        unit: int,
        timeout_s: float,
        tls: Tls | None = None,
        framing: Framing | None = None,
    ) -> None:
        self._host = host
        self._address = HostAddress(host, port)
        self._framing = framing or MbapFraming(unit)
        self._timeout_s = timeout_s
        self._context = None if tls is None else client_context(tls)
        self._handshake_timeout_s = 0.0 if tls is None else tls.handshake_timeout_s
        self.line: socket.socket | None = None
        self._received = b""

    def open(self) -> None:
        """Connect (anew).

        Raises:
            NotConnected: the name is not known, nobody accepts, or TLS failed.
        """
        self.close()
        self._received = b""
        try:
            addresses = self._address.within(self._timeout_s)
        except TimeoutError as error:
            raise NotConnected(str(error)) from None
        except OSError as error:
            raise NotConnected(error.strerror) from None
        try:
            plain = connected(addresses, self._timeout_s)
        except OSError:
            raise NobodyThere(f"nobody accepts a connection within {1e3 * self._timeout_s:g} ms") from None
        plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.line = plain if self._context is None else self._secured(plain, self._context)

    def close(self) -> None:
        """End the connection. Never raises."""
        if self.line is not None:
            self.line.close()
            self.line = None

    def transact(self, pdu: bytes) -> bytes:
        """Return the PDU that answers a request's.

        Raises:
            NotConnected: the connection is, or was, closed.
            ReplyTimeout: no whole reply within the time-out.
            UnexpectedReply: of another transaction, protocol or unit, or no frame.
        """
        line = self.line
        if line is None:
            raise NotConnected(CLOSED)
        try:
            if early := self._early(line):
                raise DuplicatedReply(early)
            line.sendall(self._framing.request(pdu))
            return self._reply(line)
        except (OSError, UnexpectedReply) as error:
            raise self._ended_by(error) from None

    def ask(self, pdu: bytes) -> int | None:
        """Send a request whose reply `answer` takes; return the descriptor that is ready to be read when some is there.

        None: nothing was sent, and `transact` says why. A secured connection is ready without a reply, too.
        """
        line = self.line
        if line is None or self._context is not None:
            return None
        try:
            if self._early(line):
                return None
            line.sendall(self._framing.request(pdu))
        except OSError:
            self.close()
            return None
        return line.fileno()

    def answer(self, *, late: bool) -> bytes | None:
        """Return the PDU that answers what was asked; None while it is not whole. Waits for nothing.

        Args:
            late: whether the time-out is over. What came meanwhile counts: the caller may be late, not the device.

        Raises:
            ClientError: as `transact`.
        """
        line = self.line
        if line is None:
            raise NotConnected(CLOSED)
        try:
            if late:
                line.settimeout(0.0)
            self._received += _some(line)
            found = self._framing.reply(self._received)
            if late:
                if found is None:
                    raise TimeoutError
                line.settimeout(self._timeout_s)
        except (OSError, UnexpectedReply) as error:
            raise self._ended_by(error) from None
        if found is None:
            return None
        used, pdu = found
        self._received = self._received[used:]
        return pdu

    def _early(self, line: socket.socket) -> bytes:
        """Return what came before the next request, so that it answers none; nothing where replies are numbered.

        Taken for the reply, it would make this and each later sample a cycle old.
        """
        if not self._framing.is_numbered:
            line.settimeout(0.0)
            with suppress(BlockingIOError, ssl.SSLWantReadError):
                self._received += line.recv(REPLY_PIECE_BYTES)
            line.settimeout(self._timeout_s)
            return self._received
        return b""

    def _ended_by(self, error: OSError | UnexpectedReply) -> ClientError:
        """End the connection and return what to raise."""
        self.close()
        if isinstance(error, UnexpectedReply):
            return error
        if isinstance(error, TimeoutError | BlockingIOError):
            return ReplyTimeout(f"no reply within {1e3 * self._timeout_s:g} ms")
        return NotConnected(failure_reason(error) if isinstance(error, ssl.SSLError) else CLOSED)

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

    def _reply(self, line: socket.socket) -> bytes:
        """Return the PDU of the next frame, which must be the reply to the request."""
        due_s = time.monotonic() + self._timeout_s
        stream = self._received or _some(line)
        in_pieces = False
        while (found := self._framing.reply(stream)) is None:
            in_pieces = True
            if (left_s := due_s - time.monotonic()) <= 0:
                raise TimeoutError
            line.settimeout(left_s)
            stream += _some(line)
        if in_pieces:
            line.settimeout(self._timeout_s)
        used, pdu = found
        self._received = stream[used:]
        return pdu

    def _secured(self, plain: socket.socket, context: ssl.SSLContext) -> ssl.SSLSocket:
        plain.settimeout(self._handshake_timeout_s)
        try:
            secured = context.wrap_socket(plain, server_hostname=self._host)
        except OSError as error:
            plain.close()
            raise NotConnected(failure_reason(error)) from None
        secured.settimeout(self._timeout_s)
        return secured


def _some(line: socket.socket) -> bytes:
    data = line.recv(REPLY_PIECE_BYTES)
    if not data:
        raise ConnectionResetError
    return data
