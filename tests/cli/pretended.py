"""`python -m tests.cli.pretended SYSTEM COMMAND ...`: a command of positioner as on a system that lacks what Linux has.

Not pretended is what libraries ask for because they see Linux: numpy and ifaddr want os.uname, asyncio AF_UNIX; uvloop,
which there is not on Windows, is away.
"""

import ctypes
import os
import resource
import signal
import socket
import sys
import time
from typing import Any

WINDOWS_LACKS = ("fcntl", "termios", "resource", "pwd", "grp", "tty", "pty", "uvloop")
POSIX_SIGNALS = (
    *("SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGCHLD", "SIGCONT", "SIGTSTP", "SIGTTIN", "SIGTTOU"),
    *("SIGURG", "SIGWINCH", "SIGKILL", "SIGSTOP", "SIGPIPE", "SIGBUS"),
)
POSIX_CALLS = (
    *("fork", "geteuid", "getuid", "getloadavg", "mkfifo", "pread", "pwrite", "fchmod", "fchown", "chown"),
    *("openpty", "O_CLOEXEC", "O_NOCTTY", "O_NONBLOCK"),
)
LINUX_CALLS = (
    *("sched_setscheduler", "sched_getscheduler", "sched_getaffinity", "sched_setaffinity", "SCHED_FIFO"),
    *("sched_param", "posix_fadvise", "memfd_create", "eventfd", "pidfd_open"),
)


def without(module: Any, names: tuple[str, ...]) -> None:
    for name in names:
        if hasattr(module, name):
            delattr(module, name)


def as_windows() -> None:
    for name in WINDOWS_LACKS:
        sys.modules[name] = None  # type: ignore[assignment]
    without(signal, POSIX_SIGNALS)
    without(os, POSIX_CALLS + LINUX_CALLS)
    without(socket, ("SOCK_CLOEXEC",))
    without(time, ("CLOCK_BOOTTIME",))


def as_macos() -> None:
    class Libc(ctypes.CDLL):
        def __getattr__(self, name: str) -> Any:
            if name == "prctl":
                raise AttributeError(f"dlsym(RTLD_DEFAULT, {name}): symbol not found")
            return super().__getattr__(name)

    ctypes.CDLL = Libc  # type: ignore[misc]
    without(os, LINUX_CALLS)
    without(resource, ("RLIMIT_RTPRIO", "prlimit"))
    without(socket, ("SOCK_CLOEXEC", "AF_CAN", "PF_CAN"))
    without(time, ("CLOCK_BOOTTIME",))


if __name__ == "__main__":
    {"windows": as_windows, "macos": as_macos}[sys.argv[1]]()
    from positioner.cli.main import main

    sys.exit(main(sys.argv[2:]))
