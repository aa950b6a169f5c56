"""Who gets a place at a server, and how often each host may ask. No socket and no clock: times come in.

    `allowed_networks`           whoever calls from elsewhere gets none, nor a handshake; empty: from anywhere
    a host has at most `clients_per_host` places; of its own, one unused for `UNUSED_S` gives way
    all `most_clients` taken     the one that has asked for nothing for longest gives way, if for `UNUSED_S` at least;
                                 to a reserved host in any case, unless all are of reserved hosts
    requests                     a token bucket a host: `BURST_S` of its rate at once, then so many. A reserved host has
                                 `requests_per_s`; the others that are connected share as many evenly

What answers cost the process is thereby bounded, however many hosts ask without end.

Where handshakes come before a place, only so many may be under way: they take nobody's place.
"""

from dataclasses import dataclass
from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address
from threading import Lock

Network = IPv4Network | IPv6Network

MOST_CLIENTS = 64  # a DCS, pages and metrics need less than ten
UNUSED_S = 60.0
MOST_HANDSHAKES, HANDSHAKES_PER_HOST = 128, 32  # twice the clients: each may come back while it is missed
BURST_S = 0.2
MOST_HOSTS = 256
"""Whose requests are counted; beyond, the one counted for longest is forgotten."""


@dataclass(frozen=True, slots=True)
class ServerLimits:
    """What a server grants; by default as many places to one host as there are, and as many requests as come."""

    most_clients: int = MOST_CLIENTS
    clients_per_host: int = MOST_CLIENTS
    reserved_hosts: frozenset[str] = frozenset()
    requests_per_s: float = 0.0
    """Of each reserved host, and of all others together; 0: no limit."""
    idle_s: float = 0.0
    """A client that asks for nothing for so long is disconnected; 0 is never."""
    allowed_networks: tuple[Network, ...] = ()
    """Whence clients may come; empty: from anywhere."""

    def allow(self, host: str) -> bool:
        """Return whether a client may come from an address."""
        if not self.allowed_networks:
            return True
        address = ip_address(host.partition("%")[0])
        if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
            address = address.ipv4_mapped
        return any(address in each for each in self.allowed_networks)


NOT_ALLOWED = "its address is not among those allowed"


class Allowance:
    """A token bucket: so many at once, then so many a second.

    Args:
        per_s: how many a second.
        burst: how many at once.
    """

    def __init__(self, per_s: float, burst: float) -> None:
        self._per_s, self._burst = per_s, burst
        self._left, self._at_s = burst, 0.0

    def change(self, per_s: float, burst: float) -> None:
        """Grant at another rate from now on; what is left of a longer burst is gone."""
        self._per_s, self._burst, self._left = per_s, burst, min(self._left, burst)

    def wait_s(self, now_s: float) -> float:
        """Take one; return how long to wait for it."""
        self._refill(now_s)
        self._left -= 1.0
        return max(0.0, -self._left / self._per_s)

    def may(self, now_s: float) -> bool:
        """Take one if there is one; return whether."""
        self._refill(now_s)
        granted = self._left >= 1.0
        self._left -= granted
        return granted

    def _refill(self, now_s: float) -> None:
        self._left = min(self._burst, self._left + max(0.0, now_s - self._at_s) * self._per_s)
        self._at_s = max(now_s, self._at_s)


@dataclass(slots=True)
class _Place:
    host: str
    used_s: float


@dataclass(frozen=True, slots=True)
class Admitted:
    """What becomes of a client that wants a place: refused for a reason, or let in; `gone` gives way to it."""

    refusal: str | None = None
    gone: str | None = None
    unused_s: float = 0.0
    """For how long `gone` had asked for nothing."""


class Places:
    """The places of a server, by the clients' `host:port`. Called by several threads."""

    def __init__(self, limits: ServerLimits) -> None:
        self._limits = limits
        self._lock = Lock()
        self._taken: dict[str, _Place] = {}
        self._knocking: dict[str, str] = {}
        self._allowances: dict[str, Allowance] = {}

    def knock(self, peer: str, host: str) -> str | None:
        """Begin a handshake; return why it may not, None if it may."""
        if not self._limits.allow(host):
            return NOT_ALLOWED
        with self._lock:
            same = sum(each == host for each in self._knocking.values())
            if same >= HANDSHAKES_PER_HOST or len(self._knocking) >= MOST_HANDSHAKES:
                return f"{same} of its host's handshakes, {len(self._knocking)} in all, are under way"
            self._knocking[peer] = host
            return None

    def take(self, peer: str, host: str, now_s: float) -> Admitted:
        """Give a client a place, if there is one for it."""
        if not self._limits.allow(host):
            return Admitted(NOT_ALLOWED)
        with self._lock:
            self._knocking.pop(peer, None)
            own = [each for each, place in self._taken.items() if place.host == host]
            gone, unused_s = None, 0.0
            if len(own) >= self._limits.clients_per_host:
                gone = self._idlest(own, now_s, UNUSED_S)
                if gone is None:
                    return Admitted(f"{len(own)} clients of its host are connected already")
            elif len(self._taken) >= self._limits.most_clients:
                gone = self._that_gives_way(host, now_s)
                if gone is None:
                    return Admitted(f"{len(self._taken)} clients are connected already")
            if gone is not None:
                unused_s = now_s - self._taken.pop(gone).used_s
            self._taken[peer] = _Place(host, now_s)
            return Admitted(None, gone, unused_s)

    def leave(self, peer: str) -> None:
        """Free a place, or end a handshake."""
        with self._lock:
            self._taken.pop(peer, None)
            self._knocking.pop(peer, None)

    def use(self, peer: str, now_s: float) -> float:
        """Note a request; return how long it must wait, s."""
        with self._lock:
            place = self._taken.get(peer)
            if place is None:
                return 0.0
            place.used_s = now_s
            if self._limits.requests_per_s == 0:
                return 0.0
            return self._allowance(place.host).wait_s(now_s)

    def _allowance(self, host: str) -> Allowance:
        """Return a host's, at the rate that it has among those connected now."""
        per_s = self._limits.requests_per_s
        if host not in self._limits.reserved_hosts:
            per_s /= len({place.host for place in self._taken.values()} - self._limits.reserved_hosts)
        burst = max(1.0, BURST_S * per_s)
        if host not in self._allowances:
            if len(self._allowances) >= MOST_HOSTS:
                self._allowances.pop(next(iter(self._allowances)))
            self._allowances[host] = Allowance(per_s, burst)
        self._allowances[host].change(per_s, burst)
        return self._allowances[host]

    def _that_gives_way(self, host: str, now_s: float) -> str | None:
        reserved = self._limits.reserved_hosts
        ordinary = [peer for peer, place in self._taken.items() if place.host not in reserved]
        unused = self._idlest(list(self._taken), now_s, UNUSED_S)
        return self._idlest(ordinary, now_s, 0.0) if unused is None and host in reserved else unused

    def _idlest(self, peers: list[str], now_s: float, least_s: float) -> str | None:
        """Return the one that has asked for nothing for longest, if for so long at least."""
        idlest = min(peers, key=lambda peer: self._taken[peer].used_s, default=None)
        return idlest if idlest is not None and now_s - self._taken[idlest].used_s >= least_s else None
