import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from positioner.cli.main import main
from workbench.bench.drawn_loops import DrawnLoop, draw_loop


@cache
def loop() -> DrawnLoop:
    return draw_loop(10, "sticks")


def written(path: Path, header: str, *columns: np.ndarray, delimiter: str = ",") -> Path:
    np.savetxt(path, np.column_stack(columns), "%.4f", delimiter, header=header, comments="")
    return path


def test_a_loop_goes_from_its_export_to_a_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = (loop().time_s, loop().sp, loop().pv, loop().op_pct)
    export = written(tmp_path / "a.csv", "Time;FIC101.SP;FIC101.PV;FIC101.OP", *columns, delimiter=";")
    assert main(["loop", str(export), "--json", str(tmp_path / "a.json")]) == 1
    (found,) = json.loads((tmp_path / "a.json").read_text())
    assert found["verdict"] == "sticks"
    assert found["stiction_pct_95"][0] < loop().truth.stiction_pct < found["stiction_pct_95"][1]
    assert "the valve sticks" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("header", "factor", "words", "said"),
    [
        ("t,a,b", 1.0, [], "no loop is recognised"),
        ("t,a,b", 276.48, ["--time", "t", "--op", "a", "--pv", "b"], "--op-range 0 27648"),
    ],
)
def test_what_a_file_leaves_open_is_said_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], header: str, factor: float, words: list[str], said: str
) -> None:
    export = written(tmp_path / "a.csv", header, loop().time_s, factor * loop().op_pct, loop().pv)
    assert main(["loop", str(export), *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_counts_are_read_by_the_range_that_a_person_says(tmp_path: Path) -> None:
    export = written(tmp_path / "a.csv", "t,a,b", loop().time_s, 276.48 * loop().op_pct, loop().pv)
    words = ["--time", "t", "--op", "a", "--pv", "b", "--op-range", "0", "27648", "--json", str(tmp_path / "a.json")]
    main(["loop", str(export), *words])
    (found,) = json.loads((tmp_path / "a.json").read_text())
    assert found["stiction_pct"] == pytest.approx(loop().truth.stiction_pct, rel=0.2)


@pytest.mark.parametrize("command", [["compare", "--valve", "seed"], ["diagnose", "--valve", "seed"], ["response"]])
def test_a_command_that_wants_a_stem_names_the_one_that_reads_a_loop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str]
) -> None:
    columns = (loop().time_s, loop().sp, loop().pv, loop().op_pct)
    export = written(tmp_path / "a.csv", "Time;FIC101.SP;FIC101.PV;FIC101.OP", *columns, delimiter=";")
    assert main([command[0], str(export), *command[1:]]) == 2
    assert "this is a loop, not a stem" in (error := capsys.readouterr().err)
    assert f"`positioner loop {export}`" in error


def test_a_plant_is_ranked_and_what_cannot_be_read_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(tmp_path / "a.csv", "t,a,b", loop().time_s, loop().op_pct, loop().pv)
    other = draw_loop(7, "external noise")
    written(tmp_path / "b.csv", "t,a,b", other.time_s, other.op_pct, other.pv)
    manifest = tmp_path / "plant.csv"
    manifest.write_text("loop,file,time,op,pv\nB,b.csv,t,a,b\nA,a.csv,t,a,b\nC,none.csv,t,a,b\n")
    page = tmp_path / "p.html"
    assert main(["loops", str(manifest), "--workers", "1", "--report", str(page)]) == 1
    out, err = capsys.readouterr()
    assert out.index("  A ") < out.index("  B ")
    assert "C: " in err
    assert page.stat().st_size > 1e6


def test_what_was_worked_out_of_a_plants_loop_is_kept_and_taken_as_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path / "a.csv", "t,a,b", loop().time_s, loop().op_pct, loop().pv)
    (tmp_path / "plant.csv").write_text("loop,file,time,op,pv\nA,a.csv,t,a,b\n")
    words = ["loops", str(tmp_path / "plant.csv"), "--workers", "1", "--out", str(tmp_path / "out")]
    assert main(words) == 1
    (kept,) = (tmp_path / "out/examinations").glob("*/*.json")
    found = json.loads(kept.read_text())
    found["friction"]["size"]["high_pct"] = 77.0
    kept.write_text(json.dumps(found))
    capsys.readouterr()
    assert main(words) == 1
    assert "to 77 %" in capsys.readouterr().err
    written(tmp_path / "a.csv", "t,a,b", loop().time_s, loop().op_pct, loop().pv + 1.0)
    assert main(words) == 1
    assert "to 77 %" not in capsys.readouterr().err
