"""pyModbusTCP's client, on TLS where that is asked for: of the driver and of the small DCS."""

import socket
import ssl
import time

from pyModbusTCP.client import ModbusClient
from pyModbusTCP.constants import MB_CONNECT_ERR, MB_RECV_ERR, MB_TIMEOUT_ERR

from config.tls_table import Tls
from fieldbus.modbus.tls import client_context, why

CHUNK = 512
"""More than a frame has."""


def modbus_client(host: str, port: int, unit: int, timeout_s: float, tls: Tls | None) -> ModbusClient:
    """Return a client, not yet open.

    Raises:
        InputError: a file of `tls` that is not there or does not fit.
    """
    if tls is None:
        return PlainClient(host, port, unit, timeout=timeout_s, auto_open=False)
    return SecuredClient(host, port, unit, timeout_s, client_context(tls), tls.handshake_timeout_s)


def reason(client: ModbusClient) -> str:
    """Return why TLS failed in the last call; "" without TLS, or when it did not."""
    return client.problem if isinstance(client, SecuredClient) else ""


class PlainClient(ModbusClient):  # type: ignore[misc]  # the library has no types
    """The library's client, with a time-out for the whole of a reply: its own is for each piece of one.

    A reply is mostly there whole at the first look, which then is the only one. What comes behind it is left for the
    next, where it does not fit.
    """

    _sock: socket.socket
    _stream = b""
    _due_s = 0.0
    _looked = _hurried = False

    def _open(self) -> None:
        self._stream, self._hurried = b"", False
        super()._open()

    def _send_pdu(self, pdu: bytes) -> None:
        if self._hurried and self.is_open:
            self._sock.settimeout(self.timeout)
            self._hurried = False
        super()._send_pdu(pdu)
        self._due_s, self._looked = time.monotonic() + self.timeout, False

    def _recv_all(self, size: int) -> bytes:
        while len(self._stream) < size:
            self._stream += self._more()
        data, self._stream = self._stream[:size], self._stream[size:]
        return data

    def _more(self) -> bytes:
        """Return what has come; the first look for a reply has all of the time-out, each other what is left of it."""
        if self._looked:
            rest_s = self._due_s - time.monotonic()
            if rest_s <= 0:
                self._sock.close()
                raise ModbusClient._NetworkError(MB_TIMEOUT_ERR, "timeout error")
            self._sock.settimeout(rest_s)
            self._hurried = True
        self._looked = True
        data: bytes = self._recv(CHUNK)
        return data


class SecuredClient(PlainClient):
    """The same client on TLS; `problem` says why TLS failed in the last call.

    With TLS 1.3 a server refuses the client's certificate only after the handshake: it shows at the first reply.
    """

    def __init__(
        self, host: str, port: int, unit: int, timeout_s: float, context: ssl.SSLContext, handshake_timeout_s: float
    ) -> None:
        super().__init__(host, port, unit, timeout=timeout_s, auto_open=False)
        self.problem = ""
        self._context = context
        self._handshake_timeout_s = handshake_timeout_s

    def _open(self) -> None:
        super()._open()
        plain: socket.socket = self._sock
        # Or the first request would wait 40 ms for the server to acknowledge the end of the handshake.
        plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        plain.settimeout(self._handshake_timeout_s)
        try:
            self._sock = self._context.wrap_socket(plain, server_hostname=self.host)
        except OSError as error:
            plain.close()
            self.problem = why(error)
            raise ModbusClient._NetworkError(MB_CONNECT_ERR, self.problem) from None
        self._sock.settimeout(self.timeout)

    def _req_init(self) -> None:
        super()._req_init()
        self.problem = ""

    def _recv(self, size: int) -> bytes:
        try:
            data: bytes = self._sock.recv(size)
        except TimeoutError:
            self._sock.close()
            raise ModbusClient._NetworkError(MB_TIMEOUT_ERR, "timeout error") from None
        except OSError as error:
            self.problem = why(error)
            data = b""
        if not data:
            self._sock.close()
            raise ModbusClient._NetworkError(MB_RECV_ERR, "recv error")
        return data
