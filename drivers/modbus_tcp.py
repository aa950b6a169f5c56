"""A device on Modbus TCP, secured by TLS where its table says so.

pyModbusTCP carries the frames and checks transaction, protocol and unit. A late reply is never taken for another's:
after a time-out, or a reply that does not fit, the connection is closed.
"""

from typing import Any

from pyModbusTCP.constants import MB_EXCEPT_ERR, MB_RECV_ERR, MB_TIMEOUT_ERR

from config.device import ModbusTcpDevice
from drivers.boundary import BadReply, DriverError, NoConnection, NoReply
from drivers.modbus_device import ModbusDriver
from fieldbus.modbus.client import modbus_client, reason


class ModbusTcpDriver(ModbusDriver):
    """Drives a device on Modbus TCP.

    Args:
        config: where the device is, how long it may take, what its registers hold.

    Raises:
        InputError: a file of `config.tls_table` that is not there or does not fit.
    """

    def __init__(self, config: ModbusTcpDevice) -> None:
        super().__init__(config, f"{config.host}:{config.port} unit {config.unit}")
        self._client: Any = modbus_client(config.host, config.port, config.unit, config.reply_timeout_s, config.tls)
        self._client.on_tx_rx = self._note
        self._frame = b""

    def close(self) -> None:
        """Let go of the device; it keeps its last command until its own time-out."""
        self._client.close()

    def _connect(self) -> None:
        try:
            connected = self._client.open()
        except OSError as error:  # the name is not known
            raise NoConnection(f"{self._who}: {error.strerror}") from None
        if not connected:
            nobody = f"nobody accepts a connection within {1e3 * self._config.reply_timeout_s:g} ms"
            raise NoConnection(f"{self._who}: {reason(self._client) or nobody}")

    def _transact(self, request: bytes, head: bytes, length: int) -> bytes:
        reply: bytes | None = self._client.custom_request(request)
        if reply is not None and len(reply) == length and reply.startswith(head):
            return reply
        raise self._fault(request, reply)

    def _fault(self, request: bytes, reply: bytes | None) -> DriverError:
        """Return what a transaction that did not succeed means; end the connection unless it can be trusted."""
        about = self._about(request)
        error = self._client.last_error
        frame = self._frame
        if reply is None and error == MB_TIMEOUT_ERR:
            return NoReply(f"{about}: no reply within {1e3 * self._config.reply_timeout_s:g} ms")
        if reply is None and error == MB_EXCEPT_ERR and frame[7] == request[0] | 0x80 and len(frame) == 9:
            return self._refused(request, frame[8])
        self.close()
        if (reply is None and error not in (MB_EXCEPT_ERR, MB_RECV_ERR)) or not frame:
            return NoConnection(f"{about}: {reason(self._client) or 'the connection is closed'}")
        return BadReply(f"{about}: the reply does not fit: {frame.hex(' ')}")

    def _note(self, frame: bytes, is_tx: bool) -> None:
        """Keep the frame that came in answer to the last request."""
        self._frame = b"" if is_tx else frame
