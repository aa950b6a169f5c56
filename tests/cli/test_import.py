"""`positioner import` and `valve`, and exports in the other commands: from a file of another program to figures."""

import io
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording
from config.valve_file import load_valve, valve
from positioner.cli.main import main
from sim.simulation import simulate
from sim.valve import Valve

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def measured() -> Recording:
    """Steps of the shipped valve `ordinary`, 20 ms apart."""
    time_s = np.arange(0.0, 40.0, 0.02)
    levels_pa = np.random.default_rng(2).uniform(3e4, 9e4, 10)
    return simulate(valve("ordinary"), time_s, np.repeat(levels_pa, 200), noise_std_m=4e-6)


def german_csv(path: Path, recording: Recording) -> None:
    import pandas

    stamps = pandas.Timestamp("2026-01-31 12:00") + pandas.to_timedelta(recording.time_s, unit="s")
    frame = pandas.DataFrame(
        {
            "Zeit": stamps.strftime("%d.%m.%Y %H:%M:%S.%f"),
            "Hub [mm]": 1e3 * recording.position_m,
            "Stellsignal [mbar]": 1e-2 * recording.command_pa,
        }
    )
    frame.to_csv(path, sep=";", decimal=",", index=False, encoding="utf-16")


def workbook(path: Path, recording: Recording) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["time (s)", "travel (%)", "output (bar)"])
    for t, x, u in zip(recording.time_s, recording.position_m, recording.command_pa, strict=True):
        book.active.append([float(t), float(100.0 * x / 0.04), float(1e-5 * u)])
    book.save(path)


def matlab(path: Path, recording: Recording) -> None:
    from scipy.io import savemat

    savemat(path, {"time": recording.time_s, "stem": recording.position_m, "cmd": 1e-3 * recording.command_pa})


