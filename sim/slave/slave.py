"""A simulated slave on whichever bus its file names."""

from pathlib import Path
from typing import Protocol

from config.canopen_device import require_can
from config.slave_file import CanopenBus, load_slave


class Slave(Protocol):
    """A slave that listens."""

    address: str
    """Where; ends in `:` and its port or channel."""

    def catch_up(self) -> None:
        """Let the time pass that is due."""
        ...

    def stop(self) -> None:
        """Leave the bus."""
        ...


def slave_of(path: Path, port: int | None = None) -> Slave:
    """Return the slave of a file, listening.

    Args:
        path: the slave file.
        port: another TCP port, or channel of the loopback CAN bus, than the file's; 0 takes any free one.

    Raises:
        InputError: a fault in the slave file or its valve file, or the bus cannot be opened.
    """
    bus = load_slave(path).bus
    if isinstance(bus, CanopenBus):
        require_can(str(path), "bus.kind")
        from sim.slave.canopen_slave import CanopenSlave

        return CanopenSlave(path, port)
    from sim.slave.modbus_slave import ModbusSlave

    return ModbusSlave(path, port)
