"""kill -9 at instants drawn at random: `make kills`.

    python -m benchmarks.kills [--times N] [--seed N]

Daemon and simulated device run as processes on Modbus TCP, in real time; the device lives on when the daemon is killed.
Killed are the daemon (now and then a file that it keeps is torn, too), the device, the DCS that beats, and the process
that refines. The instant is a number of cycles. What is asked after each kill is what `docs/reliability.md` promises.
On a busy machine a move may land elsewhere than it should: then the daemon drops what was restored, as it must
(`dropped`), and it is given anew.
"""

import argparse
import os
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from config.codes import Fault, Mode
from config.daemon_file import load_daemon
from config.errors import InputError
from config.modbus_map import SIMULATED_MAP
from config.recorder_files import files_of
from config.recording import Recording
from fieldbus.modbus.client import ModbusClient
from positioner.cli.parts.children import port_in
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.health.health_file import read_record
from positioner.daemon.memory.known_configuration import conditions_of
from positioner.daemon.memory.memory_file import SET_ASIDE, read_memory, write_memory
from positioner.dcs import Dcs, DcsError
from positioner.estimation.acceptance import Ratios
from positioner.history.history_reader import HistoryReader
from tests.children import FORKS, Child, child

VALVE, STROKE_M, SPAN_PA, PERIOD_S = "FV-9", 0.1016, 200e3, 5e-3
HELD_PA, POSITION_M = 24e3, 0.03
WITHIN_S = 60.0
MOST_CYCLES = 300
BUMP = 1e-3
"""Of the span: what counts as bumpless."""
LOST_S = 1.0
KNOWN = ValveKnowledge(
    ratios=Ratios(-814542.6, -22068.2, 1 / 3),
    covariance=((2e6, 0.0, 0.0), (0.0, 3e3, 0.0), (0.0, 0.0, 1e-6)),
    residual_m=2e-5,
)
KEPT = {"memory": f"{VALVE}.memory.json", "health": f"{VALVE}.health.json", "history": "history.sqlite"}
"""Files by their folder."""


@dataclass(slots=True)
class Seen:
    """What was found after the kills of one kind: how often what did not hold, and the worst figures."""

    times: int = 0
    wrong: Counter[str] = field(default_factory=Counter)
    bump: float = 0.0
    lost_s: float = 0.0
    set_aside: int = 0
    dropped: int = 0

    def require(self, holds: bool, what: str) -> None:
        """Note what does not hold."""
        self.wrong[what] += not holds


def until(holds: Callable[[], bool]) -> bool:
    """Wait for something; return whether it came."""
    end_s = time.monotonic() + WITHIN_S
    while not holds():
        if time.monotonic() > end_s:
            return False
        time.sleep(2e-3)
    return True


class Site:
    """A device and the files of its daemon in a folder; the daemon is started for each kill."""

    def __init__(self, folder: Path, by: Random) -> None:
        self.folder, self.by = folder, by
        self._slave_file = folder / "slave.toml"
        self._slave_file.write_text(
            f"[bus]\nport = 5020\n[initial]\nposition_m = {POSITION_M}\npressure_pa = {HELD_PA}\n"
            "[sensor]\nnoise_std_m = 1e-5\n"
        )
        self.slave = Child("sim", self._slave_file, "--listen-port", "0")
        self.device_port = port_in(self.slave.line())
        self._daemon_file = folder / "daemon.toml"
        self._daemon_file.write_text(
            f"[valve]\nname = '{VALVE}'\nstroke_m = {STROKE_M}\n[cycle]\nperiod_s = {PERIOD_S}\n"
            f"[device]\nport = {self.device_port}\nreply_timeout_s = 2.0\n[supervisory]\nport = 0\n"
            f"[pressure]\nminimum_pa = 0.0\nmaximum_pa = {SPAN_PA}\n"
            "[safety]\nheartbeat_timeout_s = 5.0\nstale_after_s = 5.0\n[recorder]\nfolder = 'recordings'\n"
            + "".join(f"[{each}]\nfolder = '{each}'\n" for each in KEPT)
        )
        self._conditions = conditions_of(load_daemon(self._daemon_file))
        self.know()

    def know(self) -> None:
        """Keep what an identification has found, and nothing that was set aside."""
        path = self.kept("memory")
        path.parent.mkdir(exist_ok=True)
        path.with_name(path.name + SET_ASIDE).unlink(missing_ok=True)
        write_memory(self.kept("memory"), VALVE, self._conditions, KNOWN)

    def kept(self, what: str) -> Path:
        """Return a file that the daemon keeps."""
        return self.folder / what / KEPT[what]

    def restart_slave(self) -> None:
        """Start the device anew, at the same port."""
        self.slave.close()
        self.slave = Child("sim", self._slave_file, "--listen-port", str(self.device_port))
        self.slave.line()

    def held_pa(self) -> float:
        """Return the command that the device holds."""
        place = SIMULATED_MAP.command_pa
        client = ModbusClient("127.0.0.1", self.device_port, 1, 5.0)
        client.open()
        try:
            words = client.read_holding_registers(place.address, place.format.words)
        finally:
            client.close()
        return place.value(place.format.decode(words))

    def survives(self, seen: Seen, counted: "Counts") -> "Counts":
        """Hold what is kept against what was before the kill; return what is now."""
        path = self.kept("memory")
        if not path.exists() and path.with_name(path.name + SET_ASIDE).exists():
            seen.dropped += 1
            self.know()
        kept = read_memory(path, VALVE, self._conditions)
        seen.require(kept.knowledge is not None, "identification")
        worn = read_record(self.kept("health"), VALVE, {})
        seen.require(worn.problem is None and worn.record.travel_m >= counted.travel_m, "counters")
        with HistoryReader(self.kept("history")) as history:
            events = len(history.events(VALVE))
        seen.require(events >= counted.events, "history")
        return Counts(worn.record.travel_m, events)

    def recorded_s(self) -> float:
        """Return how long the newest recording is; raises if it does not open, but for want of a first sample."""
        path = files_of(self.folder / "recordings", VALVE)[-1]
        try:
            return len(Recording.read(path)) * PERIOD_S
        except InputError as error:
            if error.problem != "holds no samples":
                raise
            return 0.0

    def run(self) -> "Run":
        """Start the daemon; what it dropped, it is given anew."""
        if not self.kept("memory").exists():
            self.know()
        return Run(self)


