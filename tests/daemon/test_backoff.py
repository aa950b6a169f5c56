"""How often a device that is away is asked, alone on its line or behind a gateway that others need too."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest

from config.codes import Quality
from config.daemon_file import load_valves
from drivers import driver_for
from drivers.boundary import NoReply
from positioner.daemon import link as room
from positioner.daemon.backoff import Backoff
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.pacing import DevicePace
from tests.daemon.test_link import Scripted, Stopwatch, reading

WAITS_S = 0.5
"""Of an attempt to reach a device that does not answer."""
GATEWAY_WAITS_S = 0.2
"""For a unit that does not answer."""


def attempts_s(backoff: Backoff, took_s: float, until_s: float) -> list[float]:
    """Return when something is tried that never succeeds."""
    tried, now_s = [], 0.0
    while now_s < until_s:
        if backoff.may_try(now_s):
            tried.append(now_s)
            now_s += took_s
            backoff.failed(now_s, took_s)
        now_s += 2e-3
    return tried


@pytest.mark.parametrize(("longest_s", "shared"), [(1.0, False), (60.0, True), (5.0, True)])
def test_it_is_asked_ever_more_seldom_in_the_end_as_often_as_the_file_says(longest_s: float, shared: bool) -> None:
    tried = attempts_s(Backoff(longest_s, shared=shared), WAITS_S, 8 * longest_s + 20)
    gaps = [round(after - before - WAITS_S, 2) for before, after in pairwise(tried)]
    assert gaps == sorted(gaps)
    assert gaps[-1] == pytest.approx(longest_s, abs=0.02)


def test_on_a_line_that_is_shared_attempts_take_a_tenth_of_its_time_from_the_first_on() -> None:
    for until_s in (1.0, 5.0, 60.0, 300.0):
        busy_s = WAITS_S * len(attempts_s(Backoff(60.0, shared=True), WAITS_S, until_s))
        assert busy_s <= max(WAITS_S, 0.1 * (until_s + WAITS_S))
    assert len(attempts_s(Backoff(60.0), WAITS_S, 2.0)) == 4, "alone it is asked again at once"


FLEET = """
[cycle]
period_s = 0.05
[[valve]]
name = "FV-1"
unit = 1
stroke_m = 0.1
device = {{ host = "127.0.0.1", port = {port}, unit = 1, reply_timeout_s = 1.0 {more} }}
[[valve]]
name = "FV-2"
unit = 2
stroke_m = 0.1
device = {{ host = "127.0.0.1", port = {other_port}, unit = 2, reply_timeout_s = 1.0 {more} }}
"""


@pytest.mark.parametrize(
    ("other_port", "more", "retry_s"),
    [(5020, "", 60.0), (5021, "", 1.0), (5020, ", retry_every_s = 600.0", 600.0), (5021, ", shared_line = true", 60.0)],
)
def test_units_at_one_address_share_its_line(tmp_path: Path, other_port: int, more: str, retry_s: float) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(FLEET.format(port=5020, other_port=other_port, more=more))
    settings = [LinkSettings.of(each, 0.0) for each in load_valves(file)]
    assert [each.retry_every_s for each in settings] == [retry_s] * 2
    shared = other_port == 5020 or "shared" in more
    assert [each.on_shared_line for each in settings] == [shared] * 2


class Gateway:
    """To one serial line: one request at a time from all connections. Unit 1 answers, no other does."""

    def __init__(self) -> None:
        self._line = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.asked_in_vain = self._samples = 0
        self.command = struct.pack(">f", 50e3)
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(line,), daemon=True).start()

    def _serve(self, line: socket.socket) -> None:
        with line, suppress(OSError):
            while len(header := line.recv(7, socket.MSG_WAITALL)) == 7:
                transaction, _, length, unit = struct.unpack(">HHHB", header)
                request = line.recv(length - 1, socket.MSG_WAITALL)
                with self._line:
                    reply = self._asked(unit, request)
                line.sendall(struct.pack(">HHHB", transaction, 0, len(reply) + 1, unit) + reply)

    def _asked(self, unit: int, request: bytes) -> bytes:
        if unit != 1:
            self.asked_in_vain += 1
            time.sleep(GATEWAY_WAITS_S)
            return bytes((request[0] | 0x80, 11))
        if request[0] == 23:
            self.command = request[10:]
        if request[0] == 16:
            return request[:5]
        self._samples += 1
        words = {0: struct.pack(">ffIQ", 0.05, 50e3, self._samples, 1000 * self._samples), 11: self.command}
        address, count = struct.unpack_from(">HH", request, 1)
        data = (words.get(address, b"") + bytes(2 * count))[: 2 * count]
        return bytes((request[0], len(data))) + data


@pytest.fixture
def gateway() -> Iterator[Gateway]:
    gateway = Gateway()
    yield gateway
    gateway.close()


@pytest.mark.real_time
def test_a_dead_unit_behind_a_gateway_leaves_the_good_one_its_control(gateway: Gateway, tmp_path: Path) -> None:
    """It was asked four times at once, and then every second, for ever: half of the line's time."""
    path = tmp_path / "fleet.toml"
    path.write_text(FLEET.format(port=gateway.port, other_port=gateway.port, more=""))
    settings = [LinkSettings.of(each, 0.0) for each in load_valves(path)]
    drivers = [driver_for(each.device) for each in load_valves(path)]
    good, dead = (Link(driver, DevicePace(), of) for driver, of in zip(drivers, settings, strict=True))
    good.open()
    ended = threading.Event()

    def ask_the_dead() -> None:
        while not ended.is_set():
            dead.exchange(50e3)
            time.sleep(1e-3)

    asking = threading.Thread(target=ask_the_dead)
    asking.start()
    late = 0
    end_s = time.monotonic() + 7 * GATEWAY_WAITS_S
    qualities = []
    while time.monotonic() < end_s:
        begin_s = time.monotonic()
        qualities.append(good.exchange(50e3).quality)
        late += time.monotonic() - begin_s > 0.5 * GATEWAY_WAITS_S
        time.sleep(0.01)
    ended.set()
    asking.join()
    good.release()
    dead.release()
    assert gateway.asked_in_vain == 1, "the next is after nine times as long as this took"
    assert set(qualities) == {Quality.GOOD}
    assert late <= gateway.asked_in_vain


def test_a_device_that_was_never_away_is_not_back(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The first start logged "device is back", for the set-up had taken longer than a device may be left alone."""
    caplog.set_level("INFO", logger=room.__name__)
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1), reading(3), NoReply("silent"), NoReply("silent"), held_pa=5e4)
    link = Link(driver, DevicePace(), LinkSettings(longest_unattended_s=0.5))
    link.open()
    link.exchange(5e4)
    clock.now_s += 0.7
    link.begin()
    driver.shown = reading(2)
    for _ in range(3):
        link.exchange(5e4)
    assert [each.message for each in caplog.records] == ["device is looked at after the set-up", "no good reply"]
    driver.shown = reading(9)
    link.exchange(5e4)
    assert caplog.records[-1].message == "device is back"


def test_a_device_that_was_not_there_at_the_start_is_there_and_not_back(caplog: pytest.LogCaptureFixture) -> None:
    driver = Scripted()
    driver.shown = NoReply("silent")
    link = Link(driver, DevicePace())
    with pytest.raises(NoReply):
        link.open()
    driver.shown = reading(1)
    assert link.exchange(5e4).quality is Quality.GOOD
    assert caplog.records[-1].message == "device is there"
