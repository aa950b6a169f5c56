"""How many valves one daemon serves: 200 at 10 Hz and 64 at 100 Hz, and what each costs.

    python -m benchmarks.many_valves [--valves 64 --rate-hz 100] [--seconds 20] [--processes 1]

The devices are one process, which answers the shipped map from words that count up, so that nearly all that is used of
the processors is the daemon's. They are as urgent as its cycles where the system permits: devices wait for no other
program. Figures: periods missed, per cent; processor time a cycle, us, and how many times that
of one on a device in memory, by which `doctor` says how many valves fit; the share of one processor that the daemon
took with its workers; and what all others on the machine took meanwhile, the devices among them, in processors. Where
that is much, periods are missed by it, and a cycle is dearer, whose caches are not its own. Each valve is in mode
hold: the cost of standing by.
"""

import argparse
import os
import selectors
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import psutil

from config.codes import Fault
from config.daemon_file import load_valves
from config.errors import InputError
from config.modbus_map import SIMULATED_MAP
from fieldbus.modbus.register_packing import layout
from positioner.cli.parts.children import port_in
from positioner.daemon.cycle_load import in_memory_s
from positioner.daemon.pacing import raise_above_cycles
from positioner.dcs import Dcs, DcsError

GOALS = ((200, 10.0), (64, 100.0))
SECONDS, WARM_UP_S = 20.0, 5.0
STROKE_M = 0.1016
FIGURES = ("cycles", "missed_periods", "sample_age", "fault")
HEADER = struct.Struct(">HHHB")
REST_M, REST_PA = 0.03, 24e3


class Devices:
    """Devices at one port, one a connection: each request is answered with the next sample."""

    def __init__(self) -> None:
        self._places = SIMULATED_MAP.places
        self._layout = layout(list(self._places.values()))
        self._begun_s = time.monotonic()
        self._samples = 0

    def serve(self) -> None:
        """Answer until the process ends; the first line says at which port."""
        with socket.create_server(("127.0.0.1", 0), backlog=1024) as door, selectors.DefaultSelector() as ready:
            print(door.getsockname()[1], flush=True)
            raise_above_cycles()
            door.setblocking(False)
            ready.register(door, selectors.EVENT_READ)
            while True:
                for key, _ in ready.select():
                    if key.fileobj is door:
                        connection, _ = door.accept()
                        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                        ready.register(connection, selectors.EVENT_READ)
                        continue
                    assert isinstance(key.fileobj, socket.socket)
                    self._answer(key.fileobj, ready)

    def _answer(self, connection: socket.socket, ready: selectors.BaseSelector) -> None:
        try:
            request = connection.recv(512)
        except ConnectionError:
            request = b""
        if not request:
            ready.unregister(connection)
            connection.close()
            return
        number, _, _, unit = HEADER.unpack_from(request)
        reply = self._reply(request[HEADER.size :])
        connection.sendall(HEADER.pack(number, 0, len(reply) + 1, unit) + reply)

    def _reply(self, request: bytes) -> bytes:
        function, address, count = struct.unpack_from(">BHH", request)
        if function in (3, 4, 23):
            begin = 2 * (address - self._layout.address)
            words = self._image()[begin : begin + 2 * count]
            return bytes((function, len(words))) + words
        return request[:5]

    def _image(self) -> bytes:
        self._samples += 1
        now = {
            "position_m": REST_M + 1e-6 * (self._samples % 2),
            "pressure_pa": REST_PA,
            "command_pa": REST_PA,
            "sample_counter": self._samples,
            "device_time_s": time.monotonic() - self._begun_s,
        }
        return self._layout.pack([each.raw(now.get(name, 0.0)) for name, each in self._places.items()])


def report(
    goals: Sequence[tuple[int, float]] = GOALS, seconds: float = SECONDS, processes: int | None = None
) -> list[str]:
    """Return a line for each number of valves and rate."""
    lines = [
        f"{'valves':>6}{'Hz':>6}{'missed %':>10}{'us a cycle':>12}{'in memory':>11}{'processor %':>13}{'threads':>9}"
        f"{'ends after s':>14}{'others load':>13}  faults"
    ]
    for valves, rate_hz in goals:
        lines.append(measured(valves, rate_hz, seconds, processes))
    return lines