@dataclass(frozen=True, slots=True)
class Counts:
    """What must not become less."""

    travel_m: float = 0.0
    events: int = 0


class Run:
    """A daemon while it runs, in automatic after `drive`."""

    def __init__(self, site: Site) -> None:
        self._site, self._stack = site, ExitStack()
        self.process, ready = self._stack.enter_context(child("run", site._daemon_file))
        self.port = port_in(ready)
        self.dcs = self._stack.enter_context(Dcs("127.0.0.1", self.port, timeout_s=20.0))

        self.beats, self._beat = True, 0
        """Whether this is the DCS that beats."""

    def __enter__(self) -> "Run":
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            self._stack.close()

    def cycles(self, count: int) -> None:
        """Let so many pass."""
        first = self.dcs.get("cycles")

        def passed() -> bool:
            if self.beats:
                self._beat = (self._beat + 1) % 60_000
                self.dcs.set("heartbeat", self._beat)
            return self.dcs.get("cycles") >= first + count

        until(passed)

    def drive(self) -> bool:
        """Have the stem move; return whether it may be."""
        self.cycles(2)
        may = until(self._automatic)
        self.dcs.set("reference", self._site.by.uniform(0.2, 0.8))
        return may

    def _automatic(self) -> bool:
        """Acknowledge, for a machine that stood still is a fault, and choose the mode; return whether it holds."""
        self.dcs.set("acknowledge", 1)
        with suppress(DcsError):
            self.cycles(1)
            self.dcs.set("mode", Mode.AUTOMATIC)
            self.cycles(1)
        return self.dcs.get("mode") == Mode.AUTOMATIC

    def is_still(self, held_pa: float, seen: Seen) -> None:
        """Require that it holds what the device held, and follows nothing."""
        seen.require(self.dcs.get("mode") == Mode.HOLD, "mode hold")
        self.dcs.set("reference", 0.9)
        bump = 0.0
        for _ in range(5):
            self.cycles(3)
            bump = max(bump, abs(self._site.held_pa() - held_pa) / SPAN_PA)
        seen.bump = max(seen.bump, bump)
        seen.require(bump < BUMP, "bumpless")


def kill_daemon(site: Site, seen: Seen, before: Counts, tear: str | None = None) -> Counts:
    """Kill the daemon while it moves the stem, look at what it kept, and start it again."""
    with site.run() as run:
        driven = run.drive()
        seen.require(driven, "automatic by what was restored")
        run.cycles(site.by.randrange(MOST_CYCLES))
        cycles = run.dcs.get("cycles")
        os.kill(run.process.pid, signal.SIGKILL)
        run.process.kill()
        held_pa = site.held_pa()
    lost_s = cycles * PERIOD_S - site.recorded_s()
    seen.lost_s = max(seen.lost_s, lost_s)
    seen.require(lost_s <= LOST_S, "recording")
    counts = site.survives(seen, before)
    if tear is not None:
        counts = torn(site, tear, counts)
    with site.run() as again:
        again.is_still(held_pa, seen)
        restored = again.dcs.get("restored") > 0
        seen.require(restored == (tear != "memory"), "restored")
    if tear is not None:
        aside = [each for each in (site.folder / tear).iterdir() if each.suffix in {".set_aside", ".unreadable"}]
        seen.require(bool(aside), "torn file set aside")
        seen.set_aside += bool(aside)
        for each in aside:
            each.unlink()
        site.know()
    return counts


