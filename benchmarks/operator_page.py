"""What the operator's page costs the daemon that it watches, and itself: `python -m benchmarks.operator_page`.

A slave and a daemon run as processes of their own at 500 Hz. In turn, several times over: nobody looks; the page looks,
with no tab open; the page looks with a tab open in a browser on this same machine, which gives way (nice 19). Of each
turn the daemon's own statistics, and the processor time of daemon and page. Before that, how soon the browser shows
what dies, the last one in a browser that is slowed down; after it the page's memory over minutes.
"""

import argparse
import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from benchmarks.endurance import held_by
from positioner.dcs import Dcs
from tests.pages.browser import CHROMIUM, opened, served
from tests.pages.valve_site import Site, valve_site

TURNS = 9
TURN_S = 12.0
SETTLE_S = 3.0
MOVE_EVERY_S = 3.0
LOOKS = 10
DEATHS = 5


@dataclass(frozen=True, slots=True)
class Turn:
    """What a turn cost: of the daemon s, shares of its periods and of a processor; of the page a share of one."""

    cycle_s: float
    jitter_s: float
    missed: float
    daemon_cpu: float
    page_cpu: float


def report(minutes: float) -> Iterator[str]:
    """Yield lines as they come: what dies, medians over the turns, ratios to nobody looking, the page's memory."""
    turns: dict[str, list[Turn]] = {"nobody looks": [], "page, no tab": [], "page, a tab open": []}
    yield from _seen()
    with tempfile.TemporaryDirectory() as name, valve_site(Path(name)) as site:
        for _ in range(TURNS):
            for who, found in turns.items():
                with looking(who, site.config) as page_pid:
                    found.append(turn(site.port, site.daemon.pid, page_pid))
        yield f"{'':18} cycle, ms   jitter 99 %, ms   missed, %   daemon's CPU, %   page's CPU, %"
        yield from (f"{who:18} {_row(found)}" for who, found in turns.items())
        alone = turns["nobody looks"]
        yield from (f"{who:18} {_ratios(found, alone)}" for who, found in turns.items() if found is not alone)
        yield f"load {os.getloadavg()[0]:.0f}"
        yield from _memory(site.config, site.port, minutes)


@contextmanager
def looking(who: str, config: Path) -> Iterator[int | None]:
    """Have somebody look, or nobody; give the page's process."""
    with ExitStack() as until_the_end:
        if who == "nobody looks":
            yield None
            return
        page = served("page", "--config", str(config))
        address = until_the_end.enter_context(page)
        if who == "page, a tab open":
            browser = opened(address, executable=str(giving_way(config.parent)))
            until_the_end.enter_context(browser).get_by_test_id("trend").wait_for()
        said = subprocess.run(["pgrep", "-f", f"page --config {config}"], capture_output=True, text=True, check=True)
        yield int(said.stdout)


def giving_way(folder: Path) -> Path:
    """Return a browser that gives way: a real one is on another machine, as a rule."""
    script = folder / "browser"
    script.write_text(f'#!/bin/sh\nexec nice -n 19 {CHROMIUM} "$@"\n')
    script.chmod(0o755)
    return script


def turn(port: int, daemon_pid: int, page_pid: int | None) -> Turn:
    """Move the valve for a while; return what that cost."""
    time.sleep(SETTLE_S)
    with Dcs("127.0.0.1", port) as dcs:
        dcs.set("mode", 2)
        names = ("cycles", "missed_periods")
        before, cpu_s = dcs.get_all(*names), (cpu(daemon_pid), cpu(page_pid))
        for move in range(round(TURN_S / MOVE_EVERY_S)):
            dcs.set("reference", 0.4 + 0.3 * (move % 2))
            time.sleep(MOVE_EVERY_S)
        after, spent_s = dcs.get_all(*names, "jitter_99", "cycle_time"), (cpu(daemon_pid), cpu(page_pid))
    cycles, missed = (after[name] - before[name] for name in names)
    daemon_cpu, page_cpu = ((late - early) / TURN_S for early, late in zip(cpu_s, spent_s, strict=True))
    return Turn(after["cycle_time"], after["jitter_99"], missed / (cycles + missed), daemon_cpu, page_cpu)


