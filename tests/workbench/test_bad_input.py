"""Bad recordings: one line that says what is wrong, from every command and from the API; or an honest verdict."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Column, Recording, write_recording
from positioner.cli.main import main
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, PERIOD_S, SEED, record_of
from workbench.compare.comparison import compare
from workbench.data.held_out import split
from workbench.data.record import MOST_WORK, ready, require_fittable
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.extension import extend
from workbench.fit.fitting import fit

Capture = pytest.CaptureFixture[str]
Columns = dict[str, Column]
Asked = Callable[[Recording], object]

STROKE_M = SEED.valve.stroke_m
MOVES: dict[str, Asked] = {
    "fit": lambda recording: fit(recording, SEED, workers=1),
    "diagnose": lambda recording: diagnose(recording, SEED, workers=1),
    "extend": lambda recording: extend(recording, SEED, ("backlash",), workers=1),
}
"""What needs motion."""
ASKED: dict[str, Asked] = {"compare": lambda recording: compare(recording, SEED), **MOVES}


def sound() -> Columns:
    return dict(record_of(SEED, 3, 600).columns)


def swapped() -> Columns:
    columns = sound()
    return columns | {"position_m": columns["command_pa"], "command_pa": columns["position_m"]}


def scaled(name: str, factor: float) -> Columns:
    columns = sound()
    return columns | {name: factor * columns[name]}


def still() -> Columns:
    columns = sound()
    noise = 1e-5 * np.random.default_rng(1).standard_normal(600)
    return columns | {"position_m": np.asarray(0.05 + noise)}


def opening_only() -> Columns:
    """Jumps up by a stair each."""
    columns = sound()
    stairs = np.repeat([0.01, 0.02, 0.03, 0.04, 0.05, 0.06], 100)
    noise = 1e-5 * np.random.default_rng(1).standard_normal(600)
    return columns | {"command_pa": 3e4 + 5e5 * stairs, "position_m": stairs + noise}


def disordered() -> Columns:
    columns = sound()
    return columns | {"time_s": np.random.default_rng(1).permutation(columns["time_s"])}


def without(name: str) -> Columns:
    columns = sound()
    del columns[name]
    return columns


UNUSABLE: dict[str, tuple[Columns, str]] = {
    "per cent": (scaled("position_m", 100.0 / STROKE_M), "it looks like per cent (%) or mm"),
    "swapped": (swapped(), "they stand in each other's place; change their names"),
    "shares": (scaled("position_m", 1.0 / STROKE_M), "it looks like a share of the stroke"),
    "bar": (scaled("command_pa", 1e-5), "it looks like bar"),
    "psi": (scaled("command_pa", 1.0 / 6894.757), "it looks like psi"),
    "kPa": (scaled("command_pa", 1e-3), "it looks like kPa or per cent (%)"),
    "measured bar": (sound() | {"pressure_pa": 1e-5 * sound()["command_pa"]}, "pressure_pa reaches"),
    "disordered": (disordered(), "time_s must increase: it does not at"),
    "no time": (sound() | {"time_s": np.full(600, np.nan)}, "time_s: sample 1 is not a number"),
    "empty": ({name: column[:0] for name, column in sound().items()}, "holds no samples"),
    "one sample": ({name: column[:1] for name, column in sound().items()}, ""),
    "no position": (sound() | {"position_m": np.full(600, np.nan)}, "position_m: no sample is a number"),
    "no command": (sound() | {"command_pa": np.full(600, np.nan)}, "command_pa: no sample is a number"),
    "no column": (without("command_pa"), "column command_pa is missing; there are: time_s, position_m"),
    "lengths differ": (sound() | {"position_m": np.zeros(5)}, "position_m holds 5 values, time_s 600"),
}


@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize("case", UNUSABLE)
def test_what_cannot_be_used_is_one_line_from_the_api(case: str, asked: str) -> None:
    columns, said = UNUSABLE[case]
    with pytest.raises(InputError) as caught:
        ASKED[asked](Recording(columns))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


TOO_LITTLE: dict[str, tuple[Columns, str]] = {
    "still": (still(), "the stem moves 0 times, at least 2 are needed"),
    "one direction": (opening_only(), "the stem only opens: friction and spring cannot be told apart"),
}


@pytest.mark.parametrize("asked", MOVES)
@pytest.mark.parametrize("case", TOO_LITTLE)
def test_what_says_too_little_is_not_fitted(case: str, asked: str) -> None:
    columns, said = TOO_LITTLE[case]
    with pytest.raises(InputError, match=said):
        MOVES[asked](Recording(columns))


def test_fifty_samples_leave_too_few_to_hold_out() -> None:
    short = Recording({name: column[:50] for name, column in sound().items()})
    for asked in ("diagnose", "extend"):
        with pytest.raises(InputError, match=r"are too few: 40 are needed"):
            MOVES[asked](short)


def test_compare_says_of_a_still_stem_that_it_says_nothing() -> None:
    compared = compare(Recording(still()), SEED)
    assert not compared.adequate
    assert "does not move" in compared.sentences[0]


def test_compare_takes_one_direction_for_what_it_is() -> None:
    compared = compare(Recording(opening_only()), SEED)
    assert not compared.adequate
    assert {each.count for each in compared.phases if each.name == "slipping down"} == {0}


def test_three_jumps_leave_static_friction_open_and_say_so() -> None:
    """Each jump passes break-away by far: where it lies cannot be known, and the interval says so."""
    valve = SEED.valve
    middle_pa = valve.spring_n_per_m * 0.05 / valve.diaphragm_area_m2
    command_pa = np.repeat([middle_pa, middle_pa + 3e4, middle_pa - 3e4, middle_pa + 3e4], 60)
    composition = Composition.from_file(SEED)
    response = respond(
        composition, composition.theta, command_pa[:-1], PERIOD_S, position_m=0.05, pressure_pa=middle_pa
    )
    noise = NOISE_M * np.random.default_rng(1).standard_normal(command_pa.size)
    columns = {
        "time_s": PERIOD_S * np.arange(command_pa.size),
        "command_pa": command_pa,
        "position_m": response.indicated_m + noise,
    }
    static = fit(Recording(columns), SEED, workers=1).parameters["static_n"]
    assert static.lower <= valve.static_n <= static.upper
    assert static.upper > 1.25 * static.lower


def huge(count: int, period_s: float) -> Recording:
    still: Column = np.broadcast_to(np.float64(0.05), count)
    time_s: Column = np.asarray(period_s * np.arange(count), np.float64)
    return Recording({"time_s": time_s, "command_pa": still, "position_m": still})


@pytest.mark.parametrize("asked", MOVES)
def test_what_would_take_hours_to_fit_is_refused_at_once(asked: str) -> None:
    with pytest.raises(InputError, match="would take hours to fit; allowed are 1000000 samples, a slip"):
        MOVES[asked](huge(MOST_WORK + 1, 1e-3))


def test_many_slips_are_refused_though_the_samples_are_few(monkeypatch: pytest.MonkeyPatch) -> None:
    time_s: Column = np.asarray(0.01 * np.arange(8_000), np.float64)
    position_m: Column = np.asarray(0.05 + 0.02 * np.sign(np.sin(time_s * np.pi / 0.08)))
    record = ready(Recording({"time_s": time_s, "command_pa": 8e5 * position_m, "position_m": position_m}))
    require_fittable(record)
    monkeypatch.setattr("workbench.data.record.MOST_WORK", 8_000 + 20 * 998)
    with pytest.raises(InputError, match="8000 samples with 999 slips would take hours to fit"):
        require_fittable(record)


def test_days_are_no_reason_to_refuse() -> None:
    with pytest.raises(InputError, match="the stem moves"):
        fit(huge(10_000, 10.0), SEED, workers=1)


def test_ten_million_rows_are_refused_in_no_time() -> None:
    with pytest.raises(InputError, match="10000000 samples would take hours to fit"):
        diagnose(huge(10_000_000, 1e-3), SEED)


def test_a_gap_of_a_year_is_no_time_to_simulate() -> None:
    columns = sound()
    time_s = columns["time_s"] + np.where(np.arange(600) < 300, 0.0, 3.2e7)
    with pytest.raises(InputError, match="the stem moves"):
        fit(Recording(still() | {"time_s": time_s}), SEED, workers=1)


def test_a_still_stems_noise_holds_no_spikes() -> None:
    assert ready(Recording(still())).valid.all()


HEADER = "time_s,command_pa,position_m\n"
FILES: dict[str, tuple[bytes, str]] = {
    "no bytes": (b"", "is empty; its first line should name the columns: time_s"),
    "header only": (HEADER.encode(), "holds no samples"),
    "backwards": (f"{HEADER}2,4e4,0.01\n1,4e4,0.01\n0,4e4,0.01\n".encode(), "time_s must increase strictly: sample 2"),
    "words": (f"{HEADER}0,4e4,open\n".encode(), "line 2: 'open' is not a number"),
    "short line": (f"{HEADER}0,4e4,0.01\n1,4e4\n2,4e4,0.01\n".encode(), "line 3: 2 values, the header names 3"),
    "binary": (b"\x1f\x8b\x08\x00\xff\xfe\x00", "is not a CSV file"),
    "wrong columns": (b"t,u,y\n0,1,2\n", "column time_s is missing; line 1 names: t, u, y"),
}


def commands(path: str, out: Path) -> list[list[str]]:
    return [
        ["compare", path, "--valve", "seed"],
        ["diagnose", path, "--valve", "seed"],
        ["extend", "seed", "--effect", "backlash", "--fit", path, "-o", str(out / "new.toml")],
    ]


def refused_in_one_line(words: list[str], path: str, said: str, capsys: Capture) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith(f"positioner {words[0]}: {path}: ")
    assert said in printed.err
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_recording_is_one_line(case: str, tmp_path: Path, capsys: Capture) -> None:
    text, said = FILES[case]
    (tmp_path / "rec.csv").write_bytes(text)
    path = str(tmp_path / "rec.csv")
    for words in commands(path, tmp_path):
        refused_in_one_line(words, path, said, capsys)


@pytest.mark.parametrize("case", ["per cent", "bar", "psi"])
def test_a_recording_that_cannot_be_used_is_one_line(case: str, tmp_path: Path, capsys: Capture) -> None:
    columns, said = UNUSABLE[case]
    write_recording(tmp_path / "rec.csv", Recording(columns))
    path = str(tmp_path / "rec.csv")
    for words in commands(path, tmp_path):
        refused_in_one_line(words, path, said, capsys)


@pytest.mark.parametrize("case", TOO_LITTLE)
def test_a_recording_that_says_too_little_is_one_line(case: str, tmp_path: Path, capsys: Capture) -> None:
    columns, said = TOO_LITTLE[case]
    write_recording(tmp_path / "rec.csv", Recording(columns))
    path = str(tmp_path / "rec.csv")
    for words in commands(path, tmp_path)[1:]:
        refused_in_one_line(words, path, said, capsys)


def test_a_file_cut_off_in_its_last_line_is_used_without_it_and_told(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "rec.csv"
    write_recording(path, record_of(SEED, 3, 600))
    path.write_text(path.read_text()[:-30])
    main(["compare", str(path), "--valve", "seed"])
    assert "recording: torn: the last line" in capsys.readouterr().out


def test_a_parquet_file_cut_off_is_one_line(tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("pyarrow")
    path = tmp_path / "rec.parquet"
    write_recording(path, record_of(SEED, 3, 600))
    path.write_bytes(path.read_bytes()[:-100])
    for words in commands(str(path), tmp_path):
        refused_in_one_line(words, str(path), "is not a Parquet file of numbers", capsys)


@pytest.mark.parametrize(
    "given",
    [
        lambda rec: ([rec], rec),
        lambda rec: ([rec], Recording({name: column[100:] for name, column in rec.columns.items()})),
        lambda rec: ([rec, rec], None),
    ],
    ids=["the same", "its end", "given twice"],
)
def test_what_is_fitted_is_not_held_out(given: Callable[[Recording], tuple[list[Recording], Recording | None]]) -> None:
    fitted, held_out = given(Recording(sound()))
    with pytest.raises(InputError, match=r"^held-out recording: \d+ of its \d+ samples are fitted as well"):
        split(fitted, held_out)


def test_another_recording_that_begins_alike_is_held_out() -> None:
    first, second = sound(), sound()
    half = first["time_s"].size // 2 - 30
    second["position_m"] = np.concatenate([first["position_m"][:half], first["position_m"][half:] + 1e-6])
    assert split([Recording(first)], Recording(second)).test.counted.any()


def test_the_file_of_what_is_held_out_is_named(tmp_path: Path, capsys: Capture) -> None:
    rec, test = tmp_path / "rec.csv", tmp_path / "test.csv"
    write_recording(rec, Recording(sound()))
    write_recording(test, Recording(sound() | {"command_pa": np.full(600, np.nan)}))
    assert main(["diagnose", str(rec), "--valve", "seed", "--test", str(test)]) == 2
    assert capsys.readouterr().err == f"positioner diagnose: {test}: command_pa: no sample is a number\n"
