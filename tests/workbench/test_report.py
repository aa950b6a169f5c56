"""The report: one file that needs nothing else, the same for the same input, with the numbers of what it reports."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.drive import VALVE
from config.errors import InputError
from config.recording import Recording, write_recording
from positioner.cli.main import main
from tests.workbench.pages import Page, read
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.compare.comparison import Comparison, compare
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.diagnosis.extension_journal import Journal
from workbench.report import Subject, report_comparison, report_diagnosis, report_journal
from workbench.report.plot_series import draw_series, extremes, running_s
from workbench.report.report_html import plot
from workbench.select.separating_experiment import Experiment

plotly = pytest.importorskip("plotly")


def recorded(effect: str, **parameters: float) -> tuple[Recording, Any]:
    valve = drawn_valve(np.random.default_rng(2))
    recording = record_of(with_effect(valve, effect, **parameters), 5, 1500)
    return Recording(recording.columns, {"recorded": "2024-03-01"}), valve


@pytest.fixture(scope="module")
def compared() -> tuple[Comparison, Subject]:
    recording, valve = recorded("ip_lag", time_constant_s=0.2)
    return compare(recording, valve), Subject(valve, ("plant/fit.csv",), recording.metadata)


@pytest.fixture(scope="module")
def diagnosed() -> tuple[Diagnosis, Subject]:
    recording, valve = recorded("preload", force_n=300.0)
    found = diagnose(recording, valve, effects=("preload", "sensor_offset"), workers=1)
    return found, Subject(valve, ("fit.csv",), recording.metadata)


@pytest.fixture(scope="module")
def page(compared: tuple[Comparison, Subject], tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("report") / "compared.html"
    report_comparison(compared[0], path, compared[1])
    return read(path)


@pytest.fixture(scope="module")
def diagnosed_page(diagnosed: tuple[Diagnosis, Subject], tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("report") / "diagnosed.html"
    report_diagnosis(diagnosed[0], path, diagnosed[1])
    return read(path)


def test_a_report_of_a_comparison_fetches_nothing(page: Page) -> None:
    assert page.fetched == []
    assert "url(" not in page.style
    assert "@import" not in page.style
    assert page.policy.startswith("default-src 'none';")
    assert "http" not in page.policy


def test_a_report_of_a_diagnosis_fetches_nothing(diagnosed_page: Page) -> None:
    assert diagnosed_page.fetched == []


def test_the_same_input_gives_the_same_bytes(compared: tuple[Comparison, Subject], tmp_path: Path) -> None:
    for name in ("one.html", "other.html"):
        report_comparison(compared[0], tmp_path / name, compared[1])
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "other.html").read_bytes()


def test_the_same_diagnosis_gives_the_same_bytes(diagnosed: tuple[Diagnosis, Subject], tmp_path: Path) -> None:
    for name in ("one.html", "other.html"):
        report_diagnosis(diagnosed[0], tmp_path / name, diagnosed[1])
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "other.html").read_bytes()


def test_a_file_whose_name_is_no_text_is_reported(compared: tuple[Comparison, Subject], tmp_path: Path) -> None:
    report_comparison(compared[0], tmp_path / "page.html", replace(compared[1], recordings=("bad\udcff.csv",)))
    assert "bad\\udcff.csv" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_a_comparison_is_reported_in_full(page: Page, compared: tuple[Comparison, Subject]) -> None:
    wanted = ["verdict", "overlay", "signature", "phases", "friction", "slips", "statistics", "recording", "words"]
    assert page.sections == wanted
    for sentence in compared[0].sentences:
        assert sentence[1:] in page.words
    for said in ("plant/fit.csv", "recorded 2024-03-01", compared[1].valve.valve.name, "does not hold"):
        assert said in page.words


def test_a_diagnosis_is_reported_in_full(diagnosed_page: Page, diagnosed: tuple[Diagnosis, Subject]) -> None:
    wanted = [
        "verdict",
        "fall",
        "overlay",
        "signature",
        "where",
        "ranking",
        "added",
        "indistinguishable",
        "next",
        "undetectable",
        "preview",
    ]
    assert diagnosed_page.sections == [*wanted, "recording", "words"]
    assert diagnosed[0].sentence in diagnosed_page.words


def test_the_phases_have_the_comparison_s_numbers(page: Page, compared: tuple[Comparison, Subject]) -> None:
    rows = page.tables["table-phases"][1:]
    wanted = [each for each in compared[0].phases if each.count]
    for row, phase in zip(rows, wanted, strict=True):
        assert int(row[1][0]) == phase.count
        assert float(row[2][0]) == pytest.approx(1e3 * phase.rms_m, abs=5.1e-4)
        assert float(row[2][1].removesuffix(" m")) == pytest.approx(phase.rms_m, rel=1e-5)
        assert float(row[5][0]) == pytest.approx(1e3 * phase.mean_m, abs=5.1e-4)
        assert float(row[6][0].removesuffix(" %")) == pytest.approx(100.0 * phase.share, abs=0.051)


def test_the_overlay_is_the_comparison_s(page: Page, compared: tuple[Comparison, Subject]) -> None:
    traces = {each["name"]: each for each in page.figures["plot-overlay"]["data"]}
    comparison = compared[0]
    np.testing.assert_allclose(traces["measured"]["y"], 1e3 * comparison.measured_m, atol=1e-4)
    np.testing.assert_allclose(traces["model"]["y"], 1e3 * comparison.simulated_m, atol=1e-4)
    np.testing.assert_allclose(traces["error, model"]["y"], 1e3 * comparison.residual_m, atol=1e-4)
    np.testing.assert_allclose(traces["measured"]["x"], comparison.time_s, atol=1e-5)


def test_the_signature_is_position_over_command(page: Page, compared: tuple[Comparison, Subject]) -> None:
    traces = {each["name"]: each for each in page.figures["plot-signature"]["data"]}
    comparison = compared[0]
    np.testing.assert_allclose(traces["measured"]["x"], 1e-3 * comparison.command_pa, atol=1e-3)
    np.testing.assert_allclose(traces["measured"]["y"], 1e3 * comparison.measured_m, atol=1e-4)
    np.testing.assert_allclose(traces["model"]["y"], 1e3 * comparison.simulated_m, atol=1e-4)


def test_the_signature_of_a_diagnosis_has_both_models(diagnosed_page: Page) -> None:
    assert [each["name"] for each in diagnosed_page.figures["plot-signature"]["data"]] == [
        "measured",
        "before",
        "after",
    ]


def test_the_error_falls_on_a_logarithmic_axis_that_shows_the_floor(
    diagnosed_page: Page, diagnosed: tuple[Diagnosis, Subject]
) -> None:
    axes = diagnosed_page.figures["plot-fall"]["layout"]
    (floor,) = axes["shapes"]
    low, high = axes["yaxis"]["range"]
    assert axes["yaxis"]["type"] == "log"
    assert floor["y0"] == pytest.approx(1e3 * (diagnosed[0].split.floor_m or 0.0))
    assert low < np.log10(floor["y0"]) < high


def test_the_ranking_has_the_diagnosis_s_numbers(diagnosed_page: Page, diagnosed: tuple[Diagnosis, Subject]) -> None:
    candidates = {each.name: each for each in diagnosed[0].steps[0].candidates}
    for row in diagnosed_page.tables["table-ranking-1"][1:]:
        candidate = next(each for name, each in candidates.items() if row[0][0].startswith(name))
        assert candidate.model is not None
        assert float(row[2][1].removesuffix(" m")) == pytest.approx(candidate.model.errors.test_rmse_m, rel=1e-5)
        assert candidate.rejection_reason in row[1][0]
    assert len(diagnosed_page.tables["table-ranking-1"]) == len(candidates) + 1


def test_what_no_record_tells_apart_is_said_so(diagnosed_page: Page, diagnosed: tuple[Diagnosis, Subject]) -> None:
    assert (diagnosed[0].verdict, diagnosed[0].missing) == ("one_of", ("preload",))
    assert diagnosed[0].indistinguishable == (("preload", "sensor_offset"),)
    assert diagnosed[0].experiment is None
    (row,) = diagnosed_page.tables["table-indistinguishable"][1:]
    assert {row[0][0], row[1][0]} == {"preload", "sensor_offset"}
    assert "equations are the same" in row[2][0]


def test_the_experiment_is_drawn(diagnosed: tuple[Diagnosis, Subject], tmp_path: Path) -> None:
    chosen = Experiment("staircase", 7.25, np.arange(4.0), np.array([1e4, 2e4, 3e4, 1e4]))
    path = tmp_path / "chosen.html"
    report_diagnosis(replace(diagnosed[0], experiment=chosen), path, diagnosed[1], ["positioner extend <one>"])
    page = read(path)
    assert page.figures["plot-experiment"]["data"][0]["y"] == [10.0, 20.0, 30.0, 10.0]
    for said in ("staircase", "7.25 times", "positioner extend <one>"):
        assert said in page.words


def test_an_experiment_that_separates_nothing_is_not_asked_for(
    diagnosed: tuple[Diagnosis, Subject], tmp_path: Path
) -> None:
    useless = Experiment("staircase", 0.97, np.arange(4.0), np.array([1e4, 2e4, 3e4, 1e4]))
    path = tmp_path / "useless.html"
    report_diagnosis(replace(diagnosed[0], experiment=useless), path, diagnosed[1], ["positioner extend <one>"])
    assert "plot-experiment" not in read(path).figures
    assert "no input of the menu tells all rivals apart" in replace(diagnosed[0], experiment=useless).summary()


def test_plotly_knows_all_that_is_drawn(page: Page, diagnosed_page: Page) -> None:
    from plotly import graph_objects

    figures = [*page.figures.values(), *diagnosed_page.figures.values()]
    assert len(figures) > 12
    for each in figures:
        graph_objects.Figure(each)


def test_a_name_is_text_not_markup(compared: tuple[Comparison, Subject], tmp_path: Path) -> None:
    comparison, subject = compared
    valve = subject.valve.valve.model_copy(update={"name": "</script><img src=x>"})
    hostile = replace(subject, valve=subject.valve.model_copy(update={"valve": valve}), recordings=("<b>&amp;",))
    report_comparison(comparison, tmp_path / "hostile.html", hostile)
    page = read(tmp_path / "hostile.html")
    assert page.fetched == []
    assert "<b>&amp;" in page.words


def test_a_plot_s_data_cannot_end_their_script(tmp_path: Path) -> None:
    path = tmp_path / "plot.html"
    path.write_text(plot("name", {"title": "</script><img src=x>"}, 100, "caption"), encoding="utf-8")
    page = read(path)
    assert page.fetched == []
    assert page.figures["name"] == {"title": "</script><img src=x>"}


def test_without_plotly_one_line_says_so(
    compared: tuple[Comparison, Subject], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(InputError, match="needs plotly, which is not installed") as caught:
        report_comparison(compared[0], tmp_path / "compared.html", compared[1])
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "compared.html").exists()


def test_a_folder_that_is_not_there_is_named(compared: tuple[Comparison, Subject], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape(str(tmp_path / "none" / "a.html"))):
        report_comparison(compared[0], tmp_path / "none" / "a.html", compared[1])


STEP = {
    "effects": ("ip_lag",),
    "why": "evidence 99",
    "given_train_rmse_m": 4e-3,
    "given_test_rmse_m": 5e-3,
    "refitted_train_rmse_m": 1e-3,
    "refitted_test_rmse_m": 1.5e-3,
    "extended_train_rmse_m": 3e-4,
    "extended_test_rmse_m": 4e-4,
    "floor_m": 5e-5,
    "parameters": {"ip_lag.time_constant_s": 0.08},
}


def test_a_journal_shows_the_error_at_each_step(tmp_path: Path) -> None:
    second = STEP | {"effects": ("preload", "<b>"), "extended_train_rmse_m": 5.1e-5, "extended_test_rmse_m": 5.2e-5}
    report_journal(Journal.model_validate({"steps": (STEP, second)}), tmp_path / "journal.html", "FV-1", VALVE)
    page = read(tmp_path / "journal.html")
    assert page.fetched == []
    bars = {each["name"]: each for each in page.figures["plot-journal"]["data"]}
    assert bars["held out"]["x"] == ["as given", "refitted", "1: + ip_lag", "2: + preload, <b>"]
    assert bars["held out"]["y"] == [5.0, 1.5, 0.4, 0.052]
    assert bars["fitted"]["y"] == [4.0, 1.0, 0.3, 0.051]
    assert [row[0][0] for row in page.tables["table-journal"][1:]] == bars["held out"]["x"]
    assert page.tables["table-step-1"][1][1] == ("0.08", "ip_lag.time_constant_s = 0.08")
    assert "evidence 99" in page.words


def test_thinning_keeps_every_extreme() -> None:
    value = np.sin(np.arange(100_000) * 0.01)
    value[54_321], value[77_777] = 9.0, -9.0
    rows = extremes(value, 2_000)
    assert rows.size <= 2_000
    assert np.all(np.diff(rows) > 0)
    assert {54_321, 77_777} <= set(rows.tolist())


def test_thinning_breaks_the_line_where_nothing_was_measured() -> None:
    value = np.arange(10_000.0)
    value[4_000:6_000] = np.nan
    value[8_123] = np.nan
    rows = extremes(value, 300)
    kept = value[rows]
    assert kept[0] == 0.0
    assert kept[-1] == 9_999.0
    assert np.isfinite(kept).sum() == 160
    assert 8_123 in rows
    assert np.isnan(kept[(rows >= 4_000) & (rows < 6_000)]).all()


def test_a_line_is_broken_where_the_clock_is_set_back() -> None:
    time_s = np.concatenate([np.arange(0.0, 5.0), np.arange(2.0, 6.0)])
    series = draw_series(time_s, np.arange(9.0))
    assert np.flatnonzero(np.isnan(series.value)).tolist() == [5]
    assert np.all(np.diff(running_s(time_s)) > 0.0)


def test_a_model_that_holds_is_said_to_hold(tmp_path: Path) -> None:
    recording = record_of(SEED, 1, 1500)
    comparison = compare(recording, SEED)
    assert comparison.adequate
    report_comparison(comparison, tmp_path / "held.html", Subject(SEED, ("rec.csv",)))
    assert "The model holds." in read(tmp_path / "held.html").words


def test_a_recording_without_motion_judges_nothing(tmp_path: Path) -> None:
    columns = dict(record_of(SEED, 1, 500).columns)
    columns["position_m"] = 0.02 + 5e-5 * np.random.default_rng(0).standard_normal(500)
    columns["command_pa"] = np.full(500, 3e4)
    report_comparison(compare(Recording(columns), SEED), tmp_path / "still.html", Subject(SEED, ("rec.csv",)))
    words = read(tmp_path / "still.html").words
    assert "cannot judge the model" in words
    assert "does not hold" not in words


def test_compare_writes_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "rec.csv", record_of(SEED, 1, 1500))
    words = ["compare", str(tmp_path / "rec.csv"), "--valve", "seed", "--report"]
    assert main([*words, str(tmp_path / "compared.html")]) == 0
    assert str(tmp_path / "rec.csv") in read(tmp_path / "compared.html").words
    assert main([*words, str(tmp_path / "none" / "compared.html")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
