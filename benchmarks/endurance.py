"""Whether anything grows, drifts or stops over a long time: `make endurance`.

    python -m benchmarks.endurance [--minutes 60] [--days 30]

In real time, slave and daemon are processes at 1 kHz on Modbus TCP. The DCS moves the valve all the while; recordings
rotate and are compressed, history, counts and memory are kept. On the way the gateway's clock is set a day forward,
then two days back, and the log is rotated as `copytruncate` does. In virtual time, the daemon's own cycle runs for so
many days of a loop of 2 s that moves the stem every ten minutes (of a stem at rest under a pressure that stands the
physics is not integrated: nothing would change).

Compared are the second quarter and the last: memory, descriptors and threads, how far the stem is from its reference,
travel and reversals for each move, periods missed, samples lost. Exit status 1 when something is not flat.
"""

import argparse
import mmap
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Self

from config.codes import EventKind, Fault, Mode
from config.daemon_file import DaemonFile
from config.recorder_files import files_of
from config.recording import Recording
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from positioner.cli.parts.children import port_in, running
from positioner.control.requests import Requests
from positioner.dcs import Dcs, DcsError
from positioner.history.history_reader import HistoryReader
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve

VALVE, STROKE_M = "FV-1", 0.1016
SLAVE = "[sensor]\nnoise_std_m = 1e-5\n"
DAEMON = f"""[valve]
name = "{VALVE}"
stroke_m = {STROKE_M}
[device]
port = {{port}}
reply_timeout_s = 0.5
[safety]
stale_after_s = 1.0
[supervisory]
port = 0
[law]
b_over_c_pa_per_m = -814542.6
k_over_c_pa = -22068.2
[recorder]
folder = "recordings"
file_bytes = 3000000
keep_files = 4
[history]
folder = "history"
[health]
folder = "health"
[memory]
folder = "memory"
"""
LOOKS = 24
MOVES = 0.4, 0.6
"""References, p.u., in turn."""
MOVE_S = 1.0
PATIENCE = 30
FORWARD_AT, BACK_AT, ROTATED_AT = LOOKS // 4, LOOKS // 2, 5 * LOOKS // 8
DAY_S = 86_400.0
CLOCK_SET_S = {FORWARD_AT: DAY_S, BACK_AT: -DAY_S}
"""How far the gateway's clock is off its own from that look on."""
GROWN = 1.05
"""Times the memory of the second quarter."""
WORSE = 2.0
"""Times its distance from the reference ..."""
LEAST = 1e-3
"""... and of the stroke, which is noise and rounding."""
PERIOD_S, BETWEEN_S, SETTLED_S = 2.0, 600.0, 10.0
COURSE = (0.5, 0.52, 0.4, 0.395, 0.7, 0.55, 0.6, 0.3)
"""References in virtual time, p.u., in turn: moves of all sizes, in either direction."""


@dataclass(frozen=True, slots=True)
class Look:
    """What was seen: after so many hours, in processes and registers."""

    hours: float
    held: tuple[int, int, int]
    """Memory, kB, descriptors, threads."""
    off: float
    """Largest distance from the reference at the end of a move, share of the stroke."""
    moves: int
    travel: float
    counts: tuple[int, ...]
    """Reversals, cycles, periods missed, what was lost, faults."""

    def row(self) -> str:
        """Return it as a row of the table."""
        travel = self.travel / self.moves if self.moves else 0.0
        cells = (f"{self.hours:.3f}", *self.held, f"{100 * self.off:.3f}", self.moves, f"{travel:.4f}", *self.counts)
        return f"| {' | '.join(map(str, cells))} |"


HEAD = (
    "| hours | memory, kB | descriptors | threads | off, % of stroke | moves | travel a move | reversals | cycles "
    "| missed | lost | faults |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
)


