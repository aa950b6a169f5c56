"""`positioner doctor`: checks the installation, a daemon's file, its bus, timing and permissions, a line each."""

import argparse
import os
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import CommandFailed, InputError
from positioner.cli.parts.config_argument import add_config, config_file
from positioner.cli.parts.extended_valves import load_extended_valve
from positioner.cli.parts.sampling_order import when_shown
from positioner.daemon.platform_needs import goes_without, require_platform

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

    Check = Callable[[DaemonFile, Path], str]

HELP = "check installation, file, bus, timing and permissions; moves nothing unless --nudge-pa"
EXAMPLE = "positioner doctor daemon.toml"

LEAST_DAYS = 14
"""A certificate that ends sooner than this fails."""
PERIODS, LEAST_PERIODS, TIMING_S = 500, 5, 5.0
"""Over which the machine's timing is watched: so many periods, or as many as fit into that time, at least a few."""
MOST_LOST = 1
"""Of the readings: a line that loses more is to be looked at."""


class FailedCheck(Exception):
    """A check that failed, and why."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser)
    parser.add_argument(
        "--nudge-pa",
        type=float,
        metavar="PA",
        help="command this much more for a moment, to find when the device samples; no daemon may run meanwhile",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print a line a check; exit status 1 when one failed."""
    from config.daemon_file import load_valves

    path = config_file(arguments)
    files = load_valves(path)
    well = passes("packages", "", check_packages)
    nudge_pa: float | None = arguments.nudge_pa
    nudged = () if nudge_pa is None else (("sampling", partial(_sampling, nudge_pa)),)
    valves = [(f"{file.valve.name}: " if len(files) > 1 else "", file) for file in files]
    checks: list[tuple[str, str, Check, DaemonFile]] = [
        *(
            (name, valve, check, file)
            for valve, file in valves
            for name, check in (
                ("law", _law),
                ("bus", check_bus),
                *nudged,
                ("recorder", _recorder),
                ("memory", _memory),
            )
        ),
        *(
            (name, "", check, files[0])
            for name, check in (
                ("supervisory", _supervisory),
                ("history", _history),
                ("timing", _timing),
                ("system", _system),
                ("priority", _priority),
            )
        ),
        *(("certificates", valve, check_certificates, file) for valve, file in valves),
    ]
    for file in files:
        well = passes("config", "", partial(_config, file, path)) and well
    well = passes("load", "", partial(_load, files)) and well
    for name, valve, check, file in checks:
        well = passes(name, valve, partial(check, file, path)) and well
    return 0 if well else 1


def passes(name: str, valve: str, check: Callable[[], str]) -> bool:
    """Make a check and print its line; return whether all is well."""
    try:
        print(f"{name:12} ok    {valve}{check()}")
    except FailedCheck as failed:
        print(f"{name:12} FAILS {valve}{failed}")
        return False
    return True


def check_packages() -> str:
    """Say where the packages are; FailedCheck where another's stand in their way."""
    from positioner.own_packages import HOME, OWN, in_the_way, sharing

    if said := in_the_way() or sharing():
        raise FailedCheck(said)
    return f"{', '.join(OWN)} are positioner's own, in {HOME}"


def _config(file: "DaemonFile", path: Path) -> str:
    from config.recording_oddities import odd_settings

    travel = file.valve.travel
    said = f"{path}: {file.valve.name}, stroke {file.valve.plain.said(travel.stroke_m, 'g')}, {travel.words}"
    if odd := odd_settings(travel.stroke_m, file.pressure.maximum_pa):
        raise FailedCheck(f"{said}; {odd}")
    return said


def _load(files: "Sequence[DaemonFile]") -> str:
    from positioner.daemon.cycle_load import cycle_load

    load = cycle_load(files)
    if load is None:
        return "in lockstep: the devices wait for the daemon"
    if not load.fits:
        raise FailedCheck(load.said)
    return load.said


def _law(file: "DaemonFile", config: Path) -> str:

    try:
        valve = load_extended_valve(file, str(config))
    except InputError as error:
        raise FailedCheck(str(error)) from None
    if valve is None:
        return f"{file.control.law}, {'nothing known yet' if file.law is None else 'ratios typed in'}"
    assert file.law is not None
    return f"{file.control.law}, with the inverse of {file.law.valve}"


