"""`positioner probe`: looks at the valve without touching it."""

import argparse
import time
from typing import TYPE_CHECKING

from positioner.cli.parts.config_argument import add_config, config_file

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from drivers.boundary import Driver, Reading

HELP = "print one measurement a second, and whether it is plausible; moves nothing"
EXAMPLE = "positioner probe daemon.toml --count 5"

BURST = 50
"""Readings by which the bus is timed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser)
    parser.add_argument("--valve", help="the valve's name, where the file has several")
    parser.add_argument("--count", type=int, default=0, help="number of lines; 0: until Ctrl-C")


def run(arguments: argparse.Namespace) -> int:
    """Print a line a second; exit status 1 when the last reading was not plausible."""
    import itertools

    from config.daemon_file import load_daemon
    from drivers.boundary import DriverError
    from positioner.control.settings import Settings
    from positioner.daemon.first_look import doubts, impossible

    file = load_daemon(config_file(arguments), arguments.valve)
    limits = Settings.of(file).limits
    driver = watching_driver(file)
    wrong = ""
    try:
        held_pa = driver.open()
        print(f"{file.valve.name} holds {held_pa:.1f} Pa")
        for count in itertools.count(1):
            readings, took_s = _burst(driver)
            last = readings[-1]
            wrong = impossible(file, held_pa, last, limits) or unfit(last) or doubts(file, held_pa, last)
            position = f"{file.valve.plain.said(last.position_m, '.6f')} ({last.position_m / limits.stroke_m:.4f} p.u.)"
            print(_line(readings, took_s, position, wrong), flush=True)
            if count == arguments.count:
                break
            time.sleep(max(0.0, 1.0 - took_s))
    except DriverError as error:
        print(f"no reading of {file.valve.name}: {error}")
        return 1
    finally:
        driver.close()
    return 1 if wrong else 0


def unfit(reading: "Reading") -> str:
    """Return what the device says of itself that is a fault; empty where it is well."""
    from northbound.observer.register_words import device_status
    from positioner.control.supervision import UNFIT_STATUS

    if reading.status & UNFIT_STATUS:
        return (
            f"the device says {device_status(reading.status)}, which is a fault, by its status {reading.status}; "
            "if these bits are its own, device.map's status_bits says what they are"
        )
    return ""


def watching_driver(file: "DaemonFile") -> "Driver":
    """Return a driver that leaves the device as it is: a watcher sends no commands."""
    from drivers import driver_for

    return driver_for(file.device.read_only())


def _burst(driver: "Driver") -> tuple[list["Reading"], float]:

    started_s = time.perf_counter()
    readings = [driver.read() for _ in range(BURST)]
    return readings, time.perf_counter() - started_s


def _line(readings: list["Reading"], took_s: float, position: str, wrong: str) -> str:
    last = readings[-1]
    parts = [f"{len(readings) / took_s:6.0f} readings/s", f"position {position}"]
    if last.pressure_pa is not None:
        parts.append(f"pressure {last.pressure_pa:.1f} Pa")
    if last.device_time_s is not None:
        new = len({reading.device_time_s for reading in readings})
        parts.append(f"{new} of {len(readings)} samples new")
    parts.append(f"NOT plausible: {wrong}" if wrong else "plausible")
    return ", ".join(parts)