def measured(valves: int, rate_hz: float, seconds: float, processes: int | None = None) -> str:
    """Run so many valves for so long and return the line; None: among as many processes as the daemon chooses."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as on_exit:
        here = [sys.executable, "-m", "benchmarks.many_valves", "--devices"]
        devices = subprocess.Popen(here, stdout=subprocess.PIPE, text=True)
        on_exit.callback(devices.communicate)
        on_exit.callback(devices.kill)
        assert devices.stdout is not None
        file = Path(folder, "many.toml")
        shared = "" if processes is None else f"[service]\nprocesses = {processes}\n"
        file.write_text(shared + _file(valves, rate_hz, int(devices.stdout.readline())))
        log = on_exit.enter_context(Path(folder, "log").open("w"))
        command = [sys.executable, "-m", "positioner.cli", "run", str(file)]
        daemon = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        on_exit.callback(daemon.communicate)
        on_exit.callback(daemon.kill)
        assert daemon.stdout is not None
        said = daemon.stdout.readline()
        if not said:
            raise InputError(" ".join(command), Path(folder, "log").read_text().strip())
        port = port_in(said.strip())
        time.sleep(WARM_UP_S)
        alone_s = in_memory_s(load_valves(file)[0])
        process, units = psutil.Process(daemon.pid), range(1, valves + 1)
        before, used_s, begun_s, all_s = _seen(port, units), _used_s(process), time.monotonic(), _machine_s()
        time.sleep(seconds)
        after, used_s, took_s = _seen(port, units), _used_s(process) - used_s, time.monotonic() - begun_s
        all_s = _machine_s() - all_s
        threads = sum(each.num_threads() for each in (process, *process.children(recursive=True)))
        told_s = time.monotonic()
        daemon.send_signal(signal.SIGTERM)
        daemon.wait(60.0)
        ended_s = time.monotonic() - told_s
    cycles = sum(b["cycles"] - a["cycles"] for a, b in zip(before, after, strict=True))
    missed = sum(b["missed_periods"] - a["missed_periods"] for a, b in zip(before, after, strict=True))
    missed /= cycles + missed
    faults = Counter(Fault(int(each["fault"])) for each in after)
    said = ", ".join(f"{count} {fault.name}" for fault, count in faults.items() if fault is not Fault.NONE) or "none"
    return (
        f"{valves:6}{rate_hz:6g}{100 * missed:10.2f}{1e6 * used_s / cycles:12.0f}{used_s / cycles / alone_s:11.1f}"
        f"{100 * used_s / took_s:13.0f}"
        f"{threads:9}{ended_s:14.2f}{(all_s - used_s) / took_s:13.2f}  {said}"
    )


def _file(valves: int, rate_hz: float, port: int) -> str:
    each = "".join(
        f"[[valve]]\nname = 'V{unit}'\nunit = {unit}\nstroke_m = {STROKE_M}\n"
        f"device = {{ port = {port}, unit = {unit} }}\n"
        for unit in range(1, valves + 1)
    )
    return f"[cycle]\nperiod_s = {1.0 / rate_hz}\n[supervisory]\nport = 0\n[history]\nfolder = 'history'\n" + each


def _seen(port: int, units: Sequence[int]) -> list[dict[str, float]]:
    seen = []
    for unit in units:
        with Dcs("127.0.0.1", port, unit=unit) as dcs:
            seen.append(dcs.get_all(*FIGURES))
    return seen


def _used_s(process: psutil.Process) -> float:
    """Return the processor time that a process and those that it has started have used, s."""
    times = [each.cpu_times() for each in (process, *process.children(recursive=True))]
    return float(sum(each.user + each.system for each in times))


def _machine_s() -> float:
    """Return the processor time that all have used since the machine began, s."""
    times = psutil.cpu_times()
    return float(sum(times) - times.idle - times.iowait)


def main(words: Sequence[str] | None = None) -> int:
    """Print the lines; with --devices be the devices. Status 1: the machine was too busy for a figure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.many_valves")
    parser.add_argument("--devices", action="store_true", help="be the devices, and say at which port")
    parser.add_argument("--valves", type=int)
    parser.add_argument("--rate-hz", type=float, default=10.0)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--processes", type=int)
    given = parser.parse_args(words)
    if given.devices:
        Devices().serve()
    goals = ((given.valves, given.rate_hz),) if given.valves else GOALS
    try:
        print(*report(goals, given.seconds, given.processes), sep="\n", flush=True)
    except (InputError, DcsError, subprocess.TimeoutExpired) as error:
        print(f"benchmarks.many_valves: no figure: {error}; {busy()}", file=sys.stderr)
        return 1
    return 0


def busy() -> str:
    """Say how busy the machine is, which is why a daemon answers late."""
    return f"{os.getloadavg()[0]:.0f} processes wait for {psutil.cpu_count()} processors"


if __name__ == "__main__":
    sys.exit(main())
