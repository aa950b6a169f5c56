"""What a command starts ends with it, however it is told to end."""

import io
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

from positioner.cli.parts import children
from positioner.cli.parts.children import running
from positioner.testing.child_process import ChildProcess


class Left(Exception):
    """The command would have ended at once."""


def left(_number: int, _: FrameType | None) -> None:
    raise Left


@contextmanager
def handled(
    number: signal.Signals, handler: Callable[[int, FrameType | None], None] | signal.Handlers
) -> Iterator[None]:
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What a child was asked for."""
    words: list[str] = []

    class Child:
        ready = "listening on 127.0.0.1:1"

        def __init__(self, *_: str, log: Path) -> None:
            words.append(log.name)

        def end(self) -> None:
            words.append("ended")

    monkeypatch.setattr(children, "ChildProcess", Child)
    return words


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_command_that_is_told_to_end_ends_what_it_has_started(
    number: signal.Signals, said: list[str], tmp_path: Path
) -> None:
    """`demo`, ended by `kill` or with its terminal, left a slave and a daemon behind that ran for ever."""
    with handled(number, left):
        with pytest.raises(SystemExit) as ended, running("sim", tmp_path / "slave.toml"):
            signal.raise_signal(number)
        assert ended.value.code == 128 + number
        assert said == ["slave.log", "ended"]
        with pytest.raises(Left):
            signal.raise_signal(number)


def test_a_signal_that_is_ignored_stays_so(said: list[str], tmp_path: Path) -> None:
    """As `nohup` has it."""
    with handled(signal.SIGHUP, signal.SIG_IGN), running("sim", tmp_path / "slave.toml"):
        signal.raise_signal(signal.SIGHUP)
        assert said == ["slave.log"]


def test_who_is_broken_off_while_waiting_for_a_process_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[str] = []

    class Silent(io.StringIO):
        def readline(self, _: int = -1, /) -> str:  # type: ignore[override]
            raise KeyboardInterrupt

    class Process:
        stdin, stdout = io.StringIO(), Silent()

        def __init__(self, *_: object, **__: object) -> None:
            ended.clear()

        def terminate(self) -> None:
            ended.append("told")

        def wait(self, _: float) -> None:
            ended.append("waited for")

    monkeypatch.setattr(subprocess, "Popen", Process)
    with pytest.raises(KeyboardInterrupt):
        ChildProcess("sim", log=tmp_path / "log")
    assert ended == ["told", "waited for"]
