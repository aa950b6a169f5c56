import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from positioner.cli.main import main
from workbench.bench.drawn_loops import draw_loop
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.loop_report import report_loop, report_loops
from workbench.loops.oscillation import Oscillation
from workbench.loops.plant import Plant, delay_s, find_groups, read_manifest


@pytest.fixture(scope="module")
def sticking() -> LoopDiagnosis:
    loop = draw_loop(10, "sticks")
    return diagnose_loop(LoopRecord.of_samples("FIC101", loop.time_s, loop.op_pct, loop.pv, loop.sp))


@pytest.fixture(scope="module")
def swinging() -> LoopDiagnosis:
    loop = draw_loop(7, "external sine")
    return diagnose_loop(LoopRecord.of_samples("<b>TIC7", loop.time_s, loop.op_pct, loop.pv, loop.sp))


def test_loops_of_one_period_are_a_group_and_the_sticking_valve_is_its_source(
    sticking: LoopDiagnosis, swinging: LoopDiagnosis
) -> None:
    regular = replace(sticking.oscillation, period_s=100.0, regularity=3.0)
    loops = [
        replace(sticking, oscillation=regular),
        replace(swinging, oscillation=replace(regular, period_s=103.0)),
        replace(swinging, oscillation=replace(regular, period_s=130.0)),
        replace(swinging, oscillation=replace(regular, regularity=0.5)),
    ]
    (group,) = find_groups(loops)
    assert group.loops == ("FIC101", "<b>TIC7")
    assert group.source == "FIC101"


def test_of_loops_that_swing_together_the_source_is_ahead_of_all_others(swinging: LoopDiagnosis) -> None:
    at_s = np.arange(0.0, 1000.0, 2.0)

    def late_by(seconds: float, name: str, sign: float = 1.0, begin_s: float = 0.0) -> LoopDiagnosis:
        pv = 40.0 + sign * np.sin(2.0 * np.pi * (begin_s + at_s - seconds) / 100.0)
        record = LoopRecord(name, begin_s, 2.0, swinging.record.op_pct[: at_s.size], pv)
        return replace(swinging, record=record, oscillation=Oscillation(100.0, 5.0, 10.0))

    loops = [late_by(20.0, "A", begin_s=40.0), late_by(8.0, "B"), late_by(15.0, "C", -1.0)]
    assert delay_s(loops[1].record, loops[0].record, 100.0) == pytest.approx(12.0, abs=2.0)
    assert delay_s(loops[1].record, late_by(0.0, "D", begin_s=5000.0).record, 100.0) is None
    (group,) = find_groups(loops)
    assert (group.source, group.because) == ("B", "its process value is ahead of all others")


def test_a_plants_page_has_a_line_a_loop_and_escapes_what_is_not_ours(
    tmp_path: Path, sticking: LoopDiagnosis, swinging: LoopDiagnosis
) -> None:
    plant = Plant((sticking, swinging), (("LIC3", "is empty"),), ())
    assert [row[-1] for row in plant.ranking.rows] == [sticking.advice, swinging.cause]
    report_loops(plant, tmp_path / "p.html", "plant.csv")
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "LIC3" in page
    assert "<b>TIC7" not in page


def test_a_loops_page_shows_the_verdict_and_the_fitted_path(tmp_path: Path, sticking: LoopDiagnosis) -> None:
    report_loop([sticking], tmp_path / "l.html")
    page = (tmp_path / "l.html").read_text(encoding="utf-8")
    assert sticking.sentence in page
    assert "stick and slip" in page


def test_the_loop_without_friction_swings_less_and_the_compensators_name_settings(sticking: LoopDiagnosis) -> None:
    by_name = {each.name: each for each in sticking.remedies}
    without = by_name["maintenance"].error_ratio
    assert without is not None
    assert without < 0.8
    assert all(each.settings for each in by_name.values())


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("loop;file\nA;a.csv\nA;b.csv\n", "names the loop A 2 times"),
        ("loop,valve\nA,a.csv\n", "columns must be"),
        ("loop,file\n", "names no loop"),
        ("loop,file\nA,\n", "line 2"),
    ],
)
def test_a_broken_manifest_is_said_in_a_line(tmp_path: Path, lines: str, said: str) -> None:
    path = tmp_path / "m.csv"
    path.write_text(lines)
    with pytest.raises(InputError, match=said):
        read_manifest(path)


def test_a_plants_dates_are_said_once_and_without_them_nothing_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"02-Mar-26 06:{row // 60:02}:{row % 60:02},{50 + row % 9},40" for row in range(200)]
    (tmp_path / "a.csv").write_text("\n".join(["Time,FIC1.PV,FIC1.OP", *rows]))
    (tmp_path / "m.csv").write_text("loop,file\nFIC1,a.csv\n")
    words = ["loops", str(tmp_path / "m.csv"), "--workers", "1"]
    assert main(words) == 2
    (said,) = re.findall(r'--time-format "([^"]+)"', capsys.readouterr().err)
    assert main([*words, "--time-format", said]) == 0
    assert "the output stands at 40 %" in capsys.readouterr().out
