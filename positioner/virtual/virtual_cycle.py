"""A daemon's cycle on a simulated device, in one process and virtual time, as `play` runs it.

The cycle, the link and the controller are the daemon's own; only the driver is the in-memory one, and the pace is
the device's clock. The device is the one that the slaves on a bus serve, so they behave the same.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

from config.daemon_file import DaemonFile
from drivers.boundary import Driver
from drivers.in_memory import MemoryDriver, Plant
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.cycle import Cycle
from positioner.daemon.health import Health, HealthSettings
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.pacing import DevicePace
from positioner.daemon.snapshot import Snapshot
from positioner.estimation.refiner import InProcessRefiner

Script = Callable[[Snapshot, Requests], Requests]
"""A DCS: what it asks for after a snapshot, given what it asked for before."""


def virtual_cycle(
    daemon: DaemonFile,
    device: Plant,
    requests: Requests,
    settings: Settings | None = None,
    restored: ValveKnowledge | None = None,
) -> Cycle:
    """Return a daemon's cycle that commands a device in memory, such as that of `sim.slave.slave`."""
    return lockstep_cycle(daemon, MemoryDriver(device), requests, settings, restored)


def lockstep_cycle(
    daemon: DaemonFile,
    driver: Driver,
    requests: Requests,
    settings: Settings | None = None,
    restored: ValveKnowledge | None = None,
) -> Cycle:
    """Return a daemon's cycle on a device in lockstep, wherever its driver finds it.

    Args:
        daemon: its file.
        driver: of the device.
        requests: what the DCS asks for at first.
        settings: of the controller; those of the file where nobody says.
        restored: what was known of the valve before.
    """
    pace = DevicePace()
    link = Link(driver, pace, LinkSettings(travel=daemon.valve.travel))
    held_pa, _ = link.open()
    health = Health(HealthSettings.of_file(daemon))
    controller = Controller(settings or Settings.of(daemon), held_pa, InProcessRefiner(), restored)
    return Cycle(link, controller, pace, requests, recorder=None, health=health)


def run_identification(cycle: Cycle, within_s: float, *, wait: bool) -> Iterator[Snapshot]:
    """Yield the snapshots of an identification: eta switches it on until it is complete, or has come to nothing.

    Args:
        cycle: of a valve in automatic.
        within_s: time that it may take at the most, s.
        wait: whether to let all of that time pass.
    """

    def ask(snapshot: Snapshot, requests: Requests) -> Requests:
        return replace(requests, eta=QUIET if snapshot.decision.progress >= 1 else (0, 0, 0))

    before = cycle.snapshot.decision.applied
    for snapshot in play_script(cycle, ask, cycle.snapshot.sample.time_s + within_s):
        yield snapshot
        applied = snapshot.decision.applied
        if (applied.count, applied.refusals) != (before.count, before.refusals) and not wait:
            return


def play_script(cycle: Cycle, script: Script, until_s: float) -> Iterator[Snapshot]:
    """Yield the snapshot of every cycle up to a time of the device, s, the script playing the DCS between them."""
    yield cycle.snapshot
    while cycle.snapshot.sample.time_s < until_s:
        cycle.requests = script(cycle.snapshot, cycle.requests)
        cycle.once()
        yield cycle.snapshot