def cpu(pid: int | None) -> float:
    """Return the processor time that a process has taken, s."""
    if pid is None:
        return 0.0
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _row(found: list[Turn]) -> str:
    cycle_s, jitter_s, missed, daemon_cpu, page_cpu = (_median(found, name) for name in Turn.__slots__)
    times = f"{1e3 * cycle_s:9.3f}   {1e3 * jitter_s:15.3f}   {100 * missed:9.2f}"
    return f"{times}   {100 * daemon_cpu:15.1f}   {100 * page_cpu:13.1f}"


def _ratios(found: list[Turn], alone: list[Turn]) -> str:
    """Return ratios to nobody looking, and how far the turns of nobody looking lie apart themselves."""
    said = []
    for name, words in (("cycle_s", "cycle"), ("jitter_s", "jitter"), ("daemon_cpu", "daemon's CPU")):
        own = [getattr(each, name) for each in alone]
        spread = (max(own) - min(own)) / statistics.median(own)
        said.append(f"{words} x {_median(found, name) / _median(alone, name):.2f} (alone within {100 * spread:.0f} %)")
    own = [100 * each.missed for each in alone]
    more = 100 * (_median(found, "missed") - _median(alone, "missed"))
    said.append(f"missed {more:+.2f} points (alone {min(own):.2f} to {max(own):.2f})")
    return ", ".join(said)


def _median(found: list[Turn], name: str) -> float:
    return float(statistics.median(getattr(each, name) for each in found))


def _seen() -> Iterator[str]:
    """Yield how soon after it happened the browser shows what is not of now."""
    deaths: dict[str, tuple[Callable[[Site], object], str, float]] = {
        "the device is killed: fault": (lambda site: site.slave.kill(), "no reply", 1.0),
        "the daemon stands (SIGSTOP): greyed": (lambda site: site.daemon.signal(signal.SIGSTOP), "Not live", 1.0),
        "the daemon is killed: greyed": (lambda site: site.daemon.kill(), "Not live", 1.0),
        "the daemon is killed, a browser six times slower: greyed": (lambda site: site.daemon.kill(), "Not live", 6.0),
    }
    for what, (kill, shown, slower) in deaths.items():
        taken_s = []
        for _ in range(DEATHS):
            with tempfile.TemporaryDirectory() as name, valve_site(Path(name)) as site:
                page = served("page", "--config", str(site.config))
                with page as address, opened(address) as tab:
                    tab.get_by_test_id("figure-position").get_by_text("29.").wait_for()
                    tab.context.new_cdp_session(tab).send("Emulation.setCPUThrottlingRate", {"rate": slower})
                    time.sleep(SETTLE_S)
                    kill(site)
                    died_s = time.monotonic()
                    tab.get_by_text(shown).locator("visible=true").first.wait_for()
                    taken_s.append(time.monotonic() - died_s)
                with suppress(ProcessLookupError):
                    site.daemon.signal(signal.SIGCONT)
        load = os.getloadavg()[0]
        yield f"{what} after {min(taken_s):.2f} to {max(taken_s):.2f} s ({DEATHS} times), load {load:.0f}"


def _memory(config: Path, port: int, minutes: float) -> Iterator[str]:
    """Yield the resident memory of a page with a tab open, over minutes, the valve moved meanwhile."""
    with looking("page, a tab open", config) as pid, Dcs("127.0.0.1", port) as dcs:
        assert pid is not None
        seen = []
        for look in range(LOOKS):
            end_s = time.monotonic() + 60 * minutes / LOOKS
            while time.monotonic() < end_s:
                dcs.set("reference", 0.4 + 0.3 * (look % 2))
                time.sleep(1.0)
            seen.append(held_by(pid)[0])
        grown_kb = seen[-1] - seen[LOOKS // 2]
        yield f"page's memory after {minutes:g} min: {seen[-1] / 1024:.0f} MiB, second half {grown_kb:+d} kB"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=12.0, help="for which the page's memory is watched")
    for line in report(parser.parse_args().minutes):
        print(line, flush=True)
