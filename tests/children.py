"""Slave and daemon as processes of their own, forked off one that has loaded all they need.

To start from nothing takes a processor a second for a slave and half of one for a daemon, and what they do from then on
is the same. That the commands do start from nothing is tested in tests/slave/test_slave_process.py, with the demo in
tests/cli/test_demo.py, and in tests/library/test_foreign_packages.py.
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import NamedTuple

from positioner.cli.main import main

END_WITHIN_S = 60.0
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(
    [
        "sim.slave.slave",
        "sim.slave.canopen_slave",
        "positioner.daemon.service",
        "drivers.modbus_tcp",
        "drivers.modbus_rtu",
        "drivers.canopen.driver",
        "tests.kernel_preloading",
    ]
)


class Ended(NamedTuple):
    """Exit status (of a signal, its number, negative), and all that was said."""

    status: int | None
    out: str
    log: str


class Child:
    """`positioner COMMAND CONFIG` in a process; its log goes to a file beside the config.

    Those that start processes themselves are to be closed: they do not end by themselves with the tests.
    """

    def __init__(self, command: str, config: Path, *options: str, starts_others: bool = False) -> None:
        self._log = config.with_suffix(".log")
        self._log.unlink(missing_ok=True)
        heard, said = FORKS.Pipe(duplex=False)
        words = [command, str(config), *options]
        self._process: ForkServerProcess = FORKS.Process(
            target=_work, args=(words, self._log, said), daemon=not starts_others
        )
        self._process.start()
        said.close()
        with heard:
            self._out = os.fdopen(os.dup(heard.fileno()), encoding="utf-8")

    @property
    def pid(self) -> int:
        """Its number."""
        assert self._process.pid is not None
        return self._process.pid

    def line(self) -> str:
        """Return its next line; empty when it has ended."""
        return self._out.readline().strip()

    def signal(self, number: signal.Signals) -> None:
        """Send it a signal."""
        os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it, and wait until it is gone."""
        self._process.kill()
        self._process.join()

    def ended(self) -> Ended:
        """Wait until it ends by itself."""
        self._process.join(END_WITHIN_S)
        assert self._process.exitcode is not None, "it does not end"
        return Ended(self._process.exitcode, self._out.read(), self._log.read_text())

    def close(self) -> None:
        """Make sure that it has ended, at best as it is told to."""
        self._process.terminate()
        self._process.join(END_WITHIN_S)
        self.kill()
        self._out.close()


def _work(words: list[str], log: Path, said: Connection) -> None:
    """Be the command, with the standard output and error of its own."""
    os.dup2(said.fileno(), sys.stdout.fileno())
    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), sys.stderr.fileno())
    said.close()
    sys.exit(main(words))


@contextmanager
def child(command: str, config: Path, *options: str) -> Iterator[tuple[Child, str]]:
    """Run it until its first line, which says that it is ready; make sure that it ends."""
    process = Child(command, config, *options)
    try:
        ready = process.line()
        assert ready, process.ended()
        yield process, ready
    finally:
        process.close()


@contextmanager
def running(command: str, config: Path, *options: str) -> Iterator[str]:
    """Run it, and give its first line, which says that it is ready."""
    with child(command, config, *options) as (_, ready):
        yield ready


def ended(command: str, config: Path, *options: str) -> Ended:
    """Run it until it ends by itself."""
    process = Child(command, config, *options)
    try:
        return process.ended()
    finally:
        process.close()
