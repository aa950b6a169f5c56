"""A serial line as Modbus RTU needs it, for both towers: raw bytes, deadlines, and silence before each frame.

Times are of the monotonic clock. A line belongs to one process at a time (an advisory lock) and to one thread of it,
where several devices on it take turns.
"""

import errno
import os
import select
import time
from dataclasses import dataclass

from config.serial_port import SerialPort
from fieldbus.modbus.rtu import LARGEST_FRAME

CHUNK = 4 * LARGEST_FRAME


class NotEchoed(OSError):
    """What is sent does not come back, on a line that is said to echo."""

    def __init__(self) -> None:
        super().__init__(errno.EIO, "the line does not hand back what is sent: serial.local_echo = false")


class NeverSilent(OSError):
    """Somebody keeps sending, so no frame can begin."""

    def __init__(self) -> None:
        super().__init__(errno.EBUSY, "the line is never silent")


@dataclass(slots=True)
class _OpenLine:
    """A line that this process has open, once for all who use it."""

    fd: int
    users: int
    active_s: float
    """When the last character was on it, as far as known."""
    behind_echo: bytes = b""
    """What came with the end of an echo."""


_OPEN_LINES: dict[str, _OpenLine] = {}
"""By the real path of the line."""


class SerialLine:
    """A serial line, closed until `open`.

    Args:
        port: where it is and how its characters look.
    """

    def __init__(self, port: SerialPort) -> None:
        self.port = port
        self._real = ""
        self._taken: _OpenLine | None = None

    @property
    def is_open(self) -> bool:
        """Whether frames can be sent."""
        return self._taken is not None

    def open(self) -> None:
        """Take the line (anew).

        Raises:
            OSError: it is not there, not a serial line, not permitted, of another process, or not that fast.
        """
        self.close()
        self._real = os.path.realpath(self.port.path)
        taken = _OPEN_LINES.get(self._real)
        if taken is None:
            taken = _OPEN_LINES[self._real] = _OpenLine(_opened(self.port), 0, time.monotonic())
        taken.users += 1
        self._taken = taken

    def close(self) -> None:
        """Let go of the line. Never raises."""
        taken, self._taken = self._taken, None
        if taken is None:
            return
        taken.users -= 1
        if taken.users == 0:
            del _OPEN_LINES[self._real]
            os.close(taken.fd)

    def send(self, frame: bytes, within_s: float) -> float:
        """Send a frame once the line has been silent for long enough; return when its last character will be out, s.

        What arrives before that nobody has asked for: it is thrown away, and the silence begins anew. A local echo is
        waited for and taken away.

        Raises:
            NeverSilent: no silence came within `within_s`.
            NotEchoed: what came within `within_s` was no echo.
            OSError: the line is gone, or takes nothing.
        """
        taken = self._open_line()
        give_up_s = time.monotonic() + within_s
        while True:
            free_s = taken.active_s + self.port.silence_s
            now_s = time.monotonic()
            if now_s < free_s:
                time.sleep(free_s - now_s)
            if not self.receive(0.0):
                break
            if now_s > give_up_s:
                raise NeverSilent
        if os.write(taken.fd, frame) != len(frame):
            raise OSError(errno.EIO, "the line takes no more")
        out_s = taken.active_s = time.monotonic() + len(frame) * self.port.character_s
        if self.port.local_echo:
            taken.behind_echo = self._behind_echo(frame, out_s + within_s)
        return out_s

    def _behind_echo(self, frame: bytes, until_s: float) -> bytes:
        heard = b""
        while len(heard) < len(frame):
            more = self.receive(until_s)
            heard += more
            if not more or not frame.startswith(heard[: len(frame)]):
                raise NotEchoed
        return heard[len(frame) :]

    def receive(self, until_s: float) -> bytes:
        """Return what has arrived, waiting for something until a time; b"" when that passes.

        Raises:
            OSError: the line is gone.
        """
        taken = self._open_line()
        if behind := taken.behind_echo:
            taken.behind_echo = b""
            return behind
        ready, _, _ = select.select((taken.fd,), (), (), max(0.0, until_s - time.monotonic()))
        if not ready:
            return b""
        data = os.read(taken.fd, CHUNK)
        if not data:
            raise OSError(errno.EIO, "the line hung up")
        taken.active_s = time.monotonic()
        return data

    def _open_line(self) -> _OpenLine:
        if self._taken is None:
            raise OSError(errno.EBADF, "the line is closed")
        return self._taken


def _opened(port: SerialPort) -> int:
    """Return the line, open; raises as `SerialLine.open`."""
    try:
        from fieldbus.modbus.terminal import opened_terminal
    except ImportError:
        raise OSError(errno.ENOSYS, "serial lines need termios, which this system has not") from None
    return opened_terminal(port)
