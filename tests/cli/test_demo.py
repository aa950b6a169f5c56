"""The demo as a new user runs it. Its figures depend on how punctual the machine is; what it leaves does not."""

import json
import shlex
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from config.codes import Fault, Mode
from config.recording import read_recording
from config.valve_file import load_valve, shipped_valve
from positioner.cli import demo
from positioner.cli.demo import (
    ACKNOWLEDGEMENTS,
    ALPHA_PA,
    IDENTIFICATIONS,
    LARGEST_ERROR_PU,
    ComparedEstimate,
    DemoOutcome,
    StepOutcome,
    identify,
)
from positioner.cli.main import main
from positioner.cli.parts import simulated_plant
from positioner.cli.parts.children import port_in
from positioner.cli.parts.demo_folder import demo_folder, recording_in
from positioner.cli.parts.simulated_plant import (
    BUSES,
    RTU_PERIOD_S,
    RTU_WINDOW_S,
    SLAVE_HEAD,
    BusSetup,
    daemon_running,
    slave_running,
)
from positioner.dcs import Dcs
from tests.children import running
from tests.waiting import until

pytestmark = pytest.mark.real_time

SOON_AGED_S = 8.0


def outcome(
    error_pu: float = 0.001, ratio: float = 1.0, *, phase: str = "new", limit_pu: float | None = LARGEST_ERROR_PU
) -> DemoOutcome:
    identified = [ComparedEstimate("new", "b_over_c", -800e3 * ratio, 1.0, -800e3, "")]
    return DemoOutcome([StepOutcome(phase, 0.5, error_pu, limit_pu)], identified, {})


@pytest.mark.parametrize(
    ("result", "holds"),
    [
        (outcome(), True),
        (outcome(error_pu=-1.01 * LARGEST_ERROR_PU), False),
        (outcome(error_pu=float("nan")), False),
        (outcome(error_pu=0.08, phase="aged", limit_pu=None), True),
        (outcome(error_pu=0.08, limit_pu=None), False),
        (outcome(ratio=1.011), False),
        (outcome(ratio=0.991), True),
        (outcome(ratio=float("nan")), False),
    ],
)
def test_what_does_not_hold_is_a_problem(result: DemoOutcome, holds: bool) -> None:
    assert (not result.problems) == holds


@contextmanager
def slower_modbus(begun: Callable[[], AbstractContextManager[BusSetup]] = BUSES["modbus"]) -> Iterator[BusSetup]:
    with begun() as setup:
        yield replace(setup, period_s=RTU_PERIOD_S, window_s=RTU_WINDOW_S)


def test_it_ends_soon_and_leaves_picture_recording_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of each phase two steps, or a small one; the packing ages as soon as the first may be over.

    The cycle is that of a serial line, 5 ms: at 1 ms, as on Modbus TCP, two processes spin for half a minute.
    """
    fewer = {
        "PAPER_STEPS": demo.PAPER_STEPS[:2],
        "SLIDES_STEPS": demo.SLIDES_STEPS[:1],
        "SMALL_STEPS": demo.SMALL_STEPS[:1],
    }
    for name, steps in fewer.items():
        monkeypatch.setattr(demo, name, steps)
    for module in (demo, simulated_plant):
        monkeypatch.setattr(module, "AGES_AT_S", SOON_AGED_S)
    monkeypatch.setattr(simulated_plant, "running", running)
    monkeypatch.setitem(simulated_plant.BUSES, "modbus", slower_modbus)
    status = main(["demo", "--out", str(tmp_path / "out"), "--json", str(tmp_path / "out.json")])
    told = json.loads((tmp_path / "out.json").read_text())
    assert status == (1 if told["problems"] else 0), capsys.readouterr().out
    assert told["seconds"] < 180
    phases = {"new": 2, "aged": 2, "identified anew": 2, "small steps": 1, "slides": 2}
    assert Counter(step["phase"] for step in told["steps"]) == phases
    by_phase = {phase: [each["name"] for each in told["identified"] if each["phase"] == phase] for phase in phases}
    paper = ["a", "b", "c", "k", "b_over_c", "k_over_c"]
    assert by_phase == {
        "new": paper,
        "aged": paper,
        "identified anew": [],
        "small steps": [],
        "slides": ["static_slope", "static_up", "static_down"],
    }
    assert set(told["cycles"]) == {"paper", "slides"}
    assert (tmp_path / "out" / "run.png").read_bytes().startswith(b"\x89PNG")
    (recording,) = (tmp_path / "out" / "recordings").glob("*.csv")
    (slides,) = (tmp_path / "out" / "slides").glob("*.csv")
    assert read_recording(slides).columns["state"].max() == 3.0
    states = set(read_recording(recording).columns["state"].tolist())
    assert {0.0, 3.0} <= states
    if not told["problems"]:
        assert states == {0.0, 1.0, 2.0, 3.0}


@pytest.mark.parametrize("there", ["daemon.toml", "slides.toml", "recordings/demo-plant.csv", "slave.toml"])
def test_what_no_demo_has_left_is_neither_deleted_nor_written_over(
    there: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A demo in a site's own folder wrote over its daemon's file and deleted its recordings."""
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).write_text("of the site")
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert f"holds {Path(there).parts[0]}, not of a demo; allowed is another folder" in capsys.readouterr().err
    assert [each for each in tmp_path.rglob("*") if each.is_file()] == [tmp_path / there]


