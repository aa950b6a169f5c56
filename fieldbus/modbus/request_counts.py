"""How many requests a server got, by who asked: a role of Modbus/TCP Security, or anybody in the clear."""

from collections.abc import Mapping
from threading import Lock

from config.registers import REQUESTERS
from config.roles import Role


class RequestCounts:
    """Counted by the server's threads, read by others."""

    def __init__(self) -> None:
        self._counts = dict.fromkeys(REQUESTERS, 0)
        self._lock = Lock()

    def enter(self, role: Role | None) -> None:
        """Count a request of a role; None is in the clear."""
        self._count("plain" if role is None else role.name.lower())

    def refuse(self) -> None:
        """Count a request that a role may not make."""
        self._count("refused")

    def of(self, requester: str) -> int:
        """Return how many there were of one of `REQUESTERS`."""
        return self._counts[requester]

    @property
    def all(self) -> dict[str, int]:
        """All of them."""
        return dict(self._counts)

    def take(self, counts: Mapping[str, int]) -> None:
        """Have those that another process has counted."""
        self._counts.update(counts)

    def _count(self, requester: str) -> None:
        with self._lock:
            self._counts[requester] += 1
