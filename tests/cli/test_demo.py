"""The demo as a new user runs it. Its figures depend on how punctual the machine is; what it leaves does not."""

import json
from pathlib import Path

import pytest

from config.recording import read_recording
from positioner.cli.demo import LARGEST_ERROR_PU, Identified, Outcome, Step
from positioner.cli.main import main


def outcome(error_pu: float = 0.001, ratio: float = 1.0, *, counted: bool = True) -> Outcome:
    identified = [Identified("new", "b_over_c", -800e3 * ratio, 1.0, -800e3, "")]
    return Outcome([Step("new", 0.5, error_pu, counted)], identified, {})


@pytest.mark.parametrize(
    ("seen", "holds"),
    [
        (outcome(), True),
        (outcome(error_pu=-1.01 * LARGEST_ERROR_PU), False),
        (outcome(error_pu=float("nan")), False),
        (outcome(error_pu=0.08, counted=False), True),
        (outcome(ratio=1.011), False),
        (outcome(ratio=0.991), True),
        (outcome(ratio=float("nan")), False),
    ],
)
def test_what_does_not_hold_is_a_problem(seen: Outcome, holds: bool) -> None:
    assert (not seen.problems) == holds


def test_it_ends_within_a_minute_and_leaves_picture_recording_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["demo", "--out", str(tmp_path / "out"), "--json", str(tmp_path / "out.json")])
    told = json.loads((tmp_path / "out.json").read_text())
    assert status == (1 if told["problems"] else 0), capsys.readouterr().out
    assert told["seconds"] < 60
    assert [step["phase"] for step in told["steps"]] == ["new"] * 5 + ["aged"] * 5 + ["identified anew"] * 5
    assert {each["name"] for each in told["identified"]} == {"a", "b", "c", "k", "b_over_c", "k_over_c"}
    assert (tmp_path / "out" / "run.png").read_bytes().startswith(b"\x89PNG")
    (recording,) = (tmp_path / "out" / "recordings").glob("*.csv")
    states = set(read_recording(recording).columns["state"].tolist())
    assert states == {0.0, 1.0, 2.0, 3.0}
