"""A Modbus RTU server on a serial line, of the same registers as the one on TCP.

A frame ends with the silence that parts frames, which is the turnaround too: the answer leaves when it is over. A
frame that is not whole, or of another unit, is passed over in silence; one to all units (0) is obeyed without an
answer.
"""

import logging
import time
from threading import Event, Thread

from config.errors import explain_failure
from config.serial_port import SerialPort
from fieldbus.modbus.function_codes import RegisterAnswers, Registers
from fieldbus.modbus.rtu import BROADCAST, ECHO, LARGEST_FRAME, framed, is_whole
from fieldbus.modbus.serial_line import SerialLine

log = logging.getLogger(__name__)

LINE_LOOK_EVERY_S = 0.05
"""How often an idle server looks whether it is to stop."""
AGAIN_AFTER_S = 0.2
"""How long a server waits for a line that is gone."""


class RtuServer(RegisterAnswers):
    """Serves registers on Modbus RTU from `start` to `stop`.

    Args:
        registers: what is served.
        port: the serial line.
        unit: the server's own unit number.
    """

    def __init__(self, registers: Registers, port: SerialPort, unit: int) -> None:
        super().__init__(registers)
        self.address = port.path
        self._silence_s = port.silence_s
        self._unit = unit
        self.line = SerialLine(port)
        self._ended = Event()
        self._thread = Thread(target=self._work, daemon=True, name="modbus rtu")

    def start(self) -> None:
        """Listen, and answer from a thread of its own.

        Raises:
            InputError: the line cannot be opened.
        """
        with explain_failure(self.address, "cannot listen there"):
            self.line.open()
        self._thread.start()

    def stop(self) -> None:
        """Let go of the line."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self.line.close()

    def _work(self) -> None:
        while not self._ended.is_set():
            try:
                if not self.line.is_open:
                    self.line.open()
                    log.warning("%s: the line is back", self.address)
                self.serve(self._frame())
            except OSError as error:
                if self.line.is_open:
                    log.warning("%s: %s", self.address, error.strerror)
                self.line.close()
                self._ended.wait(AGAIN_AFTER_S)

    def _frame(self) -> bytes:
        """Return what came up to the next silence; b"" when nothing does for a while."""
        frame = self.line.receive(time.monotonic() + LINE_LOOK_EVERY_S)
        while data := self.line.receive(time.monotonic() + self._silence_s):
            frame = (frame + data)[: LARGEST_FRAME + 1]  # longer is none
        return frame

    def serve(self, frame: bytes) -> None:
        """Answer a frame; what is none, or is for another unit, is passed over."""
        if not frame:
            return
        if not is_whole(frame):
            log.debug("%s: noise: %s", self.address, frame.hex(" "))
            return
        unit, pdu = frame[0], frame[1:-2]
        if unit not in (self._unit, BROADCAST):
            return
        is_echo = pdu.startswith(ECHO)
        reply = pdu if is_echo else self.answer(pdu, self.address)
        if unit != BROADCAST:
            self.line.send(framed(unit, reply), self._silence_s)
