"""What a Modbus request for 16-bit registers means, whatever frame it travels in.

    function                  count        refused, and nothing changed
    3, 4   read               1 to 125     1 other functions
    6      write one                       2 an address outside the map, read-only, or half a value
    16     write several      1 to 123     3 a count, a length or a value that is not allowed
    23     write, then read   1 to 121,    4 a fault of the server itself (logged)
                              1 to 125     6 a value that cannot be taken now

pymodbus decodes the requests and encodes the short replies; what its classes let pass is checked here: data shorter or
longer than a request says, the counts of functions 16 and 23, and function 23's read before its write. Replies that
carry registers are packed at once, since they are made in the interpreter that runs the cycle (`benchmarks.pdu`).

Source: MODBUS Application Protocol Specification V1.1b3, sections 6.3, 6.4, 6.6, 6.12, 6.17 and 7.
"""

import logging
import struct
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any, Literal, Protocol

from pymodbus.constants import ExcCodes
from pymodbus.pdu import ModbusPDU
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    ReadWriteMultipleRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from fieldbus.modbus.exception_codes import exception_reply

log = logging.getLogger(__name__)

Table = Literal["holding", "input"]
MOST_WRITTEN = 123
"""Registers in a request of function 16, which pymodbus does not check."""

REQUESTS: dict[int, type[ModbusPDU]] = {
    request.function_code: request
    for request in (
        ReadHoldingRegistersRequest,
        ReadInputRegistersRequest,
        WriteSingleRegisterRequest,
        WriteMultipleRegistersRequest,
        ReadWriteMultipleRegistersRequest,
    )
}
"""The requests that are served, by function code."""


class RegisterError(Exception):
    """A request that the registers refuse."""

    def __init__(self, code: ExcCodes) -> None:
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
    """Answers requests. One at a time holds the lock: it is all or nothing, and what it reads is of one moment.

    Args:
        registers: what is served.
    """

    def __init__(self, registers: Registers) -> None:
        self.lock = Lock()
        """Held while a request is answered; hold it to change the registers from outside. Each unit has its own."""
        self.registers = registers
        self._functions: dict[int, Callable[[Any, str], bytes]] = {
            3: self._read,
            4: self._read,
            6: self._write_one,
            16: self._write,
            23: self._write_then_read,
        }

    def answer(self, pdu: bytes, peer: str) -> bytes:
        """Return the PDU that answers one of at least one byte. Never raises."""
        function = pdu[0]
        try:
            request = decoded(pdu)
            with self.lock:
                return self._functions[function](request, peer)
        except RegisterError as refusal:
            code = refusal.code
        except Exception:
            log.exception("request %s of %s failed", pdu.hex(), peer)
            code = ExcCodes.DEVICE_FAILURE
        return exception_reply(function, code)

    def _read(self, request: ReadHoldingRegistersRequest, _peer: str) -> bytes:
        function = request.function_code
        return self._words(function, "holding" if function == 3 else "input", request.address, request.count)

    def _write_one(self, request: WriteSingleRegisterRequest, peer: str) -> bytes:
        self.registers.write(request.address, request.registers, peer)
        return struct.pack(">BHH", request.function_code, request.address, *request.registers)

    def _write(self, request: WriteMultipleRegistersRequest, peer: str) -> bytes:
        self.registers.write(request.address, request.registers, peer)
        return struct.pack(">BHH", request.function_code, request.address, request.count)

    def _write_then_read(self, request: ReadWriteMultipleRegistersRequest, peer: str) -> bytes:
        # The write comes first; but a read that would be refused must refuse the write with it.
        self.registers.read("holding", request.read_address, request.read_count)
        self.registers.write(request.write_address, request.write_registers, peer)
        return self._words(request.function_code, "holding", request.read_address, request.read_count)

    def _words(self, function: int, table: Table, address: int, count: int) -> bytes:
        words = self.registers.read(table, address, count)
        return struct.pack(f">BB{count}H", function, 2 * count, *words)


def decoded(pdu: bytes) -> ModbusPDU:
    """Return a request, whose counts and length fit each other and the protocol.

    Raises:
        RegisterError: ILLEGAL_FUNCTION, not served; ILLEGAL_VALUE, a count or a length that is not allowed.
    """
    kind = REQUESTS.get(pdu[0])
    if kind is None:
        raise RegisterError(ExcCodes.ILLEGAL_FUNCTION)
    request = kind()
    try:
        request.decode(pdu[1:])
    except (struct.error, ValueError):
        raise RegisterError(ExcCodes.ILLEGAL_VALUE) from None
    if not _fits(request, len(pdu)):
        raise RegisterError(ExcCodes.ILLEGAL_VALUE)
    return request


def _fits(request: ModbusPDU, size: int) -> bool:
    """Return whether a request's counts are allowed and agree with its size in bytes."""
    if isinstance(request, ReadWriteMultipleRegistersRequest):
        count = request.write_count
        return 1 <= count <= request.MAX_WRITE_COUNT and request.write_byte_count == 2 * count == size - 10
    if isinstance(request, WriteMultipleRegistersRequest):
        count = request.count
        return 1 <= count <= MOST_WRITTEN and request.byte_count == 2 * count == size - 6
    return size == 5
