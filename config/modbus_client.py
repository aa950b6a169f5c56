"""pyModbusTCP's client, on TLS where that is asked for: of the driver and of the small DCS."""

import socket
import ssl

from pyModbusTCP.client import ModbusClient
from pyModbusTCP.constants import MB_CONNECT_ERR, MB_RECV_ERR, MB_TIMEOUT_ERR

from config.tls import Tls, client_context, why


def modbus_client(host: str, port: int, unit: int, timeout_s: float, tls: Tls | None) -> ModbusClient:
    """Return a client, not yet open.

    Raises:
        InputError: a file of `tls` that is not there or does not fit.
    """
    if tls is None:
        return ModbusClient(host, port, unit, timeout=timeout_s, auto_open=False)
    return SecuredClient(host, port, unit, timeout_s, client_context(tls), tls.handshake_timeout_s)


def reason(client: ModbusClient) -> str:
    """Return why TLS failed in the last call; "" without TLS, or when it did not."""
    return client.problem if isinstance(client, SecuredClient) else ""


class SecuredClient(ModbusClient):  # type: ignore[misc]  # the library has no types
    """The same client on TLS; `problem` says why TLS failed in the last call.

    With TLS 1.3 a server refuses the client's certificate only after the handshake: it shows at the first reply.
    """

    def __init__(
        self, host: str, port: int, unit: int, timeout_s: float, context: ssl.SSLContext, handshake_timeout_s: float
    ) -> None:
        super().__init__(host, port, unit, timeout=timeout_s, auto_open=False)
        self._sock: socket.socket
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
