"""A valve as an observer knows it, in virtual time."""

import math
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from config.codes import Fault, Mode, State
from config.modbus_map import MOST_REGISTERS, runs_within
from config.registers import BY_NAME, WRITER_AT
from northbound.observer.poller import COUNTS, EACH_TIME, LIVE, REST, names_of
from northbound.observer.trends import Trend, bands
from northbound.observer.valve_view import TREND_S, ValveView
from northbound.observer.waiting_reference import WAITS
from northbound.observer.watched_valves import Place, WatchedValve
from positioner.history.entries import HealthHour
from positioner.history.history_file import HistoryFile

STROKE_M = 0.1
POLL_S = 0.05


class Polled:
    """A view, and a daemon that it polls in virtual time."""

    def __init__(self) -> None:
        self.view = ValveView("FV-101", STROKE_M, POLL_S)
        self.time_s = 0.0
        self.values = dict.fromkeys(BY_NAME, 0.0) | {"mode": Mode.AUTOMATIC, "period": 1e-3, "position_m": 0.05}
        self.values["position_deg"] = math.nan

    def poll(self, seconds: float, **values: float) -> None:
        self.values |= values
        for _ in range(round(seconds / POLL_S)):
            self.time_s += POLL_S
            self.values["cycles"] += 1e3 * POLL_S
            self.view.take(self.time_s, dict(self.values))

    @property
    def events(self) -> list[str]:
        return [each.text for each in self.view.at(self.time_s).events]


def test_what_was_read_last_is_shown() -> None:
    polled = Polled()
    polled.poll(1.0)
    polled.view.take(1.01, {"fault": Fault.NO_REPLY})
    picture = polled.view.at(1.02)
    assert (picture.text("mode"), picture.text("fault"), picture.value("position_m")) == ("automatic", "no reply", 0.05)
    assert math.isnan(picture.value("no such"))
    assert picture.freshness.measured_live


def test_a_loss_is_a_gap_in_the_trend_and_an_event_once() -> None:
    polled = Polled()
    polled.poll(1.0)
    for _ in range(4):
        polled.time_s += 0.25
        polled.view.lose(polled.time_s, "no reply")
    polled.poll(1.0)
    assert polled.events == ["connected", "connection lost: no reply", "connected"]
    position_m = polled.view.trend(-math.inf)["position_m"]
    assert np.isnan(position_m[20:24]).all()
    assert np.isfinite(position_m).sum() == 40


def test_a_daemon_started_anew_is_an_event() -> None:
    polled = Polled()
    polled.poll(1.0)
    polled.view.lose(1.1, "away")
    polled.time_s = 2.0
    polled.poll(0.1, cycles=0.0)
    assert polled.events[0] == "the daemon has restarted"
    assert polled.view.at(polled.time_s).restarts == 1


def test_an_old_measurement_is_not_drawn_but_what_was_decided_is() -> None:
    polled = Polled()
    polled.poll(1.0)
    polled.poll(1.0, sample_age=5.0, position_m=0.09, reference_in_force=0.4)
    trend = polled.view.trend(1.01)
    assert np.isnan(trend["position_m"]).all()
    assert np.isnan(trend["pressure_pa"]).all()
    assert trend["reference_m"] == pytest.approx(0.04)


def test_nothing_of_a_cycle_that_stands_is_drawn() -> None:
    polled = Polled()
    polled.poll(1.0)
    for _ in range(60):
        polled.time_s += POLL_S
        polled.view.take(polled.time_s, dict(polled.values))
    trend = polled.view.trend(polled.time_s - 1.0)
    assert np.isnan(trend["state"]).all()


def test_changes_of_codes_and_counts_are_events_in_words() -> None:
    polled = Polled()
    polled.poll(0.1)
    polled.poll(0.1, fault=Fault.NO_REPLY, mode=Mode.HOLD)
    polled.poll(0.1, identifications=1.0)
    assert polled.events == [
        "an identification was applied",
        "fault: none -> no reply",
        "mode: automatic -> hold",
        "connected",
    ]