def torn(site: Site, what: str, counts: Counts) -> Counts:
    """Cut a file at a byte drawn by lot; return what can still be counted on."""
    path = site.kept(what)
    data = path.read_bytes()
    path.write_bytes(data[: site.by.randrange(100 if what == "history" else 1, len(data) - 1)])
    for log in path.parent.glob(f"{path.name}-*"):
        log.unlink()
    return Counts(0.0 if what == "health" else counts.travel_m, 0 if what == "history" else counts.events)


def kill_device(site: Site, seen: Seen) -> None:
    """Kill the device in mid-move, and power it up again: a fault, latched, and no move."""
    with site.run() as run:
        seen.require(run.drive(), "automatic by what was restored")
        run.cycles(site.by.randrange(MOST_CYCLES))
        site.slave.kill()
        seen.require(until(lambda: run.dcs.get("fault") != Fault.NONE), "fault")
        site.restart_slave()
        seen.require(until(lambda: run.dcs.get("quality") == 0), "taken up again")
        seen.require(run.dcs.get("fault") != Fault.NONE, "latched")
        run.is_still(HELD_PA, seen)


def beat(port: int) -> None:
    """Be a DCS."""
    with Dcs("127.0.0.1", port, timeout_s=20.0) as dcs:
        for n in range(1_000_000):
            dcs.set("heartbeat", n % 60_000)
            time.sleep(0.02)


def kill_dcs(site: Site, seen: Seen) -> None:
    """Kill the DCS that beats: its silence is a fault, and the pressure is held."""
    with site.run() as run:
        dcs = FORKS.Process(target=beat, args=(run.port,), daemon=True)
        dcs.start()
        seen.require(until(lambda: run.dcs.get("heartbeat") > 0), "a DCS that beats")
        seen.require(run.drive(), "automatic by what was restored")
        run.beats = False
        run.cycles(site.by.randrange(MOST_CYCLES))
        dcs.kill()
        seen.require(until(lambda: run.dcs.get("fault") == Fault.DCS_SILENT), "fault")
        run.cycles(20)
        run.is_still(site.held_pa(), seen)


def kill_refiner(site: Site, seen: Seen) -> None:
    """Kill the process that refines: the cycle goes on."""
    with site.run() as run:
        seen.require(run.drive(), "automatic by what was restored")
        run.cycles(site.by.randrange(MOST_CYCLES))
        tasks = Path(f"/proc/{run.process.pid}/task").glob("*/children")
        helpers = {int(each) for task in tasks for each in task.read_text().split()}
        seen.require(bool(helpers), "a process that refines")
        for each in helpers:
            os.kill(each, signal.SIGKILL)
        run.cycles(50)
        seen.require(run.dcs.get("mode") == Mode.AUTOMATIC and run.dcs.get("fault") == Fault.NONE, "control goes on")


def killed(times: int, seed: int, folder: Path) -> dict[str, Seen]:
    """Kill so many times; return what was seen, by who was killed."""
    by = Random(seed)
    site, counts = Site(folder, by), Counts()
    found = {each: Seen() for each in ("daemon", "daemon, a file torn", "device", "DCS", "refinement process")}
    try:
        for n in range(times):
            who = list(found)[n % 5] if n % 2 == 0 else "daemon"
            seen = found[who]
            seen.times += 1
            if who.startswith("daemon"):
                tear = by.choice(list(KEPT)) if who != "daemon" else None
                counts = kill_daemon(site, seen, counts, tear)
            else:
                {"device": kill_device, "DCS": kill_dcs}.get(who, kill_refiner)(site, seen)
    finally:
        site.slave.close()
    return found


def rows(found: dict[str, Seen]) -> Iterator[str]:
    """Yield the table."""
    head = ("killed", "times", "largest step, % of span", "most lost of a recording, s", "torn, set aside", "dropped")
    yield f"| {' | '.join(head)} | did not hold |\n|{'---|' * (1 + len(head))}"
    for who, seen in found.items():
        wrong = ", ".join(f"{what}: {times}" for what, times in seen.wrong.items() if times) or "none"
        cells = (who, seen.times, f"{100 * seen.bump:.4f}", f"{seen.lost_s:.2f}", seen.set_aside, seen.dropped, wrong)
        yield f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--times", type=int, default=300)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as made:
        print(*rows(killed(given.times, given.seed, Path(made))), sep="\n")
