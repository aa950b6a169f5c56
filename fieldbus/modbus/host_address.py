"""Where a host is: its name looked up beside the cycle, which waits for that no longer than for a reply.

A name server that does not answer keeps a look-up for seconds. It runs in a thread of its own; who needs the address
waits for a while and, if it has not come, takes the one found before or goes without.
"""

import socket
from concurrent.futures import Future
from concurrent.futures import TimeoutError as NotYet
from ipaddress import ip_address
from threading import Thread
from typing import Any

Addresses = list[tuple[Any, ...]]
"""As `socket.getaddrinfo` returns them."""


class HostAddress:
    """The address of a host and a port.

    Args:
        host: a name, or an address, which needs no look-up.
        port: its TCP port.
    """

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._is_name = not _is_address(host)
        self._pending: Future[Addresses] | None = None
        self._found: Addresses = []

    def within(self, timeout_s: float) -> Addresses:
        """Return the addresses; those found before where a new look-up takes longer than the time-out.

        Raises:
            socket.gaierror: the name is not known.
            TimeoutError: nobody has said so far what its address is.
        """
        if not self._is_name:
            return self._looked_up()
        pending = self._pending or self._started()
        try:
            found = pending.result(timeout_s)
        except NotYet:
            if self._found:
                return self._found
            raise TimeoutError(
                f"the address of {self._host} is not known within {1e3 * timeout_s:g} ms: is its name server there?"
            ) from None
        except Exception:
            self._pending = None
            raise
        self._pending, self._found = None, found
        return found

    def _started(self) -> "Future[Addresses]":
        pending: Future[Addresses] = Future()

        def look_up() -> None:
            try:
                pending.set_result(self._looked_up())
            except Exception as error:  # whatever it is, it is for who waits
                pending.set_exception(error)

        self._pending = pending
        Thread(target=look_up, name=f"address of {self._host}", daemon=True).start()
        return pending

    def _looked_up(self) -> Addresses:
        try:
            return list(socket.getaddrinfo(self._host, self._port, 0, socket.SOCK_STREAM))
        except UnicodeError:  # a label that is empty, or longer than any name server takes
            raise socket.gaierror(socket.EAI_NONAME, "can be no name of a host") from None


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def connected(addresses: Addresses, timeout_s: float) -> socket.socket:
    """Return a connection to the first of these addresses that accepts one.

    Raises:
        OSError: none does within the time-out.
    """
    error: OSError = OSError("no address")
    for family, kind, protocol, _, where in addresses:
        line = socket.socket(family, kind, protocol)
        line.settimeout(timeout_s)
        try:
            line.connect(where)
        except OSError as refused:
            line.close()
            error = refused
        else:
            return line
    raise error
