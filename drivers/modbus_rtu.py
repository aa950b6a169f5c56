"""A device on a serial line, on Modbus RTU.

A reply on a serial line does not say whose it is: one that comes after its time-out would be taken for the answer to
the next request, and every later one be shifted by one. So the line is closed after whatever is not one whole fitting
reply, and `open` first asks for an echo (function 8) of a number that changes each time. A device answers in order:
once that echo is back, or is refused as an unknown function, everything asked before has been answered or never will
be, however late it is. What comes before it is thrown away.

Some devices pass over function 8 without a word. One that was never reached and says nothing at all to it is asked by
two reads instead, of lengths drawn by lot: an answer to an earlier request would not fit both.
"""

import random
import time

from config.device import ModbusRtuDevice
from drivers.boundary import BadReply, DriverError, NoConnection, NoReply
from drivers.modbus_device import READ_COUNTS, ModbusDriver
from fieldbus.modbus.exception_codes import EXCEPTION
from fieldbus.modbus.rtu import ECHO, framed, is_whole
from fieldbus.modbus.serial_line import SerialLine

EXCEPTION_FRAME = 5  # bytes: unit, function, code, check sum
READS = (3, 4)
"""Functions whose reply is never the request itself."""
ROUND_FRAME = 3
"""Bytes of a frame round its PDU: unit and check sum."""


class ModbusRtuDriver(ModbusDriver):
    """Drives a device on Modbus RTU; the line is its own.

    Args:
        config: the line, how long the device may take, what its registers hold.
    """

    def __init__(self, config: ModbusRtuDevice) -> None:
        super().__init__(config, f"{config.serial.path} unit {config.unit}")
        self._unit = config.unit
        self._reply_timeout_s = config.reply_timeout_s
        self.line = SerialLine(config.serial)
        self._echoes = 0
        self._echoes_back: bool | None = None
        """Whether the device answers function 8; None until it has answered anything."""

    def close(self) -> None:
        """Close the line; the device keeps its last command until its own time-out."""
        self.line.close()

    def _connect(self) -> None:
        try:
            self.line.open()
            self._begin_connection()
            self._await_answers()
        except OSError as error:
            self.close()
            raise NoConnection(f"{self._who}: {error.strerror}") from None

    def _await_answers(self) -> None:
        """Make sure that no earlier request is still to be answered, by what the device answers."""
        if self._echoes_back is not False:
            heard = self._await_echo()
            if heard is None:
                self._echoes_back = True
                self._note_answer(ECHO[0])
                return
            if heard or self._echoes_back:
                raise self._silence(heard)
        self._await_reads()
        self._echoes_back = False

    def _await_echo(self) -> bytes | None:
        """Ask for the echo; return None when it is back or refused, else what was heard instead."""
        self._echoes = (self._echoes + 1) & 0xFFFF
        echo = framed(self._unit, ECHO + self._echoes.to_bytes(2))
        self._await_pause()
        refusal = bytes((self._unit, ECHO[0] | EXCEPTION))
        until_s = self.line.send(echo, self._reply_timeout_s) + self._reply_timeout_s
        heard = b""
        while data := self.line.receive(until_s):
            heard = (heard + data)[-2 * len(echo) :]
            last = heard[-EXCEPTION_FRAME:]
            if heard.endswith(echo) or (last.startswith(refusal) and is_whole(last)):
                return None
            if time.monotonic() > until_s:  # somebody who never stops must not keep us
                break
        return heard

    def _await_reads(self) -> None:
        """Do the same by reads that move nothing, of a device that does not know the echo."""
        for count in random.sample(READ_COUNTS, 2):
            request = self._position_read(count)
            function = request[0]
            frame = self._answered(framed(self._unit, request), function, 2 + 2 * count + ROUND_FRAME)
            head = bytes((self._unit, function, 2 * count)), bytes((self._unit, function | EXCEPTION))
            if not (frame.startswith(head) and is_whole(frame)):
                raise self._silence(frame)
            self._note_answer(function)

    def _silence(self, heard: bytes) -> NoConnection:
        said = f" (but {heard.hex(' ')})" if heard else ""
        return NoConnection(f"{self._who}: nobody answers within {1e3 * self._reply_timeout_s:g} ms{said}")

    def _transact(self, request: bytes, head: bytes, length: int) -> bytes:
        if not self.line.is_open:
            raise NoConnection(f"{self._about(request)}: the line is closed")
        try:
            frame = self._answered(framed(self._unit, request), request[0], length + ROUND_FRAME)
        except OSError as error:
            self.close()
            raise NoConnection(f"{self._about(request)}: {error.strerror}") from None
        if len(frame) == length + ROUND_FRAME and frame[1:].startswith(head) and self._is_ours(frame):
            return frame[1:-2]
        raise self._fault(request, frame)

    def _answered(self, frame: bytes, function: int, size: int) -> bytes:
        """Send a request; return what came before its time-out, as far as it can be the reply of that size."""
        self._await_pause()
        until_s = self.line.send(frame, self._reply_timeout_s) + self._reply_timeout_s
        reply = b""
        while len(reply) < size and (data := self.line.receive(until_s)):
            reply += data
            if len(reply) > 1 and reply[1] != function:
                size = EXCEPTION_FRAME
        return reply

    def _fault(self, request: bytes, frame: bytes) -> DriverError:
        """Return what a transaction that did not succeed means; close the line unless it can be trusted."""
        if len(frame) == EXCEPTION_FRAME and frame[1] == request[0] | EXCEPTION and self._is_ours(frame):
            return self._refused(request, frame[2])
        self.close()
        about = self._about(request)
        if not frame:
            said = f"no reply within {1e3 * self._reply_timeout_s:g} ms"
            return NoReply(f"{about}: {said}{self._cure_of_silence(request)}")
        if request[0] in READS and frame.startswith(framed(self._unit, request)):
            return BadReply(f"{about}: the line hands back what is sent: serial.local_echo = true")
        return BadReply(f"{about}: {self._mismatch(frame)}: {frame.hex(' ')}")

    def _is_ours(self, frame: bytes) -> bool:
        return frame[0] == self._unit and is_whole(frame)

    def _mismatch(self, frame: bytes) -> str:
        if not is_whole(frame):
            return "noise, or a broken reply"
        return "the reply does not fit" if frame[0] == self._unit else f"a reply of unit {frame[0]}"
