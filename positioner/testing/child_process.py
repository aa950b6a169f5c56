"""A process of ours, beside whatever is called `config` or `sim` where it is started.

Python is started with -P, so that no folder of the caller's comes first, and with the folder of `positioner` at the
head of PYTHONPATH, so that what stands there cannot come first either. The standard library alone is used here.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

HOME = Path(__file__).resolve().parents[2]
CHILD_END_WITHIN_S = 10.0


class NotStarted(Exception):
    """A process of ours ended instead of getting ready; the text is the last line that it said."""


class NotDone(Exception):
    """What was asked for was refused, or could not be done; the text says why."""


class ChildProcess:
    """`python -m MODULE WORDS`, from its first line, which says that it is ready; its log is a file.

    Args:
        module, words: what is run.
        log: where its standard error goes.

    Raises:
        NotStarted: it ended before.
    """

    def __init__(self, module: str, *words: str, log: Path) -> None:
        path = os.pathsep.join(filter(None, (str(HOME), os.environ.get("PYTHONPATH", ""))))
        environment = {**os.environ, "PYTHONPATH": path}
        with log.open("w") as error:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *words],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=error,
                text=True,
                env=environment,
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._in, self._out = self._process.stdin, self._process.stdout
        try:
            self.ready = self._out.readline().strip()
        except BaseException:  # whoever waits for it is broken off, and nobody else can end it
            self.end()
            raise
        if not self.ready:
            self.end()
            said = log.read_text().strip().splitlines()
            raise NotStarted(said[-1] if said else "no word")

    def ask(self, call: str, **given: Any) -> Any:
        """Have it do something that it answers.

        Raises:
            NotDone: it could not.
        """
        try:
            self._in.write(json.dumps({"call": call, "given": given}) + "\n")
            self._in.flush()
        except BrokenPipeError:
            raise NotDone(f"{call}: the process that is asked has ended") from None
        line = self._out.readline()
        if not line:
            raise NotDone(f"{call}: the process that was asked ended")
        answer = json.loads(line)
        if "error" in answer:
            raise NotDone(answer["error"])
        return answer["value"]

    def kill(self) -> None:
        """End it as a loss of power does."""
        self._process.kill()
        self._process.wait()

    def end(self) -> None:
        """End it, at best as it is told to."""
        self._process.terminate()
        try:
            self._process.wait(CHILD_END_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self._out.close()
        with suppress(BrokenPipeError):
            self._in.close()


@contextmanager
def launch(module: str, *words: str, log: Path) -> Iterator[ChildProcess]:
    """Start a process of ours; make sure that it ends.

    Raises:
        NotStarted: it ended instead of getting ready.
    """
    process = ChildProcess(module, *words, log=log)
    try:
        yield process
    finally:
        process.end()


class Agent:
    """A process of ours that is asked, started at the first question, as many a test has none."""

    def __init__(self, module: str, *words: str, log: Path) -> None:
        self._words, self._log = (module, *words), log
        self._process: ChildProcess | None = None

    def ask(self, call: str, **given: Any) -> Any:
        """Have it do something that it answers.

        Raises:
            NotDone: it could not.
        """
        if self._process is None:
            self._process = ChildProcess(*self._words, log=self._log)
        return self._process.ask(call, **given)

    def end(self) -> None:
        """End it, where it was ever started."""
        if self._process is not None:
            self._process.end()


def port_in(ready: str) -> int:
    """Return the port at the end of a ready line."""
    return int(ready.rpartition(":")[2])
