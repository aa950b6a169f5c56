"""What is wrong with a wire: a kind of fault, for so many replies or requests.

drop        the reply is lost              duplicate   it comes twice
lose        the request is lost            reorder     it comes after that of the next request
delay       it comes after the time-out    truncate    its end is missing
disconnect  the connection ends            corrupt     a bit of it is wrong
"""

from threading import Lock
from time import sleep

WIRE_FAULTS = ("drop", "lose", "delay", "duplicate", "reorder", "truncate", "corrupt", "disconnect")


class Spoiler:
    """A kind, for so many replies (or requests) from now on; a delayed reply comes late_s later."""

    def __init__(self, late_s: float) -> None:
        self.late_s = late_s
        self.kind = ""
        self.left = 0
        self._kept: list[bytes] = []
        self._lock = Lock()

    def begin(self, kind: str, count: int) -> None:
        """Spoil that many."""
        with self._lock:
            self.kind, self.left = kind, count

    def forget(self) -> None:
        """Keep nothing back any more: the connection is another."""
        self._kept = []

    def takes_request(self) -> bool:
        """Return whether a request gets lost."""
        return self.kind == "lose" and self._spend()

    def replies(self, reply: bytes) -> list[bytes]:
        """Return what comes in place of a reply.

        Raises:
            ConnectionResetError: the connection ends.
        """
        if self._kept:
            late, self._kept = self._kept, []
            return [reply, *late]
        if self.kind in ("", "lose") or not self._spend():
            return [reply]
        if self.kind == "disconnect":
            raise ConnectionResetError
        if self.kind == "delay":
            sleep(self.late_s)
        if self.kind == "reorder":
            self._kept = [reply]
        wrong = reply[:1] + bytes((reply[1] ^ 0x40,)) + reply[2:]
        instead = {"duplicate": [reply, reply], "delay": [reply], "truncate": [reply[: len(reply) // 2]]}
        return {**instead, "corrupt": [wrong]}.get(self.kind, [])

    def _spend(self) -> bool:
        with self._lock:
            spent = self.left > 0
            self.left -= spent
            return spent
