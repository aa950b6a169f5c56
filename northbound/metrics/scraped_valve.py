"""One valve's registers, read when Prometheus asks; the connection is kept from one scrape to the next."""

from collections.abc import Mapping
from threading import Lock

from config.errors import CommandFailed, InputError
from config.registers import BY_NAME
from config.tls_table import Tls
from positioner.dcs import Dcs

SCRAPE_WITHIN_S = 1.0


class ScrapedValve:
    """A valve by its name, and where its daemon serves it.

    Args:
        name: its label.
        where: host, port and unit.
        tls: an observer's certificate, where the daemon asks for one.
    """

    def __init__(self, name: str, where: tuple[str, int, int], tls: Tls | None = None) -> None:
        self.name = name
        self.problem = ""
        """Why the last reading failed; empty if it did not."""
        self._dcs = Dcs(*where, timeout_s=SCRAPE_WITHIN_S, tls=tls)
        self._open = False
        self._lock = Lock()

    def read(self) -> Mapping[str, float] | None:
        """Return all registers, None where the daemon does not answer. A connection that failed is tried anew, once."""
        with self._lock:
            for _ in range(1 + self._open):
                try:
                    if not self._open:
                        self._dcs.__enter__()
                        self._open = True
                    values = self._dcs.get_all(*BY_NAME)
                except (CommandFailed, InputError) as failed:
                    self.problem = str(failed)
                    self._hang_up()
                else:
                    self.problem = ""
                    return values
        return None

    def close(self) -> None:
        """Hang up."""
        with self._lock:
            self._hang_up()

    def _hang_up(self) -> None:
        self._dcs.__exit__(None, None, None)
        self._open = False
