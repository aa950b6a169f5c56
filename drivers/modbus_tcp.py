"""A device on Modbus TCP, secured by TLS where its table says so.

A late reply is never taken for another's: after a time-out, or a reply that does not fit, the connection is closed.
A gateway to a serial line may hand out what the line said too late as the answer to the next request all the same, in
a frame that fits, on the next connection too: a position would be taken for the command that the device holds, and be
commanded. So `open` first asks for two reads of unlike lengths. Whoever is an answer behind gives the first one's
for the second.
"""

from contextlib import suppress
from itertools import cycle

from config.device import ModbusTcpDevice
from drivers.boundary import BadReply, DoubleReply, DriverError, NoConnection, NoReply, Reading, Refused
from drivers.modbus_device import READ_COUNTS, ModbusDriver
from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.client_errors import (
    ClientError,
    DuplicatedReply,
    NotConnected,
    OtherTransaction,
    OtherUnit,
    ReplyTimeout,
    SerialFrame,
    UnexpectedReply,
)
from fieldbus.modbus.exception_codes import exception_code
from fieldbus.modbus.framing import Framing, MbapFraming, SerialFraming


class ModbusTcpDriver(ModbusDriver):
    """Drives a device on Modbus TCP.

    Args:
        config: where the device is, how long it may take, what its registers hold.

    Raises:
        InputError: a file of `config.tls` that is not there or does not fit.
    """

    def __init__(self, config: ModbusTcpDevice) -> None:
        super().__init__(config, f"{config.host}:{config.port} unit {config.unit}")
        self._framing = config.framing
        self._asked = b""
        self._client = ModbusClient(
            config.host, config.port, config.unit, config.reply_timeout_s, config.tls, _framing(config)
        )
        self._other_counts = cycle(READ_COUNTS)
        """Lengths in turn: who is far behind would not fit for long."""

    def close(self) -> None:
        """Close the connection; the device keeps its last command until its own time-out."""
        self._client.close()

    def _connect(self) -> None:
        try:
            self._client.open()
        except NotConnected as error:
            raise NoConnection(f"{self._who}: {error}") from None
        self._begin_connection()
        self._require_answers_in_step()

    def _require_answers_in_step(self) -> None:
        """Make sure that what answers now answers what is asked now; moves nothing.

        The first read may reach beyond the device's registers and be refused; the second is of a value it has.
        """
        words = self._config.map.position_m.format.words
        with suppress(Refused):
            self._read_words(next(each for each in self._other_counts if each != words))
        self._read_words(words)

    def _read_words(self, count: int) -> None:
        request = self._position_read(count)
        self._answer(request, bytes((request[0], 2 * count)), 2 + 2 * count)

    def _transact(self, request: bytes, head: bytes, length: int) -> bytes:
        try:
            reply = self._client.transact(request)
        except ClientError as error:
            raise self._meaning(request, error) from None
        if len(reply) == length and reply.startswith(head):
            return reply
        raise self._fault(request, reply)

    @property
    def reply_timeout_s(self) -> float:
        """How long a reply may take."""
        return self._config.reply_timeout_s

    def ask(self, command_pa: float) -> int | None:
        """Command a pressure; return what is ready to be read when something comes back. None: `exchange` does it."""
        if not self._one_transaction or self._config.pause_s:
            return None
        self._asked = self._exchange_request(command_pa)
        return self._client.ask(self._asked)

    def answer(self, *, late: bool) -> Reading | None:
        """Return the measurement; None while the reply is not whole."""
        request, read = self._asked, self._reads[0]
        try:
            reply = self._client.answer(late=late)
        except ClientError as error:
            raise self._meaning(request, error) from None
        if reply is None:
            return None
        if len(reply) != read.length or not reply.startswith(read.head_after):
            raise self._fault(request, reply)
        return self._reading(read.values(reply[len(read.head_after) :]))

    def _meaning(self, request: bytes, error: ClientError) -> DriverError:
        match error:
            case NotConnected():
                return NoConnection(f"{self._about(request)}: {error}")
            case ReplyTimeout():
                return NoReply(f"{self._about(request)}: {error}{self._cure_of_silence(request)}")
            case DuplicatedReply():
                return DoubleReply(f"{self._about(request)}: {error}")
            case UnexpectedReply():
                return BadReply(f"{self._about(request)}: {error}{_cure(error)}")
        raise error

    def _for_nothing_answered(self) -> str:
        return '; frames of a serial line: device.framing = "rtu"' if self._framing == "mbap" else ""

    def _fault(self, request: bytes, reply: bytes) -> DriverError:
        """Return what a reply without the registers means; end the connection unless it is an exception."""
        code = exception_code(request, reply)
        if code is not None:
            return self._refused(request, code)
        self.close()
        return BadReply(f"{self._about(request)}: the reply does not fit: {reply.hex(' ')}")


def _framing(config: ModbusTcpDevice) -> Framing:
    if config.framing == "rtu":
        return SerialFraming(config.unit, config.reply_unit)
    return MbapFraming(config.unit, config.reply_unit, echoes_transaction=config.echoes_transaction)


def _cure(error: UnexpectedReply) -> str:
    """Say which key of `[device]` lets such replies be taken; nothing where none does."""
    match error:
        case OtherTransaction():
            key = "echoes_transaction = false"
        case OtherUnit():
            key = f"reply_unit = {error.came}"
        case SerialFrame():
            key = 'framing = "rtu"'
        case _:
            return ""
    return f" (if it always answers so: device.{key})"
