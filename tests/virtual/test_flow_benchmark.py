"""`benchmarks.flow`, shortened: ours calms the loop, others do not; what it prints and draws."""

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.flow import __main__ as flow_loop
from benchmarks.flow.cases import FlowCase, virtual_outcome
from benchmarks.flow.course import FlowFigures

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
    assert flow_loop.problems_of(found) == problems


def test_it_prints_a_line_a_case_and_leaves_a_picture(tmp_path: Path, capsys: Capture) -> None:
    cases = tuple(FlowCase(law, 0.1, settle_s=5.0, measured_s=10.0) for law in ("seed", "slides"))
    assert flow_loop.compared(cases, tmp_path) == int("DOES NOT HOLD" in (said := capsys.readouterr().out))
    for name in ("seed's law, 100 ms", "slides (ours), 100 ms", "no friction", "stem left alone", "picture"):
        assert f"\n{name}" in said
    assert (tmp_path / "flow_loop.png").read_bytes().startswith(b"\x89PNG")
