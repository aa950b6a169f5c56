"""Fleet: manifests, a small plant on real workers, killed workers and clients, reruns, what changed since."""

import re
import shutil
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from pyarrow import parquet

from config.valve_file import ValveFile, valve
from config.valve_file_writer import write_valve
from positioner.cli.main import main
from tests.workbench.fleets import HEAD, examined_here, plant, play, record, tables
from workbench.fleet.examination import Change, Examination
from workbench.fleet.fleet import fleet
from workbench.fleet.manifest import Entry, read_manifest
from workbench.fleet.model_changes import changed_since
from workbench.fleet.tables import write_tables
from workbench.fleet.valve_complaints import ValveCourse

PLACES = {"valve": "V", "file": "V.toml", "recording": "r.csv"}
ROOT = Path(__file__).parents[2]


@pytest.fixture
def without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    examined_here(monkeypatch)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plant(tmp_path_factory.mktemp("plant"), alike=True)


@pytest.fixture(scope="module")
def ranked(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole run."""
    out = tmp_path_factory.mktemp("ranked")
    with pytest.MonkeyPatch.context() as patch:
        examined_here(patch)
        assert main(["fleet", str(site), "--out", str(out), "--report", str(out / "fleet.html")]) == 1
    return out


def test_the_valves_are_ranked_by_what_their_recordings_say(site: Path, ranked: Path, without_dask: None) -> None:
    found = fleet(site, ranked)
    assert [course.name for course in found.complaining] == ["play", "tight"]
    loose, tight = found.complaining
    assert (loose.kind, loose.sure) == ("play or stop", "sure")
    assert loose.gravest
    assert loose.gravest[1].effects == ("backlash",)
    assert f"{loose.gravest[0].time:%m}" == "02"
    assert tight.kind == "sticks"
    assert {each.name for each in tight.gravest[1].changes} >= {"coulomb_n"}  # type: ignore[index]
    assert {(name, entry.recording) for name, entry, _ in found.bad} == {
        ("bad", "recordings/bad-2.csv"),
        ("absent", "recordings/absent.csv"),
    }
    assert (found.count, len(found.courses)) == (9, 5)
    assert re.findall(r"\d+", found.summary().splitlines()[0])[:4] == ["2", "5", "1", "9"]


def test_a_second_run_examines_nothing_anew_and_is_the_same_to_the_byte(
    site: Path, ranked: Path, capsys: pytest.CaptureFixture[str], without_dask: None
) -> None:
    before, page = tables(ranked), (ranked / "fleet.html").read_bytes()
    assert len(before) == 3
    main(["fleet", str(site), "--out", str(ranked), "--report", str(ranked / "fleet.html"), "--since", "2026-01-15"])
    assert (tables(ranked), (ranked / "fleet.html").read_bytes()) == (before, page)
    said = capsys.readouterr().out
    assert "9 recordings, 1 of them examined now" in said, "the unreadable one, which is tried again"
    assert "since 2026-01-15: 2 valves have another model" in said
    assert re.search(r"play +backlash.width_m +none +0.00\d+ +play or stop", said)
    assert re.search(r"tight +coulomb_n +1423.4 .*\+5\d\.\d % +sticks", said)


def test_a_new_recording_is_held_against_the_model_that_the_last_one_left(
    site: Path, ranked: Path, tmp_path: Path, without_dask: None
) -> None:
    shutil.copytree(site.parent, tmp_path / "site")
    shutil.copytree(ranked, tmp_path / "out")
    record(play(), tmp_path / "site" / "recordings" / "play-3.csv", 99)
    with (tmp_path / "site" / "plant.csv").open("a") as file:
        file.write("play,seed.toml,recordings/play-3.csv,2026-03-01\n")
    found = fleet(tmp_path / "site" / "plant.csv", tmp_path / "out")
    assert found.examined == 2, "the new one, and the unreadable one again"
    course = next(course for course in found.courses if course.name == "play")
    assert [each.outcome for _, each in course.examined] == ["as_before", "missing", "as_before"]
    assert course.gravest
    assert f"{course.gravest[0].time:%m}" == "02", "it still complains, since then"


def test_the_page_and_the_tables_tell_what_was_found(ranked: Path) -> None:
    page = (ranked / "fleet.html").read_text()
    assert page.index("play or stop") < page.index("sticks")
    assert "positioner diagnose recordings/play-2.csv --valve seed.toml --report play.html" in page
    assert "column time_s is missing" in page
    assert str(ranked.parent) not in page
    assert "</h2>\n<p>absent</p>" in page
    assert "</h2>\n<p>bad, well</p>" in page
    ranking = page[: page.index("<details")]
    assert ranking.count("<svg") == 2
    assert '<a href="#history-1">' in ranking
    assert (report := re.search(r'<a href="(reports/\w+\.html)">The diagnosis report', page))
    assert "Valve “play”: which effect is missing" in (ranked / report[1]).read_text()
    assert "://" not in page
    rows = parquet.read_table(ranked / "valves.parquet").to_pylist()
    assert [row["valve"] for row in rows[:2]] == ["play", "tight"]
    assert rows[0]["effects"] == "backlash"
    assert rows[0]["cost_share"] == pytest.approx(0.0196, rel=0.05)
    assert rows[0]["since"] == datetime(2026, 2, 1)
    true = valve("seed").valve
    dead_band = 2.0 * true.coulomb_n / (true.spring_n_per_m * true.stroke_m)
    assert rows[0]["dead_band_share"] == pytest.approx(dead_band, rel=0.02)
    models = parquet.read_table(ranked / "models.parquet").to_pylist()
    assert {row["valve"] for row in models} == {"play", "tight"}
    assert ValveFile.model_validate(tomllib.loads(models[0]["text"]))
    assert models[0]["error_after_m"] < 1e-4 < models[0]["error_before_m"]


def test_the_columns_are_of_the_same_types_whatever_was_found(tmp_path: Path, ranked: Path, without_dask: None) -> None:
    (tmp_path / "plant.csv").write_text(HEAD + "a,seed,absent.csv,2026-01-01T00:00+01:00\n")
    write_tables(fleet(tmp_path / "plant.csv", tmp_path / "out").courses, tmp_path / "out")
    for name in ("valves", "recordings", "models"):
        nothing, much = (parquet.read_schema(folder / f"{name}.parquet") for folder in (tmp_path / "out", ranked))
        for one, other in zip(nothing, much, strict=True):
            assert one.name == other.name
            assert one.type == (pa.timestamp("us", tz="UTC") if other.type == pa.timestamp("us") else other.type)
            assert one.metadata[b"meaning"]
    (row,) = parquet.read_table(tmp_path / "out" / "valves.parquet").to_pylist()
    assert (row["kind"], row["outcome"], row["cost_share"]) == ("nothing known", "unreadable", None)
    (row,) = parquet.read_table(tmp_path / "out" / "recordings.parquet").to_pylist()
    assert row["when"] == datetime(2025, 12, 31, 23, tzinfo=UTC)


def test_what_changed_is_drawn_and_a_date_that_cannot_be_compared_refused(
    site: Path, ranked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], without_dask: None
) -> None:
    words = ["fleet", str(site), "--out", str(ranked)]
    assert main([*words, "--since", "2026-01-15", "--picture", str(tmp_path / "since.png")]) == 1
    assert (tmp_path / "since.png").stat().st_size > 5000
    changes = fleet(site, ranked).changed_since(datetime(2026, 1, 15))
    assert set(zip(*list(changes.frame_columns().values())[:2], strict=True)) >= {
        ("play", "backlash.width_m"),
        ("tight", "coulomb_n"),
    }
    (axes,) = changes.plot().axes
    assert "play  backlash.width_m" in [each.get_text() for each in axes.get_yticklabels()]
    capsys.readouterr()
    assert main([*words, "--since", "2026-01-15T00:00+00:00"]) == 2
    assert "must have no offset" in capsys.readouterr().err
    assert main([*words, "--picture", str(tmp_path / "since.png")]) == 2
    assert "--picture: draws what changed since a date" in capsys.readouterr().err


def course(*changes: dict[str, tuple[float, float]]) -> ValveCourse:
    """A valve whose first recording was as its drawing says, and what changed at each that followed."""
    made = ValveCourse("V")
    found = [Examination(outcome="as_before", sentence="")]
    for each in changes:
        parts = tuple(Change(name=name, before=a, now=b, lower=b, upper=b) for name, (a, b) in each.items())
        found.append(Examination(outcome="changed", sentence="", changes=parts))
    for month, came in enumerate(found, start=1):
        made.take(Entry.model_validate({**PLACES, "when": f"2026-{month:02}-01"}), came)
    return made


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ([{"coulomb_n": (1000.0, 1300.0), "static_n": (1200.0, 1500.0)}], "sticks"),
        ([{"coulomb_n": (1000.0, 1100.0)}, {"coulomb_n": (1100.0, 1210.0)}], "drifts, sticks"),
        ([{"coulomb_n": (1000.0, 1100.0)}, {"coulomb_n": (1100.0, 1000.0)}], "sticks"),
        ([{"spring_n_per_m": (5e4, 5.5e4), "coulomb_n": (1000.0, 1100.0)}], "air supply or leak"),
        ([{"spring_n_per_m": (5e4, 5.5e4)}], "lost calibration, spring or diaphragm"),
        (
            [{"spring_n_per_m": (5e4, 5.5e4), "coulomb_n": (1000.0, 1500.0)}],
            "lost calibration, spring or diaphragm, sticks",
        ),
    ],
)
def test_what_changed_is_called_what_an_engineer_calls_it(changes: list[Any], kind: str) -> None:
    assert course(*changes).kind == kind


@pytest.mark.parametrize("outcome", ["untrusted", "unjudged", "unfinished", "untold"])
def test_what_nobody_has_judged_is_not_called_something_new(outcome: str) -> None:
    made = ValveCourse("V")
    made.take(Entry.model_validate({**PLACES, "when": "2026-01-01"}), Examination(outcome=outcome, sentence=""))
    assert (made.kind, made.sure) == ("not judged", "not sure what")


def seen(*outcomes: tuple[str, str]) -> ValveCourse:
    """A valve whose recordings, a month apart, had these outcomes and effects."""
    made = ValveCourse("V")
    for month, (outcome, effect) in enumerate(outcomes, start=1):
        entry = Entry.model_validate({**PLACES, "when": f"2026-{month:02}-01"})
        effects = (effect,) if effect else ()
        made.take(entry, Examination(outcome=outcome, sentence="", effects=effects))
    return made


@pytest.mark.parametrize(
    ("outcomes", "month"),
    [
        ([("as_before", ""), ("one_of", "preload"), ("one_of", "preload"), ("one_of", "preload")], 2),
        ([("unexplained", ""), ("unexplained", "")], 1),
        ([("one_of", "preload"), ("unreadable", ""), ("one_of", "preload")], 1),
        ([("one_of", "preload"), ("as_before", ""), ("one_of", "preload")], 3),
        ([("one_of", "backlash"), ("one_of", "preload")], 2),
        ([("as_before", ""), ("changed", ""), ("changed", "")], 3),
    ],
)
def test_what_is_seen_again_and_again_is_there_since_it_was_seen_first(
    outcomes: list[tuple[str, str]], month: int
) -> None:
    course = seen(*outcomes)
    assert course.since == datetime(2026, month, 1)
    assert course.gravest
    assert course.gravest[0].time.month == len(outcomes), "told by the latest"


def test_what_was_there_before_is_no_change() -> None:
    course = seen(("as_before", ""), ("one_of", "preload"), ("one_of", "preload"), ("one_of", "preload"))
    assert not changed_since([course], datetime(2026, 2, 15)).complaints
    (complaint,) = changed_since([course], datetime(2026, 1, 15)).complaints
    assert complaint.since == datetime(2026, 2, 1)


def test_a_fleet_of_which_nothing_is_known_deserves_a_look(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], without_dask: None
) -> None:
    (tmp_path / "plant.csv").write_text(HEAD + "a,seed,absent.csv,2026-01-01\n")
    assert main(["fleet", str(tmp_path / "plant.csv"), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().out.startswith("0 of 1 valves ")


@pytest.mark.parametrize(("share", "gain", "kind"), [(0.85, 1.0, "air supply or leak"), (1.0, 0.9, "lost calibration")])
def test_a_leak_and_a_lost_calibration_are_told_from_a_packing(
    tmp_path: Path, without_dask: None, share: float, gain: float, kind: str
) -> None:
    """Of the pressure asked for a share arrives; the position is read by another scale."""
    well = valve("seed")
    record(well, tmp_path / "recordings" / "V-1.csv", 0)
    record(well, tmp_path / "recordings" / "V-2.csv", 1, share=share, gain=gain)
    write_valve(tmp_path / "V.toml", well)
    rows = [f"V,V.toml,recordings/V-{i}.csv,2026-0{i}-01\n" for i in (1, 2)]
    (tmp_path / "plant.csv").write_text(HEAD + "".join(rows))
    (found,) = fleet(tmp_path / "plant.csv", tmp_path / "out").courses
    assert [each.outcome for _, each in found.examined] == ["as_before", "changed"]
    assert found.kind.startswith(kind)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("valve,file,when\n", "columns must be valve, file, recording, when, got valve, file, when"),
        (HEAD, "plant.csv: names no recording: under its first line stands a row for each"),
        (HEAD + "a,seed,r.csv,20260301\n", "plant.csv: line 2: when: must be a date or time, 2026-03-01"),
        (
            HEAD + "a,seed,q.csv,2026-12-30\n\na,seed,r.csv,31.12.2026\n",
            "plant.csv: line 4: when: must be a date or time, 2026-03-01 or 2026-03-01T14:00, got 31.12.2026",
        ),
        (
            HEAD + "a,seed,r.csv,\n",
            "plant.csv: line 2: when: must be a date or time, 2026-03-01 or 2026-03-01T14:00, got nothing",
        ),
        (HEAD + "a,seed,r.csv,2026-01-01\na,ordinary,s.csv,2026-01-02\n", "a: file is seed and ordinary; a valve has"),
        (HEAD + "a,seed,r.csv,2026-01-01\nb,seed,r.csv,2026-01-02\n", "r.csv: valve is a and b; it is of one valve"),
        (HEAD + "a,seed,r.csv,2026-01-01\nb,seed,./r.csv,2026-01-02\n", "r.csv: valve is a and b; it is of one valve"),
        (HEAD + "a,seed,r.csv,2026-01-01\na,seed,s.csv,2026-01-01\n", "a: two recordings of 2026-01-01"),
        (
            HEAD + "a,seed,r.csv,2026-01-01T00:00Z\na,seed,s.csv,2026-02-01\n",
            "when: some times have an offset and some",
        ),
    ],
)
def test_a_manifest_that_is_wrong_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    path = tmp_path / "plant.csv"
    path.write_text(text)
    assert main(["fleet", str(path), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
    assert not (tmp_path / "out").exists()


def test_a_number_is_no_date_in_a_toml_manifest_either(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "plant.toml"
    path.write_text('[[recording]]\nvalve = "a"\nfile = "seed"\nrecording = "r.csv"\nwhen = 20260301\n')
    assert main(["fleet", str(path), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert "recording.0.when: must be a date or time, 2026-03-01 or 2026-03-01T14:00, got 20260301" in err


def test_recordings_in_other_units_are_listed_and_the_others_go_on(
    site: Path, tmp_path: Path, without_dask: None
) -> None:
    lines = (site.parent / "recordings" / "well-1.csv").read_text().splitlines()
    head, cells = lines[1], [line.split(",") for line in lines[2:]]
    millimetres = [f"{time},{command},{1e3 * float(position)}" for time, command, position in cells]
    bar = [f"{time},{1e-5 * float(command)},{position}" for time, command, position in cells]
    for name, rows in {"mm": millimetres, "bar": bar, "si": [",".join(each) for each in cells]}.items():
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *rows, ""]))
    names = ("mm", "bar", "si")
    (tmp_path / "plant.csv").write_text(HEAD + "".join(f"{name},seed,{name}.csv,2026-01-01\n" for name in names))
    found = fleet(tmp_path / "plant.csv", tmp_path / "out")
    reasons = {name: reason for name, _, reason in found.bad}
    assert "it looks like per cent (%) or mm" in reasons["mm"]
    assert "it looks like bar" in reasons["bar"]
    assert set(reasons) == {"mm", "bar"}


def test_a_manifest_may_be_toml_and_have_semicolons(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(
        "[[recording]]\nvalve = 'a'\nfile = 'seed'\nrecording = 'r.csv'\nwhen = 2026-01-02\n"
    )
    (tmp_path / "plant.csv").write_text("\ufeffwhen;valve;file;recording\n2026-01-02;a;seed;r.csv\n", encoding="utf-8")
    manifests = [read_manifest(tmp_path / name) for name in ("plant.toml", "plant.csv")]
    assert manifests[0].valves == manifests[1].valves


def test_a_folder_of_another_form_is_refused(site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "fleet.json").write_text('{"form": 7}\n')
    assert main(["fleet", str(site), "--out", str(tmp_path)]) == 2
    assert "form: is 7, allowed is 1" in capsys.readouterr().err
