"""Back-off: when to try again what failed, and what to say of it.

A device is asked for again at once, for a reply may be lost; then ever more seldom. A kind of failure is said once and
then counted, and so are the lines that one host causes beyond a few a second.
"""

import math
from collections.abc import Hashable

from fieldbus.modbus.admission import Allowance

AT_ONCE = 4
"""Failures before the first wait: a reply that was lost, and three attempts."""
FIRST_S, LONGEST_S = 0.01, 1.0
MOST = AT_ONCE + 8
"""Failures that are remembered: then the wait is the longest."""
MAKE_UP = 2
"""Successes that make up for a failure: a line that loses a reply now and then is no device that is away."""


class Backoff:
    """Of one thing that is tried: `may_try`, then `failed` or `succeeded`. Times are of any clock, s."""

    def __init__(self) -> None:
        self._failures = 0.0
        self._next_s = -math.inf

    def may_try(self, now_s: float) -> bool:
        """Return whether it is time to try."""
        return now_s >= self._next_s

    def failed(self, now_s: float) -> None:
        """Note a failure: the next attempt waits, for twice as long each time."""
        self._failures = min(self._failures + 1.0, MOST)
        beyond = math.ceil(self._failures - AT_ONCE)
        if beyond > 0:
            self._next_s = now_s + min(FIRST_S * 2.0 ** (beyond - 1), LONGEST_S)

    def succeeded(self) -> None:
        """Note a success: who answers is not away, however long it was."""
        self._failures = max(0.0, min(self._failures, AT_ONCE) - 1.0 / MAKE_UP)


class Sayings:
    """What was said already, by its kind: each is said once in `every_s`, with how often it was not said before."""

    MOST_KINDS = 256

    def __init__(self, every_s: float = 60.0) -> None:
        self._every_s = every_s
        self._said: dict[Hashable, tuple[float, int]] = {}

    def unsaid(self, kind: Hashable, now_s: float) -> int | None:
        """Return how many of this kind were passed over since the last that was said; None to pass over this one."""
        said_s, passed = self._said.get(kind, (-math.inf, 0))
        if now_s - said_s < self._every_s:
            self._said[kind] = said_s, passed + 1
            return None
        if kind not in self._said and len(self._said) >= self.MOST_KINDS:
            self._said.pop(next(iter(self._said)))
        self._said[kind] = now_s, 0
        return passed


class LinesPerPeer:
    """The lines that each host may cause: so many at once, then so many a second; the others are counted."""

    AT_ONCE, PER_S, MOST_HOSTS = 100, 2.0, 256

    def __init__(self) -> None:
        self._hosts: dict[str, tuple[Allowance, int]] = {}

    def unsaid(self, peer: str, now_s: float) -> int | None:
        """Return how many lines of a peer's host were passed over since the last; None to pass over this one.

        Args:
            peer: `host:port`, or `name (role) at host:port`.
            now_s: of any clock.
        """
        host = peer.rpartition(" at ")[2].rpartition(":")[0]
        if host not in self._hosts and len(self._hosts) >= self.MOST_HOSTS:
            self._hosts.pop(next(iter(self._hosts)))
        allowance, passed = self._hosts.get(host) or (Allowance(self.PER_S, self.AT_ONCE), 0)
        may = allowance.may(now_s)
        self._hosts[host] = allowance, 0 if may else passed + 1
        return passed if may else None
