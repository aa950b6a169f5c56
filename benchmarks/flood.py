"""What clients of the supervisory port cost the cycle: `python -m benchmarks.flood [--seconds 10] [--clients 200]`.

Slave and daemon as processes at 1 kHz. In turn there is nobody but the DCS; and beside it 200 clients of other hosts of
the loopback, that ask without end, write what is refused, never read, send a byte at a time, say nothing. They run on a
core of their own, as on other machines, where there are two; without them another program keeps that core as busy, for
it may share a processor with the other: what is seen is what serving them costs, not their own processor time.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

from benchmarks.endurance import held_by
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from tests.children import child, running
from tests.daemon.test_flood import SITE, besieged

DAEMON = f"""[valve]
stroke_m = 0.1016
[device]
port = {{port}}
reply_timeout_s = 0.5
[safety]
stale_after_s = 1.0
[supervisory]
port = 0
{SITE}"""
TURNS = 3


def rows(seconds: float, clients: int) -> Iterator[str]:
    """Yield the table."""
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as made, ExitStack() as stack:
        os.sched_setaffinity(0, set(cores[:-1]) or set(cores))  # of slave and daemon, which inherit it
        folder = Path(made)
        (folder / "slave.toml").write_text("[sensor]\nnoise_std_m = 1e-5\n")
        slave = stack.enter_context(running("sim", folder / "slave.toml", "--listen-port", "0"))
        (folder / "daemon.toml").write_text(DAEMON.format(port=port_in(slave)))
        process, ready = stack.enter_context(child("run", folder / "daemon.toml"))
        port = port_in(ready)
        os.sched_setaffinity(0, {cores[-1]})  # of the clients and the DCS
        head = ("clients", "periods missed, %", "jitter, 99 %, ms", "answers to the DCS a second", "memory, kB")
        yield f"| {' | '.join(head)} |\n|{'---|' * len(head)}"
        for turn in range(2 * TURNS):
            count = clients * (turn % 2)
            with Dcs("127.0.0.1", port, timeout_s=30.0) as dcs, besieged(port, count) if count else busy():
                yield _row(dcs, process.pid, count, seconds)


@contextmanager
def busy() -> Iterator[None]:
    """Keep the core that this process runs on busy."""
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as process:
        try:
            yield
        finally:
            process.kill()


def _row(dcs: Dcs, pid: int, clients: int, seconds: float) -> str:
    time.sleep(seconds / 4)
    before, answers, jitters = dcs.get_all("cycles", "missed_periods"), 0, []
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        jitters.append(dcs.get("jitter_99"))
        answers += 1
    after = dcs.get_all("cycles", "missed_periods")
    missed, cycles = (after[name] - before[name] for name in ("missed_periods", "cycles"))
    share = 100.0 * missed / max(missed + cycles, 1.0)
    return f"| {clients} | {share:.2f} | {1e3 * median(jitters):.2f} | {answers / seconds:.0f} | {held_by(pid)[0]} |"


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--seconds", type=float, default=10.0)
    arguments.add_argument("--clients", type=int, default=200)
    given = arguments.parse_args()
    for line in rows(given.seconds, given.clients):
        print(line, flush=True)
