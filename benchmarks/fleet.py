"""Eight valves in one daemon: what a device that dies does to the cycles of the other seven.

The devices are processes of their own, in lockstep, the daemon one process in real time. Windows take turns: all alive,
one killed (its connection refused), all alive, one stopped (it takes requests and answers none). Machines are noisy:
what counts is the ratio to the windows with all alive beside them. Takes two minutes, and runs alone.
"""

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from config.codes import Fault
from positioner.cli.parts.children import port_in, running
from positioner.dcs import Dcs

VALVES = 8
VICTIM = 4
PERIOD_S = 0.01
WINDOW_S = 10.5
"""A little more than the thousand cycles that the statistics look back on."""
ROUNDS = 2
SLAVE = (
    "[clock]\nmode = 'lockstep'\n[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n"
)
FIGURES = ("cycles", "period", "jitter_99", "cycle_time", "missed_periods", "lost_replies")


class Device:
    """A simulated device in a process of its own, on a port that it keeps."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self.port = 0
        self.start()

    def start(self) -> None:
        """Start (anew)."""
        command = [sys.executable, "-m", "positioner.cli", "sim", str(self._file), "--listen-port", str(self.port)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self.port = port_in(self._process.stdout.readline().strip())

    def tell(self, number: signal.Signals) -> None:
        """Send a signal."""
        os.kill(self._process.pid, number)

    def end(self) -> None:
        """Kill it, also when it is stopped."""
        self._process.kill()
        self._process.communicate()


def report() -> list[str]:
    """Return lines: the others' rate, cycle time and jitter with one device dead, as ratios to all alive."""
    windows: dict[str, list[dict[str, float]]] = {"alive": [], "killed": [], "stopped": []}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as on_exit:
        slave = Path(folder, "slave.toml")
        slave.write_text(SLAVE)
        devices = [Device(slave) for _ in range(VALVES)]
        for device in devices:
            on_exit.callback(device.end)
        file = Path(folder, "fleet.toml")
        file.write_text(fleet_file([device.port for device in devices]))
        port = port_in(on_exit.enter_context(running("run", file)))
        for _ in range(ROUNDS):
            windows["alive"].append(window(port))
            devices[VICTIM].end()
            windows["killed"].append(window(port))
            devices[VICTIM].start()
            windows["alive"].append(window(port))
            devices[VICTIM].tell(signal.SIGSTOP)
            windows["stopped"].append(window(port))
            devices[VICTIM].tell(signal.SIGCONT)
    return lines(windows)


def fleet_file(ports: list[int]) -> str:
    """Return the daemon's file."""
    valves = [
        f"[[valve]]\nname = 'V{index}'\nunit = {index + 1}\nstroke_m = 0.1016\ndevice = {{ port = {port} }}\n"
        for index, port in enumerate(ports)
    ]
    return f"[cycle]\nperiod_s = {PERIOD_S}\n[supervisory]\nport = 0\n" + "".join(valves)


def window(port: int) -> dict[str, float]:
    """Let a window pass; return the others' figures: medians over them, sums of what should not be at all."""
    before, begun_s = [figures(port, valve) for valve in others()], time.monotonic()
    time.sleep(WINDOW_S)
    after, took_s = [figures(port, valve) for valve in others()], time.monotonic() - begun_s
    return {
        "rate": statistics.median((b["cycles"] - a["cycles"]) / took_s for a, b in zip(before, after, strict=True)),
        "cycle_time": statistics.median(each["cycle_time"] for each in after),
        "jitter_99": statistics.median(each["jitter_99"] for each in after),
        "missed": sum(b["missed_periods"] - a["missed_periods"] for a, b in zip(before, after, strict=True)),
        "lost": sum(b["lost_replies"] - a["lost_replies"] for a, b in zip(before, after, strict=True)),
        "faults": sum(each["fault"] != Fault.NONE for each in after),
    }


def others() -> list[int]:
    """Return the units of the valves whose device stays alive."""
    return [index + 1 for index in range(VALVES) if index != VICTIM]


def figures(port: int, unit: int) -> dict[str, float]:
    """Return what the daemon says of a valve's cycle."""
    with Dcs("127.0.0.1", port, unit=unit) as dcs:
        return dcs.get_all(*FIGURES, "fault")


def lines(windows: dict[str, list[dict[str, float]]]) -> list[str]:
    """Return the table."""
    base = {name: statistics.median(each[name] for each in windows["alive"]) for name in windows["alive"][0]}
    told = [
        f"{VALVES} valves, {1 / PERIOD_S:g} cycles/s each; the other {VALVES - 1} valves' figures, ratio to all alive"
    ]
    told += [
        f"{'':14}{'cycles/s':>10}{'ratio':>7}{'cycle us':>10}{'ratio':>7}{'jitter 99 % us':>16}{'ratio':>7}  missed"
    ]
    for state, measured in windows.items():
        for each in measured:
            told.append(
                f"{state:14}{each['rate']:10.2f}{each['rate'] / base['rate']:7.3f}"
                f"{1e6 * each['cycle_time']:10.0f}{each['cycle_time'] / base['cycle_time']:7.2f}"
                f"{1e6 * each['jitter_99']:16.0f}{each['jitter_99'] / base['jitter_99']:7.2f}"
                f"{each['missed']:8.0f}" + f"{each['lost']:6.0f} lost replies, {each['faults']:.0f} faults"
            )
    return told


if __name__ == "__main__":
    print("\n".join(report()))
