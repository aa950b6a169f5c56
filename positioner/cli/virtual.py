"""A daemon's cycle on a simulated device, in one process and virtual time: for `play` and `reproduce`.

The cycle, the link and the controller are the daemon's own; only the driver is the in-memory one, and the pace is
the device's clock. The device is as a slave file describes it, so a slave on a bus behaves the same.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

from config.daemon import DaemonFile
from config.slave import SlaveFile
from drivers.memory import MemoryDriver
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.daemon.snapshot import Snapshot
from sim.slave.modbus import device_of

Script = Callable[[Snapshot, Requests], Requests]
"""A DCS: what it asks for after a snapshot, given what it asked for before."""


def virtual_cycle(daemon: DaemonFile, slave: SlaveFile, valve: Path, requests: Requests) -> Cycle:
    """Return a cycle that commands the simulated device of a slave file.

    Raises:
        InputError: a fault in the valve file.
    """
    pace = DevicePace()
    link = Link(MemoryDriver(device_of(slave, valve)), pace)
    held_pa, _ = link.open()
    return Cycle(link, Controller(Settings.of(daemon), held_pa), pace, requests, recorder=None)


def played(cycle: Cycle, script: Script, until_s: float) -> Iterator[Snapshot]:
    """Yield the snapshot of every cycle up to a time of the device, s, the script playing the DCS between them."""
    yield cycle.snapshot
    while cycle.snapshot.sample.time_s < until_s:
        cycle.requests = script(cycle.snapshot, cycle.requests)
        cycle.once()
        yield cycle.snapshot
