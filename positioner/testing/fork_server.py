"""In a process of its own: forks the others off, having loaded what takes them a second each.

    python -P -m positioner.testing.fork_server SOCKET

What it is asked comes over the socket, four bytes of length and JSON: {"module", "words", "environment", "folder"} with
three descriptors is a process to be, answered by its number; {"wait", "within_s"} by whether that process has ended.
When nobody can ask any more, all that it forked is told to end.
"""

import importlib
import json
import os
import runpy
import signal
import socket
import sys
import time
from contextlib import suppress
from typing import Any

LENGTH_BYTES = 4  # bytes before a message
LOADED = (
    "positioner.cli.main",
    "positioner.daemon.service",
    "positioner.testing.agent",
    "drivers.modbus_tcp",
    "sim.slave.slave",
    "sim.slave.kernel_preloading",
)
CHILD_LOOK_EVERY_S = 0.005


def main(line: socket.socket) -> None:
    """Fork until nobody asks; in what was forked, be what was asked for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks decides what it ends
    for name in LOADED:
        with suppress(ImportError):  # told by the process that needs it
            importlib.import_module(name)
    living: set[int] = set()
    while received := _receive(line):
        asked, descriptors = received
        if "wait" in asked:
            _say(line, _has_ended(asked["wait"], asked["within_s"], living))
            continue
        process = os.fork()
        if not process:
            line.close()
            return _become(asked, descriptors)
        living.add(process)
        for each in descriptors:
            os.close(each)
        _say(line, process)
    for each in living:
        os.kill(each, signal.SIGTERM)
    return None


def _receive(line: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    head, descriptors, _, _ = socket.recv_fds(line, LENGTH_BYTES, 3)
    if not head:
        return None
    text = line.recv(int.from_bytes(head), socket.MSG_WAITALL)
    return json.loads(text), descriptors


def _say(line: socket.socket, answer: int) -> None:
    line.sendall(answer.to_bytes(LENGTH_BYTES))


def _has_ended(process: int, within_s: float, living: set[int]) -> bool:
    """Wait for a process; until it was waited for, its number is nobody else's."""
    end_s = time.monotonic() + within_s
    while process in living:
        if os.waitpid(process, os.WNOHANG)[0]:
            living.discard(process)
        elif time.monotonic() > end_s:
            return False
        else:
            time.sleep(CHILD_LOOK_EVERY_S)
    return True


def _become(asked: dict[str, Any], descriptors: list[int]) -> None:
    for standard, each in enumerate(descriptors):
        os.dup2(each, standard)
        os.close(each)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(asked["environment"])
    os.chdir(asked["folder"])
    sys.argv = [asked["module"], *asked["words"]]
    runpy.run_module(asked["module"], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main(socket.socket(fileno=int(sys.argv[1])))
