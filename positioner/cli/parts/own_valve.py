"""The valve of a daemon's file on a cycle of this command's own: nobody else commands it meanwhile."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from config.codes import Mode
from config.errors import CommandFailed
from positioner.control.requests import ExperimentRequest, Requests

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from positioner.tests_on_the_valve.own_cycle import OwnCycle

ANSWERS_WITHIN_S = 0.5
UNKNOWN_STROKE_M = 10.0
"""Longer than any valve's: with it no reading is implausible for its travel."""
LONGEST_PROGRAM_S = 600.0
"""Of one program, while nobody has said."""


def unknown_travel(file: "DaemonFile") -> "DaemonFile":
    """Return the file as it is for a valve of which nothing is known but its device and its pressures."""
    experiment = file.experiment.model_copy(
        update={"travel_window": (0.0, 1.0), "limit_s": max(file.experiment.limit_s, LONGEST_PROGRAM_S)}
    )
    valve = file.valve.model_copy(update={"stroke_m": UNKNOWN_STROKE_M, "action": "air_to_open", "breakaway_pa": None})
    return file.model_copy(update={"valve": valve, "law": None, "experiment": experiment})


@contextmanager
def own_valve(file: "DaemonFile", source: Path) -> "Iterator[OwnCycle]":
    """Give the valve, in automatic, with the consent of who began this command; its last command is held afterwards.

    Raises:
        CommandFailed: a daemon serves it, or its device is not there.
    """
    from drivers import driver_for
    from drivers.boundary import DriverError
    from positioner.control.controller import Controller
    from positioner.control.settings import Settings
    from positioner.daemon.cycle import Cycle
    from positioner.daemon.link import Link, LinkSettings
    from positioner.daemon.pacing import DevicePace, RealTimePace
    from positioner.daemon.sole_daemon import keep_alone
    from positioner.tests_on_the_valve.own_cycle import OwnCycle

    require_no_daemon(file)
    settings = Settings.of(file)
    with ExitStack() as on_exit:
        keep_alone(file, source.parent, on_exit)
        pace = DevicePace() if file.cycle.pace == "device" else RealTimePace(file.cycle.period_s)
        link = Link(driver_for(file.device), pace, LinkSettings.of(file, settings.limits.restart_tolerance_pa))
        on_exit.callback(link.release)
        try:
            held_pa, _ = link.open()
        except DriverError as error:
            raise CommandFailed(f"{source}: device: {error}") from None
        controller = Controller(settings, held_pa)
        asked = Requests(mode=Mode.AUTOMATIC, mode_writes=1, experiment=ExperimentRequest(consented=True))
        cycle = Cycle(link, controller, pace, asked, None)
        on_exit.callback(lambda: link.leave(controller.left_pa, holds=True))
        cycle.prepare()
        yield OwnCycle(cycle, cycle.turn, file.valve.kind)


def require_no_daemon(file: "DaemonFile") -> None:
    """Refuse a valve that a daemon serves where the file says it would.

    Raises:
        CommandFailed: one answers there, or whether one does cannot be told.
    """
    where = file.supervisory
    if where.port == 0:
        return
    try:
        with socket.create_connection((where.host, where.port), ANSWERS_WITHIN_S):
            pass
    except ConnectionRefusedError:
        return
    except OSError as error:
        raise CommandFailed(
            f"whether a daemon serves this valve at {where.host}:{where.port} cannot be told: {error}"
        ) from None
    raise CommandFailed(
        f"a daemon serves this valve at {where.host}:{where.port}: the valve is in service; end that daemon first"
    )
