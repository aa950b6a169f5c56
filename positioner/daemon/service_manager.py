"""What the daemon tells systemd (`Type=notify`), over the datagram socket that NOTIFY_SOCKET names; else nothing.

    READY=1          it serves
    WATCHDOG=1       every cycle has turned since the last time: a loop that stands is killed and started anew
    STOPPING=1       it ends, and leaves the valves in their safe states

The watchdog's time is made longer where a loop turns seldom, so that a slow one is not taken for one that stands.
By sd_notify(3) and sd_watchdog_enabled(3).
"""

import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence

FEEDS = 4
"""Times that it is fed within the watchdog's time, if the cycles turn."""
LEAST_TURNS = 3
"""Turns of the slowest loop within it."""


class Turns:
    """Whether all loops have turned since they were last found to have, looked at so often; s."""

    def __init__(self, every_s: float) -> None:
        self.every_s = every_s
        self.found_s = 0.0
        self._counts: tuple[int, ...] = ()

    def all_have(self, counts: Sequence[int], now_s: float) -> bool:
        """Return whether it is time, and the count of each loop has changed."""
        if now_s - self.found_s < self.every_s:
            return False
        before = self._counts
        if len(counts) == len(before) and any(now == then for now, then in zip(counts, before, strict=True)):
            return False
        self._counts, self.found_s = tuple(counts), now_s
        return True


class ServiceManager:
    """The other end, if there is one.

    Args:
        environment: names the socket, the watchdog's time and whom it is for.
        now_s: a clock that is never set.
    """

    def __init__(
        self, environment: Mapping[str, str] = os.environ, now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._address = environment.get("NOTIFY_SOCKET", "")
        self._watchdog_s = _watchdog_s(environment) if self._address else 0.0
        self._now_s = now_s
        self._turns = Turns(self._watchdog_s / FEEDS)

    def ready(self, slowest_s: float, said: str) -> None:
        """Say that it serves, and how; its slowest loop takes so long for a cycle at the most."""
        lines = ["READY=1", f"STATUS={said}"]
        if 0.0 < self._watchdog_s < LEAST_TURNS * slowest_s:
            self._watchdog_s = LEAST_TURNS * slowest_s
            lines.append(f"WATCHDOG_USEC={round(self._watchdog_s * 1e6)}")
        self._turns.every_s, self._turns.found_s = self._watchdog_s / FEEDS, self._now_s()
        self._tell(lines)

    def feed(self, turns: Sequence[int]) -> None:
        """Feed the watchdog if it is time and each loop's count of turns has changed since the last time."""
        if self._watchdog_s and self._turns.all_have(turns, self._now_s()):
            self._tell(["WATCHDOG=1"])

    def stopping(self, reason: str) -> None:
        """Say that it ends, and why."""
        self._tell(["STOPPING=1", f"STATUS={reason}"])

    def _tell(self, lines: list[str]) -> None:
        if not self._address:
            return
        where = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to:
                to.setblocking(False)
                to.sendto("\n".join(" ".join(each.split("\n")) for each in lines).encode(), where)
        except OSError:
            return  # a manager that does not listen restarts the service, if that is its wish


def _watchdog_s(environment: Mapping[str, str]) -> float:
    """Return the watchdog's time; 0 where there is none, or it is another process's."""
    said, whose = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if not said.isdecimal() or (whose and whose != str(os.getpid())):
        return 0.0
    return int(said) * 1e-6
