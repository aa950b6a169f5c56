"""An experiment that whoever plays it breaks off: a veto ends it, whatever became of the connection."""

from collections.abc import Callable, Iterator
from threading import Event, Thread
from typing import Any

import pytest

from config.codes import ExperimentState
from fieldbus.modbus.server import RegisterServer
from positioner.dcs import Dcs, DcsError
from tests.daemon.panel import Panel

LONG = ((0.0, 30e3), (900.0, 30e3), (901.0, 40e3))


class Site:
    """A daemon's registers on the wire, its cycle turned by a thread."""

    def __init__(self) -> None:
        self.panel = Panel({"experiment": {"limit_s": 1e3}})
        self.server = RegisterServer(self.panel.registers, "127.0.0.1", 0, 1)
        self._stop = Event()
        self._thread = Thread(target=self._turn)

    def __enter__(self) -> "Site":
        self.panel.set("mode", 2)
        self.panel.run()
        self.panel.set("experiment_consent", 1)
        self.server.start()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self.server.stop()

    def _turn(self) -> None:
        while not self._stop.is_set():
            self.panel.cycle.turn()


@pytest.fixture
def site() -> Iterator[Site]:
    with Site() as site:
        yield site


def played_until(site: Site, monkeypatch: pytest.MonkeyPatch, happens: Callable[[], None]) -> BaseException:
    """Play; under way, `happens` comes before one reply is waited for. Return what ended it."""
    with Dcs("127.0.0.1", site.server.port) as dcs:
        line, left = dcs.client.line, [happens]

        class Watched:
            """The line to the daemon."""

            def __getattr__(self, name: str) -> Any:
                return getattr(line, name)

            def recv(self, most: int) -> bytes:
                if left and site.panel.get("experiment_state") == ExperimentState.UNDER_WAY:
                    left.pop()()
                assert line is not None
                return line.recv(most)

        monkeypatch.setattr(dcs.client, "line", Watched())
        with pytest.raises((KeyboardInterrupt, DcsError)) as ended:
            dcs.play(LONG, 5.0)
    return ended.value


def interrupted() -> None:
    raise KeyboardInterrupt


def test_ctrl_c_while_a_reply_is_waited_for_vetoes_all_the_same(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(played_until(site, monkeypatch, interrupted), KeyboardInterrupt)
    assert site.panel.get("experiment_state") == ExperimentState.VETOED
    assert site.panel.get("experiment_veto") == 0


def test_a_veto_of_somebody_else_is_not_taken_back_by_ctrl_c(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    def vetoed_and_interrupted() -> None:
        site.panel.set("experiment_veto", 1)
        raise KeyboardInterrupt

    assert isinstance(played_until(site, monkeypatch, vetoed_and_interrupted), KeyboardInterrupt)
    assert site.panel.get("experiment_veto") == 1


def test_where_no_veto_gets_there_it_is_said_why_one_was_wanted(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    error = played_until(site, monkeypatch, site.server.stop)
    assert isinstance(error, DcsError)
    assert "cannot be read: the connection is closed; no veto got there" in str(error)
