"""A device on Modbus TCP, secured by TLS where its table says so.

A late reply is never taken for another's: after a time-out, or a reply that does not fit, the connection is closed.
"""

from config.device import ModbusTcpDevice
from drivers.boundary import BadReply, DriverError, NoConnection, NoReply
from drivers.modbus_device import ModbusDriver
from fieldbus.modbus.client import ModbusClient, NotConnected, ReplyTimeout, UnexpectedReply
from fieldbus.modbus.exception_codes import exception_code


class ModbusTcpDriver(ModbusDriver):
    """Drives a device on Modbus TCP.

    Args:
        config: where the device is, how long it may take, what its registers hold.

    Raises:
        InputError: a file of `config.tls` that is not there or does not fit.
    """

    def __init__(self, config: ModbusTcpDevice) -> None:
        super().__init__(config, f"{config.host}:{config.port} unit {config.unit}")
        self._client = ModbusClient(config.host, config.port, config.unit, config.reply_timeout_s, config.tls)

    def close(self) -> None:
        """Close the connection; the device keeps its last command until its own time-out."""
        self._client.close()

    def _connect(self) -> None:
        try:
            self._client.open()
        except NotConnected as error:
            raise NoConnection(f"{self._who}: {error}") from None

    def _transact(self, request: bytes, head: bytes, length: int) -> bytes:
        try:
            reply = self._client.transact(request)
        except NotConnected as error:
            raise NoConnection(f"{self._about(request)}: {error}") from None
        except ReplyTimeout as error:
            raise NoReply(f"{self._about(request)}: {error}") from None
        except UnexpectedReply as error:
            raise BadReply(f"{self._about(request)}: {error}") from None
        if len(reply) == length and reply.startswith(head):
            return reply
        raise self._fault(request, reply)

    def _fault(self, request: bytes, reply: bytes) -> DriverError:
        """Return what a reply without the registers means; end the connection unless it is an exception."""
        code = exception_code(request, reply)
        if code is not None:
            return self._refused(request, code)
        self.close()
        return BadReply(f"{self._about(request)}: the reply does not fit: {reply.hex(' ')}")
