"""Back-off: when to try again what failed, and what to say of it.

A device is asked for again at once, for a reply may be lost; then ever more seldom. An attempt on a line that others
need too keeps them waiting: there the first wait is so long that attempts take a small share of the line's time. A kind
of failure is said once and then counted, and so are the lines that one host causes beyond a few a second.

    wait_n = min(w 2^(n - 1), w_max)      n failures that are waited after, w_max by the file
    w      = 10 ms; on a line that is shared (1 / s - 1) T, T what the attempt took, s the share of the line's time
"""

import math
from collections.abc import Hashable
from threading import Semaphore

from fieldbus.modbus.admission import Allowance

AT_ONCE = 4
"""Failures before the first wait: a reply that was lost, and three attempts."""
FIRST_S = 0.01
RETRY_TIME_SHARE = 0.1
"""Of the time of a line that is shared, which attempts may take at the most."""
MOST_DOUBLINGS = 30
"""Failures beyond are not counted: every wait is the longest by then."""
MAKE_UP = 2
"""Successes that make up for a failure: a line that loses a reply now and then is no device that is away."""
AT_A_TIME = 4
"""Devices that one process connects to at a time; the others' turn comes with a later cycle. Many valves that begin, or
are back, together ask some ten things each: a gateway that answers one after another is later than its time-out, and is
asked anew."""


class Backoff:
    """Of one thing that is tried: `may_try`, then `failed` or `succeeded`. Times are of any clock, s.

    Args:
        longest_s: between two attempts, in the end.
        shared: whether an attempt keeps others waiting.
    """

    def __init__(self, longest_s: float = 1.0, *, shared: bool = False) -> None:
        self._longest_s = longest_s
        self._shared = shared
        self._at_once = 0 if shared else AT_ONCE
        self._failures = 0.0
        self._next_s = -math.inf

    def may_try(self, now_s: float) -> bool:
        """Return whether it is time to try."""
        return now_s >= self._next_s

    def failed(self, now_s: float, took_s: float = 0.0) -> None:
        """Note a failure, and how long the attempt took: the next one waits, for twice as long each time."""
        self._failures = min(self._failures + 1.0, self._at_once + MOST_DOUBLINGS)
        beyond = math.ceil(self._failures - self._at_once)
        if beyond > 0:
            first_s = max(FIRST_S, (1.0 / RETRY_TIME_SHARE - 1.0) * took_s) if self._shared else FIRST_S
            self._next_s = now_s + min(first_s * 2.0 ** (beyond - 1), self._longest_s)

    def succeeded(self) -> None:
        """Note a success: who answers is not away, however long it was."""
        self._failures = max(0.0, min(self._failures, self._at_once) - 1.0 / MAKE_UP)


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


class Doors:
    """What devices are connected to through, so many at a time: those that are away, and those that just lost a reply.

    Who waits behind those that are away is soon away, too: one lost reply would be a fault where other devices are.
    """

    def __init__(self, at_a_time: int = AT_A_TIME) -> None:
        self.away, self.lost_a_reply = Semaphore(at_a_time), Semaphore(at_a_time)


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
