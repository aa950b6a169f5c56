"""The daemon, assembled: `positioner run`.

Start: connect, hold the pressure the device has, look whether its measurement can be true, then serve. End (SIGTERM,
Ctrl-C, or a cycle that failed): leave the valve in the configured safe state, finish the recording, stop serving.
"""

import logging
import signal
from contextlib import ExitStack
from pathlib import Path
from threading import Event, Thread

from config.daemon import DaemonFile
from config.errors import InputError
from config.modbus_server import RegisterServer
from drivers import driver_for
from drivers.boundary import DriverError, Reading
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.logs import say, start_logging
from positioner.daemon.pacing import DevicePace, Pace, RealTime
from positioner.daemon.recorder import Recorder
from positioner.daemon.supervisory import SupervisoryRegisters

log = logging.getLogger(__name__)

LOOK_EVERY_S = 0.05
"""How often the main thread looks whether a signal came."""


def serve(file: DaemonFile, source: Path) -> int:
    """Run the daemon until it is told to stop; return the exit status.

    Raises:
        InputError: the device is not there or not as described, a port is taken, recordings cannot be written.
    """
    ended: list[int] = []  # not an Event: a handler that sets one may deadlock with the wait it interrupts
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _frame: ended.append(number))
    settings = Settings.of(file)
    with ExitStack() as on_exit:
        pace = _pace(file)
        link = Link(driver_for(file.device), pace)
        on_exit.callback(link.release)
        controller = Controller(settings, _connect(link, settings, source))
        recorder = _recorder(file, source)
        cycle = Cycle(link, controller, pace, _first_requests(file), recorder)
        registers = SupervisoryRegisters(cycle, settings.limits.stroke_m, settings.minimum_pa, settings.maximum_pa)
        server = RegisterServer(registers, file.supervisory.host, file.supervisory.port, file.supervisory.unit)
        server.start()
        on_exit.callback(server.stop)
        if recorder is not None:
            recorder.start()
            on_exit.callback(recorder.stop)
        on_exit.callback(start_logging(file.log.level).stop)
        say(log, logging.INFO, "serving", valve=file.valve.name, host=file.supervisory.host, port=server.port)
        print(f"serving {file.valve.name} on {file.supervisory.host}:{server.port}", flush=True)
        status = _run(cycle, ended)
        link.leave(settings.safe_pa(file.safety.action, controller.command_pa))
        say(log, logging.INFO, "stopped", safe_action=file.safety.action, status=status)
    return status


def _run(cycle: Cycle, ended: list[int]) -> int:
    """Run the cycle in its own thread until a signal ends it, or until it fails; return the exit status."""
    stop, failures = Event(), []

    def work() -> None:
        try:
            cycle.run(stop)
        except Exception as error:
            log.exception("the cycle failed")
            failures.append(error)

    thread = Thread(target=work, name="cycle")
    thread.start()
    while thread.is_alive() and not ended:
        thread.join(LOOK_EVERY_S)
    stop.set()
    thread.join()
    return 1 if failures else 0


def _pace(file: DaemonFile) -> Pace:
    return DevicePace() if file.cycle.pace == "device" else RealTime(file.cycle.period_s)


def _first_requests(file: DaemonFile) -> Requests:
    return Requests(
        alpha_pa=file.excitation.alpha_pa,
        beta_pa=file.excitation.beta_pa,
        omega_rad_per_s=file.excitation.omega_rad_per_s,
    )


def _connect(link: Link, settings: Settings, source: Path) -> float:
    try:
        held_pa, reading = link.open()
    except DriverError as error:
        raise InputError(str(source), f"device: {error}") from None
    _require_plausible(reading, held_pa, settings, source)
    return held_pa


def _require_plausible(reading: Reading, held_pa: float, settings: Settings, source: Path) -> None:
    limits = settings.limits
    if not limits.plausible(reading.position_m):
        margin_m = limits.travel_margin * limits.stroke_m
        raise InputError(
            str(source),
            f"device.map.position_m: the device says {reading.position_m:g} m, allowed is {-margin_m:g} to "
            f"{limits.stroke_m + margin_m:g} m (valve.stroke_m and safety.travel_margin); check the map",
        )
    if not settings.minimum_pa <= held_pa <= settings.maximum_pa:
        raise InputError(
            str(source),
            f"device.map.command_pa: the device holds {held_pa:g} Pa, allowed is {settings.minimum_pa:g} to "
            f"{settings.maximum_pa:g} Pa ([pressure]); check the map",
        )


def _recorder(file: DaemonFile, source: Path) -> Recorder | None:
    if file.recorder is None:
        return None
    folder = source.parent / file.recorder.folder
    return Recorder(folder, file.valve.name, file.recorder.file_bytes, file.recorder.keep_files)