def check_bus(file: "DaemonFile", _config: Path) -> str:
    """Say what the device shows; FailedCheck where it does not answer, or too seldom."""

    from drivers.boundary import DriverError, ForeseesRefusal, NoReply
    from positioner.cli.probe import unfit, watching_driver
    from positioner.control.settings import Settings
    from positioner.daemon.first_look import doubts, impossible, travel_in_registers
    from positioner.daemon.link import first_reading

    driver, lost = watching_driver(file), list[NoReply]()
    try:
        held_pa, _ = first_reading(driver, lost.append)
        started_s = time.perf_counter()
        for _ in range(PERIODS // 5):
            try:
                reading = driver.read()
            except NoReply as error:
                lost.append(error)
                held_pa, reading = first_reading(driver, lost.append)
        took_s = (time.perf_counter() - started_s) / (PERIODS // 5)
        refused = driver.refused() if isinstance(driver, ForeseesRefusal) else None
    except DriverError as error:
        raise FailedCheck(str(error)) from None
    finally:
        driver.close()
    if len(lost) > MOST_LOST:
        raise FailedCheck(f"{len(lost)} of {PERIODS // 5} readings had no reply: {lost[-1]}")
    if refused is not None:
        raise FailedCheck(f"run would be refused: {refused}")
    if wrong := impossible(file, held_pa, reading, Settings.of(file).limits) or doubts(file, held_pa, reading):
        raise FailedCheck(wrong)
    # A reading piece by piece, as a watcher of CANopen has it, says nothing of the cycle.
    if took_s > file.cycle.period_s and driver.capabilities.one_transaction:
        raise FailedCheck(f"a reading takes {1e3 * took_s:.2f} ms, longer than cycle.period_s")
    # No failure: one that nobody has commanded may well say so, or wait for its master to be made ready.
    said = unfit(reading)
    position = file.valve.plain.said(reading.position_m, ".5f")
    seen = [f"position {position}, holds {held_pa:.0f} Pa, {1e3 * took_s:.2f} ms a reading"]
    if lost:
        seen.append("one reading asked for again, because its reply was lost")
    if in_registers := travel_in_registers(file):
        seen.append(in_registers)
    return f"{', '.join(seen)}; but {said}" if said else ", ".join(seen)


def _sampling(nudge_pa: float, file: "DaemonFile", _config: Path) -> str:
    from drivers import driver_for
    from drivers.boundary import DriverError

    if file.cycle.pace == "device":
        return "in lockstep: a reply shows the valve one period after its command"
    least_pa = file.device.command_step_pa
    driver = driver_for(file.device)
    try:
        held_pa = driver.open()
        towards = nudge_pa if held_pa + abs(nudge_pa) <= file.pressure.maximum_pa else -nudge_pa
        if not least_pa < abs(nudge_pa) <= file.pressure.maximum_pa - file.pressure.minimum_pa:
            raise FailedCheck(f"--nudge-pa must be more than a digit of the command, {least_pa:g} Pa")
        shown = when_shown(driver, held_pa, towards)
    except (DriverError, CommandFailed) as error:
        raise FailedCheck(str(error)) from None
    finally:
        driver.close()
    if shown.sampling != file.device.sampling:
        raise FailedCheck(f'it samples {shown.sampling} the write: set device.sampling = "{shown.sampling}"')
    return f"it samples {shown.sampling} the write; the change showed {shown.replies} replies later"


def _supervisory(file: "DaemonFile", _config: Path) -> str:
    import socket

    host, port = file.supervisory.host, file.supervisory.port
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            raise FailedCheck(f"{host}:{port}: {error.strerror} (is the daemon running already?)") from None
    return f"{host}:{port} is free"


def check_certificates(file: "DaemonFile", _config: Path) -> str:
    """Say until when each certificate holds; FailedCheck of one that ends soon or cannot be read."""

    from fieldbus.modbus.tls import expiry

    tables = {"device.tls": getattr(file.device, "tls", None), "supervisory.tls": file.supervisory.tls}
    ends = []
    for name, table in tables.items():
        if table is None:
            continue
        try:
            end = expiry(table)
        except InputError as error:
            raise FailedCheck(f"{name}: {error}") from None
        if (end - datetime.now(UTC)).days < LEAST_DAYS:
            raise FailedCheck(f"{name}: {table.certificate} or its authority's ends on {end:%Y-%m-%d}: renew it")
        ends.append(f"{name} until {end:%Y-%m-%d}")
    return ", ".join(ends) or "none configured"


def _writable(folder: Path) -> Path:
    """Return a folder that can be written, or made."""

    nearest = next(each for each in (folder, *folder.parents) if each.exists())
    if not nearest.is_dir():
        raise FailedCheck(f"{folder}: {nearest} is no folder")
    if not os.access(nearest, os.W_OK):
        raise FailedCheck(f"{folder}: cannot be written")
    return folder


def _recorder(file: "DaemonFile", config: Path) -> str:
    if file.recorder is None:
        return "none configured"
    most_mb = file.recorder.keep_files * file.recorder.file_bytes / 1e6
    return f"{_writable(config.parent / file.recorder.folder)}, at most {most_mb:.0f} MB"


def _memory(file: "DaemonFile", config: Path) -> str:
    folders = (("what is known of the valve", file.memory.folder), ("its wear", file.health.folder))
    kept = [f"{what} in {_writable(config.parent / each)}" for what, each in folders if each is not None]
    return ", ".join(kept) or "none configured: a restart begins without what was identified ([memory] folder)"


def _history(file: "DaemonFile", config: Path) -> str:
    if file.history is None:
        return "none configured: nobody can say later who wrote a set point ([history] folder)"
    folder = _writable(config.parent / file.history.folder)
    return f"{folder}: writes with peer and role, for {file.history.keep_days:g} days"


def _timing(file: "DaemonFile", _config: Path) -> str:
    from positioner.daemon.pacing import RealTimePace

    periods = min(PERIODS, max(LEAST_PERIODS, int(TIMING_S / file.cycle.period_s)))
    pace = RealTimePace(file.cycle.period_s)
    missed = sum(pace.wait() for _ in range(periods))
    said = f"{missed} of {periods} periods of {1e3 * file.cycle.period_s:g} ms missed"
    if missed > periods // 100:
        raise FailedCheck(f"{said} without load")
    return said


def _system(_file: "DaemonFile", _config: Path) -> str:

    try:
        require_platform()
    except InputError as error:
        raise FailedCheck(str(error)) from None
    lacks = goes_without()
    return f"cycles are less punctual without {', '.join(lacks)}" if lacks else "has what the daemon needs"


def _priority(_file: "DaemonFile", _config: Path) -> str:

    if not hasattr(os, "sched_setscheduler"):
        return "this system has no SCHED_FIFO"
    import resource

    if os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] != 0:
        return "SCHED_FIFO permitted"
    raise FailedCheck("SCHED_FIFO not permitted: give the service CAP_SYS_NICE or LimitRTPRIO for punctual cycles")