def not_flat(looks: Sequence[Look]) -> Iterator[str]:
    """Yield what of the last quarter is not as it was in the second."""
    quarter = max(len(looks) // 4, 1)
    early, late = looks[quarter : 2 * quarter], looks[-quarter:]
    for at, (name, most) in enumerate((("memory, kB,", GROWN), ("descriptors", 1.0), ("threads", 1.0))):
        before, after = (min(each.held[at] for each in part) for part in (early, late))
        if after > most * before:
            yield f"{name} grew from {before} to {after}"
    off = [median(each.off for each in part) for part in (early, late)]
    if off[1] > max(WORSE * off[0], LEAST):
        yield f"the stem is off by {100 * off[1]:.3f} % of the stroke, it was {100 * off[0]:.3f} %"
    ways = [(part[-1].travel - part[0].travel) / max(part[-1].moves - part[0].moves, 1) for part in (early, late)]
    if quarter > 1 and abs(ways[1] - ways[0]) > 0.05 * ways[0]:
        yield f"travel for each move was {ways[0]:.4f} strokes, it is {ways[1]:.4f}"


class Clock:
    """How far a process's clock is off, shared with it through a file."""

    def __init__(self, path: Path) -> None:
        with path.open("r+b") as file:
            self._shared = mmap.mmap(file.fileno(), 8)

    @property
    def off_s(self) -> float:
        """Its distance from the true clock."""
        (off_s,) = struct.unpack("d", self._shared[:8])
        return float(off_s)

    @off_s.setter
    def off_s(self, off_s: float) -> None:
        self._shared[:8] = struct.pack("d", off_s)


def daemon_by(clock: Clock, config: str) -> int:
    """Be the daemon, by a clock that may be set: whatever reads the time of day is given that."""
    from positioner.cli.main import main
    from positioner.daemon import recorder
    from positioner.daemon.memory import memory_file

    true_time = time.time

    class Dated(datetime):
        """The date by that clock."""

        @classmethod
        def now(cls, tz: object = UTC) -> Self:  # noqa: ARG003 - asked for in UTC alone
            """Return it."""
            return cls.fromtimestamp(true_time(), UTC) + timedelta(seconds=clock.off_s)

    time.time = lambda: true_time() + clock.off_s
    recorder.datetime = memory_file.datetime = Dated  # type: ignore[attr-defined]
    return main(["run", config])


@contextmanager
def _daemon(folder: Path, clock: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    words = [sys.executable, "-m", "benchmarks.endurance", "--daemon", str(folder / "daemon.toml"), str(clock)]
    with (folder / "daemon.log").open("a") as log:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=log, text=True)
    try:
        assert process.stdout is not None
        yield process, port_in(process.stdout.readline())
    finally:
        process.terminate()
        process.wait(60)


def in_real_time(minutes: float) -> list[str]:
    """Print a look after each part of the time; return what is not flat."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        (folder / "slave.toml").write_text(SLAVE)
        (folder / "clock").write_bytes(bytes(8))
        with running("sim", folder / "slave.toml", "--listen-port", "0") as slave:
            (folder / "daemon.toml").write_text(DAEMON.format(port=port_in(slave)))
            with _daemon(folder, folder / "clock") as (process, port), Dcs("127.0.0.1", port, timeout_s=20.0) as dcs:
                looks = list(_looks(dcs, process.pid, 60.0 * minutes, Clock(folder / "clock"), folder / "daemon.log"))
        return [*not_flat(looks), *_left(folder)]


def _looks(dcs: Dcs, pid: int, seconds: float, clock: Clock, log: Path) -> Iterator[Look]:
    print(HEAD, flush=True)
    dcs.set("mode", Mode.AUTOMATIC)
    start_s, moves, faults = time.monotonic(), 0, 0
    for number in range(LOOKS):
        clock.off_s = CLOCK_SET_S.get(number, clock.off_s)
        if number == ROTATED_AT:
            log.with_suffix(".1").write_bytes(log.read_bytes())
            os.truncate(log, 0)
            dcs.set("mode", Mode.HOLD)  # each is a line of the log
            dcs.set("mode", Mode.AUTOMATIC)
        off = 0.0
        while time.monotonic() < start_s + (number + 1) * seconds / LOOKS:
            moves += 1
            dcs.set("reference", MOVES[moves % 2])
            time.sleep(MOVE_S)
            off = max(off, abs(dcs.get("position") - MOVES[moves % 2]))
            if dcs.get("fault") != Fault.NONE:
                faults += 1
                _acknowledge(dcs)
        names = ("travel", "reversals", "cycles", "missed_periods", "lost_samples", "unrecorded", "history_lost")
        seen = dcs.get_all(*names)
        lost = int(seen["lost_samples"] + seen["unrecorded"] + seen["history_lost"])
        counts = tuple(int(seen[each]) for each in ("reversals", "cycles", "missed_periods"))
        hours = (time.monotonic() - start_s) / 3600.0
        look = Look(hours, held_by(pid), off, moves, seen["travel"], (*counts, lost, faults))
        print(look.row(), flush=True)
        yield look


def _acknowledge(dcs: Dcs) -> None:
    """Go on in automatic; again if the next fault, as on an overloaded machine, comes before that."""
    for patience in range(PATIENCE, -1, -1):
        dcs.set("acknowledge", 1)
        time.sleep(MOVE_S)
        try:
            dcs.set("mode", Mode.AUTOMATIC)
        except DcsError:
            if not patience:
                raise
        else:
            return


def held_by(pid: int) -> tuple[int, int, int]:
    """Return resident memory, kB, descriptors and threads of a process."""
    process = Path(f"/proc/{pid}")
    pages = int((process / "statm").read_text().split()[1])
    descriptors, threads = (sum(1 for _ in (process / each).iterdir()) for each in ("fd", "task"))
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024, descriptors, threads


def _left(folder: Path) -> Iterator[str]:
    """Yield what is wrong with what the daemon has left behind."""
    files = files_of(folder / "recordings", VALVE)
    ends_s = [end for each in map(Recording.read, files) for end in (each.time_s[0], each.time_s[-1])]
    if ends_s != sorted(ends_s):
        yield "recordings overlap, or are not in their order"
    with HistoryReader(folder / "history") as history:
        events = history.events()
    if [each.number for each in events] != list(range(1, len(events) + 1)):
        yield "events of the history are missing"
    if sum(each.kind == EventKind.CLOCK_SET for each in events) != len(CLOCK_SET_S):
        yield "the clock was set, and no event says so"
    log = (folder / "daemon.log").read_bytes()
    if not log or b"\0" in log:
        yield "the log does not go on in the file that was emptied"
    print(f"\n{len(files)} recordings kept, {len(events)} events, {len(log)} bytes of log since it was rotated.")


class Still:
    """A valve that is not integrated while its pressure has stood for long and its stem rests."""

    def __init__(self, valve: Valve) -> None:
        self._valve = valve
        self._command_pa, self._stood_s = -1.0, 0.0

    def __getattr__(self, name: str) -> object:
        return getattr(self._valve, name)

    def advance(self, command_pa: float, duration_s: float) -> None:
        """Obey a command for a while."""
        self._stood_s = self._stood_s + duration_s if command_pa == self._command_pa else 0.0
        self._command_pa = command_pa
        if self._stood_s < SETTLED_S:
            self._valve.advance(command_pa, duration_s)


def in_virtual_time(days: float) -> list[str]:
    """Print a look after each part of the time; return what is not flat."""
    daemon = DaemonFile.model_validate(
        {
            "valve": {"stroke_m": STROKE_M},
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "safety": {"stale_after_s": 5 * PERIOD_S},
            "control": {"law": "slides"},
            "law": {"b_over_c_pa_per_m": -814542.6, "k_over_c_pa": -22068.2},
        }
    )
    slave = SlaveFile.model_validate(
        {"clock": {"mode": "lockstep", "period_s": PERIOD_S}, "sensor": {"noise_std_m": 1e-5}}
    )
    valve = Valve.from_file(load_valve(shipped_valve("seed")))
    valve.rest_at(0.03, 24e3)
    device = Device(Still(valve), slave, {})  # type: ignore[arg-type]
    cycle = virtual_cycle(daemon, device, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
    assert cycle.health is not None
    moves, looks = 0, list[Look]()
    print(HEAD, flush=True)
    for number in range(LOOKS):
        off = 0.0
        while device.samples * PERIOD_S < (number + 1) * days * DAY_S / LOOKS:
            moves += 1
            aim_m = COURSE[moves % len(COURSE)] * STROKE_M
            cycle.requests = replace(cycle.requests, reference_m=aim_m, reference_writes=moves)
            for _ in range(round(BETWEEN_S / PERIOD_S)):
                cycle.once()
            off = max(off, abs(device.stem_m - aim_m) / STROKE_M)
        assert cycle.snapshot.decision.fault is Fault.NONE, cycle.snapshot.decision.fault
        record, counts = cycle.health.record, cycle.link.counts
        seen = (record.reversals, device.samples, 0, counts.lost_samples, 0)
        hours, travel = device.samples * PERIOD_S / 3600.0, record.travel_m / STROKE_M
        looks.append(Look(hours, held_by(os.getpid()), off, moves, travel, seen))
        print(looks[-1].row(), flush=True)
    most_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"\n{device.samples} cycles, {most_kb} kB at the most.")
    return list(not_flat(looks))


def main() -> int:
    """Run both, or what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="in real time; 0: not")
    parser.add_argument("--days", type=float, default=30.0, help="in virtual time; 0: not")
    parser.add_argument("--daemon", nargs=2, metavar=("CONFIG", "CLOCK"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.daemon:
        return daemon_by(Clock(Path(given.daemon[1])), given.daemon[0])
    wrong = list[str]()
    if given.minutes:
        print(f"{given.minutes:g} min in real time, 1 kHz:\n")
        wrong += in_real_time(given.minutes)
    if given.days:
        print(f"\n{given.days:g} days in virtual time, a loop of {PERIOD_S:g} s:\n")
        wrong += in_virtual_time(given.days)
    print("\n" + ("Not flat: " + "; ".join(wrong) if wrong else "All flat."))
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
