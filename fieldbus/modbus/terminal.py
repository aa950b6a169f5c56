"""A terminal as a serial line: raw bytes in the characters that the line has, for one process alone; by termios."""

import errno
import fcntl
import os
import termios
from typing import Any

from config.serial_port import SerialPort

PSEUDO_TERMINALS = range(136, 144)
"""Their major device numbers on Linux; they carry bytes and know no parity."""
_PARITY = {"none": 0, "even": termios.PARENB, "odd": termios.PARENB | termios.PARODD}
_SHAPE = termios.CSIZE | termios.PARENB | termios.PARODD | termios.CSTOPB


def opened_terminal(port: SerialPort) -> int:
    """Return the line, open for this process alone, with nothing in it of before.

    Raises:
        OSError: it is not there, not a serial line, not permitted, of another process, or not that fast.
    """
    fd = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        _configure(fd, port)
    except BaseException:
        os.close(fd)
        raise
    return fd


def _configure(fd: int, port: SerialPort) -> None:
    if not os.isatty(fd):
        raise OSError(errno.ENOTTY, "is not a serial line")
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OSError(errno.EBUSY, "is used by another process") from None
    wanted = _attributes(fd, port)
    try:
        termios.tcsetattr(fd, termios.TCSANOW, wanted)
        termios.tcflush(fd, termios.TCIOFLUSH)
        taken = termios.tcgetattr(fd)
    except termios.error as error:
        raise OSError(*error.args) from None
    if taken[4] != wanted[4] or (taken[2] ^ wanted[2]) & _SHAPE:
        raise OSError(errno.EINVAL, f"cannot do {port.baud} baud, parity {port.parity}, {port.stop_bits} stop bits")


def _attributes(fd: int, port: SerialPort) -> list[Any]:
    """Return the terminal's attributes: raw bytes in the port's characters."""
    speed = getattr(termios, f"B{port.baud}", None)
    if speed is None:
        raise OSError(errno.EINVAL, f"cannot do {port.baud} baud on this system")
    is_pseudo = os.major(os.fstat(fd).st_rdev) in PSEUDO_TERMINALS
    parity = 0 if is_pseudo else _PARITY[port.parity]
    stop = termios.CSTOPB if port.stop_bits == 2 else 0
    # CLOCAL and no HUPCL: modem lines neither hold us up nor reset the device when we let go.
    control: list[bytes | int] = [b"\0"] * len(termios.tcgetattr(fd)[6])
    control[termios.VMIN], control[termios.VTIME] = 1, 0
    cflag = termios.CS8 | termios.CREAD | termios.CLOCAL | parity | stop
    return [termios.INPCK if parity else 0, 0, cflag, 0, speed, speed, control]