@pytest.mark.long
@pytest.mark.parametrize(
    ("write", "name", "mended"),
    [
        (german_csv, "a.txt", {}),
        (workbook, "a.xlsx", {"M": "0.04"}),
        (
            matlab,
            "a.mat",
            {
                "position_m=stem:p.u.": "position_m=stem:m",
                "command_pa=cmd:%": "command_pa=cmd:kPa",
                "M": "0.04",
                "AT0": "20e3",
                "AT100": "100e3",
            },
        ),
    ],
)
def test_the_words_that_import_proposes_lead_to_a_verdict(
    write: Callable[[Path, Recording], None],
    name: str,
    mended: dict[str, str],
    tmp_path: Path,
    measured: Recording,
    capsys: Capture,
) -> None:
    path = tmp_path / name
    write(path, measured)
    assert main(["import", str(path)]) == 0
    proposed = re.search(r"proposed, check it: (.*)", capsys.readouterr().out)
    assert proposed is not None
    words = [mended.get(word, word) for word in shlex.split(proposed[1])]
    out = tmp_path / "rec.csv"
    assert main(["import", str(path), *words, "-o", str(out)]) == 0
    assert "look:" not in capsys.readouterr().out
    read = Recording.read(out)
    np.testing.assert_allclose(read.position_m, measured.position_m, atol=1e-9)
    np.testing.assert_allclose(read.command_pa, measured.command_pa, rtol=1e-9)
    assert main(["response", str(path), *words]) == 0
    assert main(["estimate", str(path), *words]) in (0, 1)
    assert main(["compare", str(path), *words, "--valve", "ordinary"]) in (0, 1)
    assert "adequate" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-o", "rec.csv"], "-o: needs to know the columns: --column"),
        (["--column", "time_s=t"], "command_pa is not given: add --column command_pa=THEIRS:UNIT"),
        (
            ["--column", "time_s=t", "--column", "position_m=x:mm", "--column", "command_pa=u:bar", "--status", "Q"],
            "--status",
        ),
        (
            ["--column", "time_s=t", "--column", "position_m=x:mm", "--column", "command_pa=u:bar", "-o", "none/r.csv"],
            "-o none",
        ),
    ],
)
def test_what_it_cannot_do_is_one_line(
    words: list[str], said: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("t,x,u\n0,1,1\n1,2,1\n")
    assert main(["import", "a.csv", *words]) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert [each.name for each in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("stroke", ["-1", "0", "M", "nan"])
def test_a_stroke_that_is_none_is_one_line(stroke: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["import", "a.csv", "--stroke-m", stroke])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert "--stroke-m" in error
    assert error.count("\n") == 1


def test_an_option_of_exports_without_columns_is_refused(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,command_pa,position_m\n0,1,2\n1,1,3\n")
    assert main(["estimate", str(path), "--decimal", ","]) == 2
    assert "--decimal: goes with --column" in capsys.readouterr().err


def test_outputs_are_checked_before_the_work(tmp_path: Path, measured: Recording, capsys: Capture) -> None:
    path = tmp_path / "r.csv"
    measured.write(path)
    for words in (
        ["compare", str(path), "--valve", "ordinary", "--json", str(tmp_path / "no" / "a.json")],
        ["diagnose", str(path), "--valve", "ordinary", "--report", str(tmp_path / "no" / "a.html")],
        ["extend", "ordinary", "--effect", "backlash", "--fit", str(path), "-o", str(tmp_path)],
    ):
        assert main(words) == 2
        printed = capsys.readouterr()
        assert "cannot be written" in printed.err
        assert not printed.out


def test_a_valve_from_a_data_sheet(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "v.toml"
    words = ["valve", "--area-cm2", "700", "--range-bar", "0.2", "1.0", "--stroke-mm", "40", "-o", str(out)]
    assert main([*words, "--friction-percent", "6.4286", "--breakaway-ratio", "1.3"]) == 0
    made, shipped = load_valve(out).valve, valve("ordinary").valve
    assert made.spring_n_per_m == pytest.approx(shipped.spring_n_per_m)
    assert made.coulomb_n == pytest.approx(shipped.coulomb_n, rel=1e-3)
    assert made.static_n == pytest.approx(shipped.static_n, rel=0.01)
    preload, stops = load_valve(out).effect
    assert preload.parameters == {"force_n": 1400.0}
    assert (stops.name, stops.parameters["lower_m"], stops.parameters["travel_m"]) == ("end_stop", 0.0, 0.04)
    printed = capsys.readouterr().out
    assert "assumed: mass 8 kg" in printed
    assert "from the data sheet: sliding friction" in printed


def test_the_stem_of_a_valve_from_a_data_sheet_goes_no_farther_than_its_travel(tmp_path: Path) -> None:
    """It went 99 mm under the supply, for a travel of 40."""
    out = tmp_path / "v.toml"
    words = ["valve", "--area-cm2", "700", "--range-bar", "0.2", "1.0", "--stroke-mm", "40", "-o", str(out)]
    assert main(words) == 0
    stem = Valve.from_file(load_valve(out), step_s=1e-5, source=str(out))
    for pressure_pa, end_m in ((250e3, 0.04), (0.0, 0.0)):
        stem.advance(pressure_pa, 2.0)
        assert stem.position_m == pytest.approx(end_m, abs=4e-4)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"--area-cm2": ["0"]}, "--area-cm2: must be above 0, at most 100000, it is 0"),
        ({"--range-bar": ["1", "0.2"]}, "--range-bar: must be two gauge pressures, the lower first"),
        ({"--stroke-mm": ["0"]}, "--stroke-mm: must be above 0"),
    ],
)
def test_a_data_sheet_that_cannot_be_is_one_line(
    changed: dict[str, list[str]], said: str, tmp_path: Path, capsys: Capture
) -> None:
    sheet = {
        "--area-cm2": ["700"],
        "--range-bar": ["0.2", "1.0"],
        "--stroke-mm": ["40"],
        "-o": [str(tmp_path / "v.toml")],
    }
    words = [word for key, values in (sheet | changed).items() for word in (key, *values)]
    assert main(["valve", *words]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "v.toml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--of", "seed", "--set", "coulomb_n=x"], "--set: must be NAME=VALUE, as coulomb_n=1300, got 'coulomb_n=x'"),
        (["--of", "seed", "--set", "coulomb=1"], "coulomb: is no parameter of the valve; allowed: mass_kg"),
        (["--of", "seed", "--without", "preload"], "preload: is no effect of the valve; allowed: none"),
        (["--of", "seed", "--area-cm2", "7"], "--area-cm2: describes a data sheet, so --of must not be given"),
        (["--set", "coulomb_n=1"], "--area-cm2: is needed for a data sheet; --of VALVE.toml changes another valve"),
    ],
)
def test_a_valve_that_cannot_be_made_of_another_is_one_line(
    words: list[str], said: str, tmp_path: Path, capsys: Capture
) -> None:
    assert main(["valve", *words, "-o", str(tmp_path / "v.toml")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "v.toml").exists()


def test_units_at_the_end_of_names_and_a_clock_of_another_name_are_proposed(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "log.csv"
    path.write_text("logged,stem_mm,drive_bar\n" + "".join(f"2026-01-31T12:00:0{i},{i}.5,0.{i}\n" for i in range(8)))
    assert main(["import", str(path)]) == 0
    said = capsys.readouterr().out
    assert "--column time_s=logged --column position_m=stem_mm:mm --column command_pa=drive_bar:bar" in said
    assert "the unit of 'drive_bar' is taken from its name: bar" in said
    path.write_text("t_ms,x_pct,drive_in\n" + "".join(f"{i}0,{i}.5,0.{i}\n" for i in range(8)))
    assert main(["import", str(path)]) == 0
    said = capsys.readouterr().out
    assert "command_pa=drive_in:bar" in said  # an input, and no inch


SCADA = "Zeit;Hub;Stell;Status\n" + "".join(
    f"{0.1 * k:.1f};{50 + k % 7};{0.4 + 0.01 * (k % 9):.2f};{'Bad' if k == 5 else 'Good'}\n" for k in range(40)
)


def inspected(path: Path, answers: str, monkeypatch: pytest.MonkeyPatch) -> int:
    path.write_text(SCADA)
    monkeypatch.setattr("sys.stdin", io.StringIO(answers))
    return main(["import", "--inspect", str(path)])


def test_what_a_file_leaves_open_is_asked_and_written_down_for_next_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "trend.csv", tmp_path / "rec.csv"
    assert inspected(path, "s\n%\nbar\nGood\n0.04\n", monkeypatch) == 0
    said = capsys.readouterr().out
    for question in ("unit of 'Zeit'", "unit of 'Hub'", "unit of 'Stell'", "'Status' holds Bad, Good", "the stroke"):
        assert question in said
    mapping = tmp_path / "trend.csv.mapping.toml"
    assert 'command_pa=Stell:bar"' in mapping.read_text()
    assert main(["import", str(path), "--mapping", str(mapping), "-o", str(out)]) == 0
    read = Recording.read(out)
    assert read.position_m[0] == pytest.approx(0.5 * 0.04)
    assert read.columns["command_pa"][0] == pytest.approx(40e3)
    assert np.isnan(read.position_m[5]), "a row that is not good has no value"
    assert inspected(path, "s\n%\nbar\nGood\n0.04\n", monkeypatch) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ("s\n%\n", "--inspect: the answers ended before the questions; nothing was written"),
        ("s\n%\nbar\n\nforty\n", "the stroke: must be a number, as 0.04; got 'forty'"),
        ("s\nfathom\nbar\n\n", "unknown unit 'fathom'"),
    ],
)
def test_a_wrong_answer_is_one_line_and_nothing_is_written(
    answers: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert inspected(tmp_path / "trend.csv", answers, monkeypatch) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "trend.csv.mapping.toml").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[export]\n", "export.column"),
        ("[export]\ncolumn = ['position_m=PV']\n", "export.column: time_s is not given"),
        ("[export]\ncolumn = ['time_s=t', 'position_m=PV:ell', 'command_pa=u']\n", "unknown unit 'ell'"),
        ("[export]\ncolumns = ['time_s=t']\n", "export.columns"),
    ],
)
def test_a_mapping_file_at_fault_is_one_line(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mapping = tmp_path / "map.toml"
    mapping.write_text(text)
    (tmp_path / "trend.csv").write_text(SCADA)
    assert main(["import", str(tmp_path / "trend.csv"), "--mapping", str(mapping)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"positioner import: {mapping}: ")
    assert said in error
    assert error.count("\n") == 1
