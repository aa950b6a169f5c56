"""The open benchmark: cases written with truth, and results of anybody judged by case."""

from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from positioner.cli.main import main
from workbench.bench import scores
from workbench.bench.cases import Case, read_cases, write_cases
from workbench.bench.scores import Answer, add_results, area, area_interval, read_results, tell_scores

HEAD = "set,case,file,truth,stiction_pct\n"


def test_the_area_is_the_share_of_pairs_in_the_right_order() -> None:
    sticks = np.array([True, True, False, False])
    assert area(np.array([0.9, 0.5, 0.5, 0.1]), sticks) == 0.875
    assert area_interval(np.array([0.9, 0.8, 0.2, 0.1]), sticks) == (1.0, 1.0)
    assert np.isnan(area(np.ones(2), np.array([True, True])))


def test_cases_go_into_a_folder_once_and_a_rivals_file_is_judged_beside_ours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scores, "DRAWN_ANEW", 20)
    folder = tmp_path / "cases"
    words = ["bench", str(folder), "--drawn", "2", "--first-seed", "10", "--workers", "1"]
    assert main(words) == 0
    cases, results = read_cases(folder), folder / "results.csv"
    whole = results.read_text().splitlines()
    results.write_text("\n".join(whole[:6]) + "\n")  # stopped after the first case
    assert main(words) == 0
    assert results.read_text().splitlines() == whole
    assert {each.truth for each in cases} == {"0", "1"}
    rival = [
        Answer(c.set, c.name, "oracle", float(c.truth), "sticks" if c.truth == "1" else "", c.stiction_pct)
        for c in cases[1:]
    ]
    add_results(tmp_path / "r.csv", rival)
    capsys.readouterr()
    assert main([*words, "--judge", str(tmp_path / "r.csv")]) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in ("positioner", "He", "Hagglund", "Horch", "Kano"))
    (line,) = [line for line in out.splitlines() if "oracle" in line]
    assert "wrong 0" in line
    assert "1 without an answer" in line
    with pytest.raises(InputError, match="already"):
        write_cases(folder, 1, 0, 0, None)


def test_records_of_one_loop_are_one_case_and_no_label_is_none(tmp_path: Path) -> None:
    (tmp_path / "labels.csv").write_text("file,loop,sticks,set\na.csv,A,1,mill\nb.csv,A,1,mill\nc.csv,B,,mill\n")
    write_cases(tmp_path / "cases", 0, 0, 0, tmp_path)
    (case,) = read_cases(tmp_path / "cases")
    assert (case.set, case.name, case.truth, len(case.files)) == ("mill", "A", "1", 2)


def test_of_a_hidden_effect_a_set_that_holds_it_names_it_and_another_name_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text(HEAD + "".join(f"effects,{n},{n},play,\n" for n in range(4)))
    says = ("play", "dwell play", "dwell", "")
    answers = [Answer("effects", str(n), "x", 0.0, said, None) for n, said in enumerate(says)]
    (_, line) = tell_scores(read_cases(tmp_path), answers)
    assert line.endswith("named 2 (alone 1), nothing named 1, wrong 1")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("set,case,method\nd,1,x\n", "lacks the column score"),
        ("set,case,method,score\nd,1,x,1\nd,2,x,high\n", "line 3"),
        ("set,case,method,score\nd,1,x,nan\n", "score must be a number"),
        ("set,case,method,score\nd,1,x,1\nd,1,x,0\n", "line 3: x answers case 1 a second time"),
        ("\ufeffset,case,method,score\ne,1,x,1\n", "line 2: there is no case 1 of set e"),
        ("set,case,method,score,says\nd,1,x,1,maybe\n", "says must be sticks or nothing"),
    ],
)
def test_a_broken_results_file_is_said_in_a_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "r.csv").write_text(text, encoding="utf-8")
    cases = [Case("d", name, (), "1", None) for name in "12"]
    with pytest.raises(InputError, match=said):
        read_results(tmp_path / "r.csv", cases)
