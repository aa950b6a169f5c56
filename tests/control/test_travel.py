"""From the signal to the reference: characteristics and inverses, split range, low-pass, ramp, cut-offs, dead band."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from config.codes import Mode, Refusal
from config.daemon_file import DaemonFile
from config.errors import InputError
from config.loading import validate
from config.slave_file import SlaveFile
from config.travel_table import TravelTable
from config.valve_file import shipped_valve
from positioner.control.requests import QUIET, Requests
from positioner.control.travel.cutoffs import HIGH, LOW, WITHIN, Cutoffs
from positioner.control.travel.dead_band import DeadBand
from positioner.control.travel.reference_ramp import Course, OnCourse
from positioner.control.travel.signal_path import SignalPath
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimate, no_estimate
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.slave.slave import device_of
from tests.daemon.panel import Panel

POINTS = [[0.0, 0.02], [0.3, 0.05], [0.31, 0.6], [1.0, 0.98]]
STROKE_M = 0.1


def drawn_polygon(seed: int) -> list[list[float]]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 21))
    signals, openings = (np.cumsum(rng.uniform(0.01, 1.0, count)) for _ in range(2))
    signals = (signals - signals[0]) / (signals[-1] - signals[0])
    return [[float(s), float(h)] for s, h in zip(signals, openings / openings[-1], strict=True)]


TABLES = [
    {"characteristic": "linear"},
    *(
        {"characteristic": name, "rangeability": r}
        for name in ("equal_percentage", "quick_opening")
        for r in (5, 50, 200)
    ),
    {"characteristic": "polygon", "polygon": POINTS},
    *({"characteristic": "polygon", "polygon": drawn_polygon(seed)} for seed in range(5)),
]


@pytest.fixture(params=TABLES, ids=lambda each: f"{each['characteristic']}")
def characteristic(request: pytest.FixtureRequest) -> SignalPath:
    return SignalPath.of(TravelTable.model_validate(request.param))


def test_a_characteristic_rises_stays_within_and_is_undone(characteristic: SignalPath) -> None:
    signals = np.linspace(0.0, 1.0, 1001).tolist()
    openings = [characteristic.opening(each) for each in signals]
    assert all(before < after for before, after in pairwise(openings))
    assert 0.0 <= openings[0] < openings[-1] <= 1.0
    assert [characteristic.signal(each) for each in openings] == pytest.approx(signals, abs=1e-9)
    there_and_back = [characteristic.opening(characteristic.signal(each)) for each in openings]
    assert there_and_back == pytest.approx(openings, abs=1e-12)


def test_they_are_what_they_are_called() -> None:
    equal, quick = (
        SignalPath.of(TravelTable(characteristic=name, rangeability=50.0))
        for name in ("equal_percentage", "quick_opening")
    )
    assert (equal.opening(0.0), equal.opening(1.0)) == (0.0, 1.0)
    slope = [equal.opening(s + 0.01) - equal.opening(s) for s in (0.2, 0.4, 0.6)]
    assert slope[1] / slope[0] == pytest.approx(slope[2] / slope[1]), "equal steps, equal percentages"
    assert slope[1] / slope[0] == pytest.approx(50.0**0.2)
    assert quick.opening(0.1) > 0.4
    assert quick.opening(0.3) == pytest.approx(equal.signal(0.3))


@pytest.mark.parametrize("ends", [(0.0, 1.0), (0.5, 1.0), (0.0, 0.45), (1.0, 0.0), (0.6, 0.1)])
def test_a_split_range_is_gone_through_once_and_held_beyond(ends: tuple[float, float]) -> None:
    path = SignalPath.of(TravelTable(split_range=ends, characteristic="equal_percentage"))
    closed, opened = ends
    assert (path.opening(closed), path.opening(opened)) == (0.0, 1.0)
    rising = 1 if opened > closed else -1
    openings = [path.opening(each) for each in np.linspace(0.0, 1.0, 301)][::rising]
    assert openings == sorted(openings)
    assert (openings[0], openings[-1]) == (0.0, 1.0)
    for opening in (-0.3, 0.0, 0.2, 0.9, 1.0, 1.4):
        assert path.opening(path.signal(opening)) == pytest.approx(min(max(opening, 0.0), 1.0), abs=1e-12)


def course_of(**travel: object) -> Course:
    tables = {"valve": {"stroke_m": STROKE_M, "action": travel.pop("action", "air_to_open")}, "travel": travel}
    course = Course.of(DaemonFile.model_validate(tables))
    assert course is not None
    return course


def gone(course: Course, begun: OnCourse, to_m: float, times_s: list[float]) -> list[OnCourse]:
    went = [begun]
    for now_s in times_s:
        went.append(course.after(went[-1], now_s, went[-1].reference_m, to_m))
    return went


@pytest.mark.parametrize("action", ["air_to_open", "air_to_close"])
def test_each_direction_has_its_ramp_whatever_air_does(action: str) -> None:
    course = course_of(ramp_opening_s=10.0, ramp_closing_s=40.0, action=action)
    travel = DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M, "action": action}}).valve.travel
    for start, end, within_s in ((0.2, 0.7, 5.0), (0.7, 0.2, 20.0)):
        begun, to_m = OnCourse.begun(travel.stem_m(start), 0.0), travel.stem_m(end)
        almost, there = (gone(course, begun, to_m, [k * within_s])[-1].reference_m for k in (0.99, 1.001))
        assert almost != to_m
        assert there == to_m


def test_a_course_is_monotone_stays_between_arrives_and_does_not_hang_on_the_period() -> None:
    course = course_of(ramp_opening_s=5.0, ramp_closing_s=3.0, low_pass_s=0.7)
    rng = np.random.default_rng(4)
    for _ in range(20):
        start_m, to_m = rng.uniform(0.0, STROKE_M, 2).tolist()
        times_s = np.cumsum(rng.uniform(0.0, 0.1, 600)).tolist()
        went = [each.reference_m for each in gone(course, OnCourse.begun(start_m, 0.0), to_m, times_s)]
        assert went[0] == start_m
        assert sorted(went, reverse=to_m < start_m) == went
        assert went[-1] == to_m, "the low-pass has an end"
    low_pass = course_of(low_pass_s=2.0)
    fine, coarse = (
        gone(low_pass, OnCourse.begun(0.0, 0.0), 0.05, np.arange(step_s, 3.0001, step_s).tolist())[-1].reference_m
        for step_s in (0.01, 1.0)
    )
    assert fine == pytest.approx(coarse, rel=1e-9) == pytest.approx(0.05 * (1 - np.exp(-1.5)), rel=1e-9)


def test_a_course_begins_where_the_reference_in_force_is() -> None:
    course = course_of(ramp_opening_s=10.0, low_pass_s=1.0)
    elsewhere = OnCourse(0.09, 0.09, 5.0)
    assert course.after(elsewhere, 5.1, 0.02, 0.03).reference_m == pytest.approx(0.02, abs=0.0011)


def test_hysteresis_lets_no_noise_of_the_reference_chatter() -> None:
    cutoffs = Cutoffs(low_m=0.01, high_m=0.09, hysteresis_m=0.002)
    rng = np.random.default_rng(1)
    for edge_m, beyond in ((0.01, LOW), (0.09, HIGH)):
        seen = [WITHIN]
        for reference_m in edge_m + rng.uniform(-0.00099, 0.00099, 500):
            seen.append(cutoffs.after(seen[-1], reference_m))
        assert sum(a != b for a, b in pairwise(seen)) == 1, "pressed on once"
        back_m = edge_m + (0.0021 if beyond == LOW else -0.0021)
        assert cutoffs.after(seen[-1], back_m) == WITHIN


def test_an_adapting_dead_band_is_three_deviations_or_half_a_jump_of_a_law_that_hunts() -> None:
    ratios, breakaway = Ratios(-1e6, -2e4), Estimate(2.4e4, 1.0, Refusal.VALID)
    places, hunts = DeadBand(STROKE_M), DeadBand(STROKE_M, jumps=True)
    assert places.in_force_m(0.0, breakaway, ratios) == pytest.approx(5e-4 * STROKE_M)
    assert places.in_force_m(1e-4, breakaway, ratios) == pytest.approx(3e-4)
    assert hunts.in_force_m(1e-5, breakaway, ratios) == pytest.approx(0.02 * STROKE_M), "and no more than 2 %"
    assert hunts.in_force_m(1e-5, Estimate(2.1e4, 1.0, Refusal.VALID), ratios) == pytest.approx(5e-4)
    unknown = no_estimate(Refusal.NO_BREAKAWAY)
    assert hunts.in_force_m(1e-5, unknown, ratios) == pytest.approx(5e-5)
    assert hunts.in_force_m(1e-5, unknown, ratios, 2e-3) == pytest.approx(1e-3)
    assert DeadBand(STROKE_M, fixed_m=1e-3, jumps=True).in_force_m(1.0, breakaway, ratios) == 1e-3


@pytest.mark.parametrize(
    ("travel", "said"),
    [
        ({"characteristic": "equal"}, "travel.characteristic: "),
        ({"rangeability": 1.0}, "travel.rangeability: "),
        ({"characteristic": "polygon"}, "travel: polygon: its points belong with"),
        ({"polygon": POINTS}, "travel: polygon: its points belong with"),
        ({"polygon": [[0, 0]]}, "travel.polygon: must have 2 to 20 points, got 1"),
        ({"polygon": [[0.0, 0.0], [0.9, 1.0]]}, "travel.polygon: must go from signal 0 to 1, got 0 to 0.9"),
        ({"polygon": [[0.0, 0.5], [1.0, 0.5]]}, "travel.polygon: must rise in signal and opening"),
        ({"polygon": [[0.0, 0.5], [1.0, 1.5]]}, "travel.polygon"),
        ({"split_range": [0.5, 0.51]}, "travel.split_range: must be at least 0.05 wide, got [0.5, 0.51]"),
        ({"ramp_opening_s": -1.0}, "travel.ramp_opening_s: "),
    ],
)
def test_what_cannot_be_is_one_line(travel: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as refused:
        validate(DaemonFile, {"valve": {"stroke_m": 0.1}, "travel": travel}, "site.toml")
    assert str(refused.value).startswith(f"site.toml: {said}")
    assert "\n" not in str(refused.value)


def test_the_dcs_reads_what_it_wrote_and_what_becomes_of_it() -> None:
    travel = {
        "characteristic": "equal_percentage",
        "rangeability": 50.0,
        "split_range": [0.5, 1.0],
        "ramp_opening_s": 20.0,
    }
    panel = Panel({"travel": travel})
    panel.set("mode", 2)
    panel.run()
    before = panel.get("position")
    panel.set("reference", 0.9)
    panel.run()
    asked = (50.0**0.8 - 1.0) / 49.0
    assert panel.get("reference") == pytest.approx(0.9)
    assert panel.get("reference_scaled") == 9000
    assert panel.get("reference_opening") == pytest.approx(asked)
    assert panel.get("reference_in_force") == pytest.approx(before, abs=1e-3), "no bump"
    panel.run(1000)
    assert panel.get("reference_in_force") == pytest.approx(before + 1.0 / 20.0, abs=2e-4)
    back = (50.0 ** (2.0 * panel.get("position_signal") - 1.0) - 1.0) / 49.0
    assert back == pytest.approx(panel.get("position"), abs=1e-6)
    assert panel.get("dead_band") == pytest.approx(5e-4)
    panel.set("mode", 0)
    panel.run()
    panel.set("mode", 2)
    panel.run()
    assert panel.get("reference_in_force") == pytest.approx(panel.get("position"), abs=1e-3), "no bump after hold"


def hunting(dead_band: float | str) -> tuple[float, float]:
    """Return the strokes that PI goes in a quarter of a minute about a reference that stands, and its dead band."""
    tables = {
        "valve": {"stroke_m": 0.1016},
        "pressure": {"maximum_pa": 200e3},
        "control": {"law": "conventional", "dead_band": dead_band},
    }
    slave = {
        "clock": {"mode": "lockstep", "period_s": 0.02},
        "initial": {"position_m": 0.02, "pressure_pa": 17e3},
        "sensor": {"noise_std_m": 1e-5},
        "change": [{"at_s": 0.0, "static_n": 1500.0}],
    }
    device = device_of(SlaveFile.model_validate(slave), shipped_valve("seed"))
    cycle = virtual_cycle(DaemonFile.model_validate(tables), device, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
    list(run_identification(cycle, 600.0, wait=False))
    assert cycle.health is not None
    cycle.requests = replace(cycle.requests, eta=QUIET, reference_m=0.05, reference_writes=1)
    for _ in range(500):
        cycle.once()
    before_m = cycle.health.record.travel_m
    for _ in range(750):
        cycle.once()
    return (cycle.health.record.travel_m - before_m) / 0.1016, cycle.snapshot.decision.dead_band_m / 0.1016


def test_an_adapting_dead_band_ends_the_hunting_of_a_law_that_commands_all_the_while() -> None:
    (fixed, _), (adapted, band) = hunting(5e-4), hunting("auto")
    assert 0.005 < band < 0.02
    assert adapted < 0.2 * fixed
