"""The local switch: who stands before the gateway locks out whoever writes from afar.

A file, as a key switch at an input of the gateway or a person there makes it: it is there, and does not begin with 0,
while writes are locked out. One that cannot be read locks out, too. Heartbeats are let in: the lock is no fault.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

from pymodbus.constants import ExcCodes

from positioner.daemon.experiment_registers import WriteRejected

LET_IN = frozenset({"heartbeat"})


def locks_out(switch: Path | None) -> Callable[[], bool]:
    """Return what says whether a switch locks out now; one that is not given never does."""
    return (lambda: False) if switch is None else lambda: _is_on(switch)


def require_let_in(names: Iterable[str], locked: Callable[[], bool]) -> None:
    """Let in a write of these registers.

    Raises:
        WriteRejected: the switch locks it out.
    """
    if set(names) - LET_IN and locked():
        raise WriteRejected("writes are locked out by the local switch", ExcCodes.DEVICE_BUSY)


def _is_on(switch: Path) -> bool:
    try:
        with switch.open("rb") as file:
            return file.read(1) != b"0"
    except FileNotFoundError:
        return False
    except OSError:
        return True
