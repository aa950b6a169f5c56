"""Processes forked off one that has loaded all they need: a fiftieth of a second each, in place of one.

The first that is asked for starts that one (`positioner.testing.fork_server`), which ends with this process. The
standard library alone is used here, as in `child_process`. multiprocessing's own fork server is not: it hands on the
search path and the main module of the caller, in which somebody else's `config` may come first.
"""

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from threading import Lock
from typing import IO, Any

from positioner.testing.fork_server import LENGTH_BYTES

FOREVER_S = 1e9


class Forked:
    """A process, as far as a `subprocess.Popen` is needed."""

    def __init__(self, server: "ForkServer", number: int, stdin: IO[str], stdout: IO[str]) -> None:
        self._server, self._number = server, number
        self.stdin, self.stdout = stdin, stdout

    def terminate(self) -> None:
        """Tell it to end."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self._signal(signal.SIGKILL)

    def wait(self, timeout: float = FOREVER_S) -> None:
        """Wait until it has ended.

        Raises:
            subprocess.TimeoutExpired: it has not within that time, s.
        """
        if self._number and not self._server.ask({"wait": self._number, "within_s": timeout}):
            raise subprocess.TimeoutExpired(str(self._number), timeout)
        self._number = 0

    def _signal(self, number: signal.Signals) -> None:
        if self._number:
            os.kill(self._number, number)


class ForkServer:
    """The process that they are forked off."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._line, theirs = socket.socketpair()
        self._one_at_a_time = Lock()
        number = theirs.fileno()
        words = [sys.executable, "-P", "-m", "positioner.testing.fork_server", str(number)]
        # One thread: to fork a process of several is not safe, and no valve has matrices that need more.
        alone = {**environment, "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(words, stdin=subprocess.DEVNULL, pass_fds=[number], env=alone)
        theirs.close()
        atexit.register(self._end)

    def start(self, module: str, words: Sequence[str], environment: Mapping[str, str], error: IO[str]) -> Forked:
        """Start `python -m MODULE WORDS`; its standard error goes to a file."""
        its_in, our_out = os.pipe()
        our_in, its_out = os.pipe()
        request = {"module": module, "words": words, "environment": dict(environment), "folder": os.getcwd()}
        number = self.ask(request, (its_in, its_out, error.fileno()))
        for each in (its_in, its_out):
            os.close(each)
        return Forked(self, number, os.fdopen(our_out, "w"), os.fdopen(our_in))

    def ask(self, request: Mapping[str, Any], descriptors: Sequence[int] = ()) -> int:
        """Return the answer to a request."""
        text = json.dumps(request).encode()
        with self._one_at_a_time:
            socket.send_fds(self._line, [len(text).to_bytes(LENGTH_BYTES)], list(descriptors))
            self._line.sendall(text)
            return int.from_bytes(self._line.recv(LENGTH_BYTES, socket.MSG_WAITALL))

    def _end(self) -> None:
        self._line.close()
        self._process.wait()


@cache
def fork_server(path: str) -> ForkServer:
    """Return the one whose Python looks for modules there first."""
    return ForkServer({**os.environ, "PYTHONPATH": path})