def test_friction_is_kept_a_row_a_minute() -> None:
    polled = Polled()
    for minute in range(3):
        polled.time_s = 60.0 * minute
        polled.poll(2.0, friction=18e3 + minute, friction_baseline=18e3)
    assert [row[1] for row in polled.view.friction] == [18e3, 18e3 + 1, 18e3 + 2]


def test_the_friction_of_before_is_that_of_the_daemons_history(tmp_path: Path) -> None:
    """Hours without friction, of another valve, or of a clock that ran ahead are left out; new readings follow."""
    now_s = int(time.time())
    hours = [(now_s - 7200, 6e3), (now_s - 3600, math.nan), (now_s - 1800, 7e3), (now_s + 9000, 8e3)]
    with closing(HistoryFile(tmp_path, 400.0, 100)) as file:
        for name, shift in (("FV 1", 0.0), ("FV 2", 1e3)):
            file.append([HealthHour(name, s, 0, 0.1, 2, 0.5, 3, pa + shift, 5e3, 4, 5, 6, 7, 8) for s, pa in hours])
    view = WatchedValve(Place("FV 1", "127.0.0.1", 1, 1, 0.1, history=tmp_path)).view
    assert [row[1] for row in view.friction] == [6e3, 7e3]
    view.take(time.monotonic(), {"friction": 7.1e3, "friction_baseline": 5e3})
    assert [row[1] for row in view.friction] == [6e3, 7e3, 7.1e3]
    assert WatchedValve(Place("FV 1", "127.0.0.1", 1, 1, 0.1, history=tmp_path / "none")).view.friction == ()


def test_the_stroke_follows_from_the_positions_where_nobody_said_it() -> None:
    view = ValveView("valve", None, POLL_S)
    assert math.isnan(view.stroke_m)
    view.take(0.0, {"position": 0.5, "position_m": 0.0508})
    assert view.stroke_m == pytest.approx(0.1016)


def test_a_trend_keeps_the_newest() -> None:
    trend = Trend(10)
    for number in range(25):
        trend.append(float(number), {"position_m": float(number)}, 1.0)
    kept = trend.since(17.0)
    assert kept["time_s"].tolist() == kept["position_m"].tolist() == [18.0, 19.0, 20.0, 21.0, 22.0, 23.0, 24.0]
    assert len(trend.since(-1.0)["time_s"]) == 10


def test_ten_minutes_are_kept() -> None:
    view = ValveView("valve", STROKE_M, TREND_S / 5)
    for number in range(8):
        view.lose(number * TREND_S / 5, "away")
    assert view.trend(-1.0)["time_s"].tolist() == [number * TREND_S / 5 for number in range(3, 8)]


def test_bands_end_where_the_next_begins_and_a_gap_is_none() -> None:
    state = np.array([0.0, 1.0, 1.0, math.nan, 3.0, 3.0, 9.0])
    found = [(each.begin_s, each.end_s, each.state) for each in bands(np.arange(7.0), state)]
    assert found == [(0.0, 1.0, State.S0_START), (1.0, 3.0, State.S1_UP), (4.0, 6.0, State.S3_IDENTIFY)]


def test_an_observer_reads_everything_and_what_is_live_every_time() -> None:
    assert {*LIVE, *names_of(0)} == set(BY_NAME)
    assert sorted((*LIVE, *EACH_TIME, *COUNTS, *REST)) == sorted(BY_NAME)
    assert set(WAITS) - set(LIVE) == {"mode"}, "compared with one another: of one cycle"
    assert len(list(runs_within({name: BY_NAME[name] for name in LIVE}, MOST_REGISTERS))) == 1
    read_in_a_second = [names_of(poll) for poll in range(1, 21)]
    assert all(set(EACH_TIME) <= set(names) for names in read_in_a_second)
    assert sum("friction" in names for names in read_in_a_second) == 1
    assert sum("cycles" in names for names in read_in_a_second) == 4
    assert WRITER_AT, "what may be written is read, never written"
