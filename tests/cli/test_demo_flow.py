"""`positioner demo --loop flow`, shortened: ours calms the loop, others do not; what it prints, draws and refuses."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from positioner.cli.main import main
from positioner.cli.parts import flow_demo
from positioner.cli.parts.flow_cases import FlowCase, virtual_outcome
from positioner.virtual.flow_course import FlowFigures

Capture = pytest.CaptureFixture[str]

SHORT = {law: FlowCase(law, 0.02, settle_s=45.0, measured_s=90.0) for law in ("conventional", "seed", "slides")}
NONE = FlowFigures(0.01, 0.03, 1.0, 0.01, 1.0, 10.0)


@pytest.mark.long
def test_ours_adds_less_than_half_of_what_the_others_do() -> None:
    found = {law: virtual_outcome(case).figures for law, case in SHORT.items()}
    for other in ("conventional", "seed"):
        assert found["slides"].added_std < 0.5 * found[other].added_std
        assert found["slides"].deviation_std < 0.7 * found[other].deviation_std
        assert found["slides"].peak_to_peak < 0.5 * found[other].peak_to_peak
    assert found["slides"].added_std < 3e-3


@pytest.mark.parametrize(
    ("ours", "other", "problems"),
    [
        (0.005, FlowCase("conventional", 0.02), []),
        (0.010, FlowCase("conventional", 0.02), ["slides (ours), 20 ms leaves 1.00 %, conventional, 20 ms 1.00 %"]),
        (0.020, FlowCase("seed", 0.02), ["slides (ours), 20 ms leaves 2.00 %, seed's law, 20 ms 1.00 %"]),
        (0.020, FlowCase("seed", 0.1), []),
        (float("nan"), FlowCase("seed", 0.02), ["slides (ours), 20 ms leaves nan %, seed's law, 20 ms 1.00 %"]),
    ],
)
def test_what_is_no_better_than_another_is_a_problem(ours: float, other: FlowCase, problems: list[str]) -> None:
    found = {other: NONE, FlowCase("slides", 0.02): replace(NONE, deviation_std=ours)}
    assert flow_demo.problems_of(found) == problems


def test_it_prints_a_line_a_case_and_leaves_picture_and_figures(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    cases = tuple(FlowCase(law, 0.1, settle_s=5.0, measured_s=10.0) for law in ("seed", "slides"))
    monkeypatch.setattr(flow_demo, "CASES", cases)
    out, figures = tmp_path / "out", tmp_path / "out.json"
    status = main(["demo", "--loop", "flow", "--out", str(out), "--json", str(figures)])
    told = json.loads(figures.read_text())
    assert status == (1 if told["problems"] else 0)
    assert [each["law"] for each in told["cases"]] == ["seed", "slides"]
    said = capsys.readouterr().out
    assert "10 s in steady state, in virtual time" in said
    for name in ("seed's law, 100 ms", "slides (ours), 100 ms", "no friction", "stem left alone", "picture"):
        assert f"\n{name}" in said
    assert (out / "flow_loop.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--bus", "rtu"], "--bus rtu: with --loop flow allowed is modbus; without --bus, virtual time"),
        (["--out", "FILE"], "cannot be written: File exists"),
    ],
)
def test_bad_words_are_one_line_and_exit_status_2(words: list[str], said: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "file").touch()
    given = [str(tmp_path / "file") if each == "FILE" else each for each in words]
    assert main(["demo", "--loop", "flow", *given]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]


def test_another_loop_is_refused(capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["demo", "--loop", "level"])
    assert caught.value.code == 2
    assert "flow" in capsys.readouterr().err
