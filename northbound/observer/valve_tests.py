"""Tests on a running valve, as whoever watches it begins them: the command of each, in a process of its own.

A test takes the consent of whoever begins it, `experiment_consent`, and gives it back at the end if it was not there
before. Breaking one off ends the command, which vetoes what is played, waits until the law has the valve, and keeps a
record; so does a page that ends.
"""

import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from config.errors import CommandFailed, InputError
from config.roles import Role
from northbound.observer.valve_commands import Confirmation, refusal_for

if TYPE_CHECKING:
    from northbound.observer.watched_valves import Place

TESTS: Mapping[str, tuple[str, ...]] = {
    "partial stroke": ("pst",),
    "partial stroke, a step": ("pst", "--step"),
    "continuous stroke": ("cst",),
    "small steps": ("steps",),
    "signature": ("signature",),
}
"""The commands, by what people call the tests."""
KEPT_AS: Mapping[str, str] = {"": "not kept, only its trend", "as_found": "as found", "as_left": "as left"}
COMMAND = (sys.executable, "-m", "positioner.cli")
TEST_END_WITHIN_S = 10.0


class ValveTests:
    """The tests of one valve, one at a time."""

    def __init__(self, place: "Place") -> None:
        self._place = place
        self._under_way = Lock()
        self._process: subprocess.Popen[str] | None = None

    def problem(self) -> str:
        """Say why no test can be begun here; empty where one can."""
        place = self._place
        if place.file is None or place.settings is None:
            return "a test needs the daemon's file: positioner page --config"
        if place.settings.recorder is None:
            return f"a test needs [recorder] in {place.file.name}"
        return ""

    def run(self, role: Role, test: str, kind: str, show: Callable[[str], None]) -> Confirmation:
        """Play a test to its end, and return what came of it.

        Args:
            role: of who begins it, and consents.
            test: one of `TESTS`.
            kind: one of `KEPT_AS`.
            show: given what the command has said so far.
        """
        if problem := refusal_for(role, "experiment_consent") or self.problem():
            return Confirmation(False, problem)
        if not self._under_way.acquire(blocking=False):
            return Confirmation(False, "a test is under way already")
        try:
            with self._consent_meanwhile(role):
                status, said = self._play([*TESTS[test], *self._words(role, kind)], show)
        except (CommandFailed, InputError) as failed:
            return Confirmation(False, str(failed))
        finally:
            self._under_way.release()
        return Confirmation(status == 0, _in_short(said, test))

    def report(self, out: Path) -> Confirmation:
        """Write the report of the valve as found and as left."""
        if problem := self.problem():
            return Confirmation(False, problem)
        done = subprocess.run(
            [*COMMAND, "report", *self._which(), "-o", str(out)], capture_output=True, text=True, check=False
        )
        return Confirmation(done.returncode == 0, (done.stdout or done.stderr).strip())

    def break_off(self) -> None:
        """Break off the test that is under way, if one is."""
        process = self._process
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGTERM)

    def end(self) -> None:
        """Break it off, and wait until the law has its command back."""
        self.break_off()
        if self._under_way.acquire(timeout=TEST_END_WITHIN_S):
            self._under_way.release()

    def _which(self) -> list[str]:
        return [str(self._place.file), "--valve", self._place.name]

    def _words(self, role: Role, kind: str) -> Sequence[str]:
        tls = self._place.tls_of.get(role)
        secured = () if tls is None else ("--tls", str(tls.authority), str(tls.certificate), str(tls.key))
        return [*self._which(), *(("--keep", kind) if kind else ()), *secured]

    @contextmanager
    def _consent_meanwhile(self, role: Role) -> Iterator[None]:
        """Consent for as long as the context lasts, or longer where somebody had consented before."""
        with self._place.connection(role) as dcs:
            if dcs.get("experiment_consent"):
                yield
                return
            dcs.set_and_read_back("experiment_consent", 1)
        try:
            yield
        finally:
            with self._place.connection(role) as dcs:
                dcs.set("experiment_consent", 0)

    def _play(self, words: Sequence[str], show: Callable[[str], None]) -> tuple[int, str]:
        said = ""
        with subprocess.Popen(
            [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, encoding="utf-8"
        ) as self._process:
            assert self._process.stdout is not None
            for line in self._process.stdout:
                said += line
                show(said)
        return self._process.returncode, said


def _in_short(said: str, test: str) -> str:
    """Return the line that says the verdict, or else the last one."""
    verdict = re.search(r"^[a-z ]+ of .+: .+$", said, re.MULTILINE)
    return verdict[0] if verdict else (said.splitlines() or [test])[-1]