def test_an_earlier_demos_recordings_go_and_no_others_and_a_second_demo_is_kept_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "slave.toml").write_text(SLAVE_HEAD)
    for name in ("recordings/demo-1.csv", "recordings/mine.csv", "of-mine/demo-1.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with demo_folder(tmp_path):
        assert main(["demo", "--out", str(tmp_path)]) == 2
    assert f"{tmp_path}: another demo runs there; allowed is another folder" in capsys.readouterr().err
    assert {each.relative_to(tmp_path).as_posix() for each in tmp_path.rglob("*.csv")} == {
        "recordings/mine.csv",
        "of-mine/demo-1.csv",
    }
    (tmp_path / "recordings" / "demo-2.csv").touch()
    assert recording_in(tmp_path / "recordings").name == "demo-2.csv"


@pytest.mark.parametrize("option", ["--json", "--out"])
def test_what_cannot_be_written_is_said_before_anything_is_started(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("os.access", lambda path, _: Path(path) != tmp_path)
    path = tmp_path / "told.json" if option == "--json" else tmp_path
    assert main(["demo", option, str(path)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"positioner demo: {option} {path}: cannot be written: Permission denied"
    ]


@pytest.mark.parametrize("folder", ["my demo", "."])
def test_what_it_says_to_type_next_is_found_from_where_it_was_typed(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It named profiles by their paths in a clone, and a folder with a space as two words."""
    monkeypatch.chdir(tmp_path)
    recording = Path(folder) / "demo-1.csv"
    recording.parent.mkdir(exist_ok=True)
    recording.touch()
    words = [word for line in demo.page_commands(recording) for word in shlex.split(line)]
    named = [word for word in words if word.endswith((".csv", ".toml"))]
    assert len(named) == 4
    assert all(Path(each).is_file() for each in named)


def test_steps_that_come_after_the_ageing_are_said_to_be_late_and_not_to_be_off() -> None:
    """A valve that was 0.08 off, for its packing had aged while the processes were started, was said not to hold."""
    (problem,) = outcome(error_pu=0.08, limit_pu=None).problems
    assert problem.startswith("the packing aged before the step to 0.5 p.u. (new) was over: the machine is too busy")


def test_what_does_not_hold_on_a_busy_machine_says_so() -> None:
    """At the end, once; a quiet machine is blamed for nothing, and a busy one on which all holds neither."""
    for missed, lost, busy in ((10.0, 0.0, False), (900.0, 0.0, True), (0.0, 3.0, True)):
        cycles = {"paper": {"cycles": 9000.0, "missed_periods": missed, "lost_replies": lost}}
        *_, last = replace(outcome(ratio=2.0), cycles=cycles).problems
        assert last.startswith("the machine is too busy for the demo: ") == busy
        assert not replace(outcome(), cycles=cycles).problems


class FaultyAtFirst:
    """A daemon whose device's replies are lost so many times."""

    def __init__(self, faults: int) -> None:
        self.faults = faults
        self.said: list[str] = []

    def get(self, name: str) -> float:
        return 0.3 if name == "position" else Fault.NO_REPLY if self.faults else Fault.NONE

    def identify(self, *_: object) -> str | None:
        return None if self.said[-1:] in ([], ["mode"]) else "a fault is latched"

    def get_all(self, *names: str) -> dict[str, float]:
        return dict.fromkeys(names, 0.0)

    def set(self, name: str, _: float) -> None:
        self.said.append(name)
        self.faults -= name == "acknowledge"


@pytest.mark.parametrize(("faults", "left"), [(0, 0), (3, 0), (ACKNOWLEDGEMENTS + 1, 1)])
def test_faults_of_the_start_are_acknowledged_until_there_are_none(
    faults: int, left: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "observe", lambda *_: 0.0)
    dcs = FaultyAtFirst(faults)
    demo.acknowledge_faults(dcs)  # type: ignore[arg-type]
    assert dcs.faults == left


@pytest.mark.parametrize("faults", [0, 2])
def test_a_fault_is_acknowledged_before_the_next_try_and_automatic_chosen_from_where_the_stem_is(
    faults: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo, "observe", lambda *_: 0.0)
    dcs = FaultyAtFirst(faults)
    identify(dcs, "new", ALPHA_PA, load_valve(shipped_valve("seed")).valve)  # type: ignore[arg-type]
    assert dcs.said == [*["acknowledge"] * faults, *["reference", "mode"] * (faults > 0)]


class RefusedAtFirst:
    """A DCS to whom an identification is refused so many times."""

    def __init__(self, refused: int) -> None:
        self.problems = [*["too many samples lost"] * refused, None]
        self.asked = 0

    def identify(self, *_: object) -> str | None:
        self.asked += 1
        return self.problems[min(self.asked, len(self.problems)) - 1]

    def get(self, _: str) -> float:
        return Fault.NONE

    def get_all(self, *names: str) -> dict[str, float]:
        return dict.fromkeys(names, 0.0)


@pytest.mark.parametrize(("refused", "asked"), [(0, 1), (1, 2), (9, IDENTIFICATIONS)])
def test_an_identification_that_is_refused_is_made_anew_a_few_times(
    refused: int, asked: int, capsys: pytest.CaptureFixture[str]
) -> None:
    dcs = RefusedAtFirst(refused)
    identify(dcs, "new", ALPHA_PA, load_valve(shipped_valve("seed")).valve)  # type: ignore[arg-type]
    assert dcs.asked == asked
    assert capsys.readouterr().out.count("failed: too many samples lost") == min(refused, asked)


@pytest.mark.parametrize(
    ("bus", "where"), [("canopen", "listening on loopback node 1 on channel:"), ("rtu", "listening on /dev/pts/")]
)
def test_on_the_other_buses_the_same_files_bring_up_a_valve_that_obeys(
    bus: str, where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the command does on every bus alike, starting both from nothing, is shown by the test above."""
    monkeypatch.setattr(simulated_plant, "running", running)
    with (
        slave_running(bus, tmp_path, "seed") as (setup, slave),
        daemon_running(tmp_path / "daemon.toml", replace(setup, reply_timeout_s=1.0, period_s=0.02), slave) as daemon,
    ):
        assert slave.startswith(where)
        with Dcs("127.0.0.1", port_in(daemon)) as dcs:
            assert dcs.get_all("fault", "position_m") == pytest.approx({"fault": Fault.NONE, "position_m": 0}, abs=1e-3)
            dcs.set_all({"mode": Mode.MANUAL, "manual_pressure": 60e3})
            until(lambda: dcs.get("position") > 0.3, "the stem's motion")
    (recording,) = (tmp_path / "recordings").glob("*.csv")
    assert read_recording(recording).columns["command_pa"].max() == pytest.approx(60e3)
