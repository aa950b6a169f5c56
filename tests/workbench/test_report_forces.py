"""The report of a balance of forces: one file, with the numbers of what it reports."""

from pathlib import Path

import numpy as np
import pytest

from config.recording import write_recording
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from tests.workbench.benches import VALVE, benches
from tests.workbench.pages import Page, read
from workbench.forces.force_balance import balanced_n
from workbench.forces.force_diagnosis import ForceDiagnosis, diagnose_forces
from workbench.report import Subject, report_forces

plotly = pytest.importorskip("plotly")

CURVE = "branch,pressure_pa,position_m\n" + "".join(
    f"{branch},{3e4 + 1e6 * x + way * (2e3 + 2e5 * x):.1f},{x:.4f}\n"
    for branch, way in (("rising", 1.0), ("falling", -1.0))
    for x in np.linspace(0.001, 0.04, 15)
)
"""Friction that grows over the stroke."""


@pytest.fixture(scope="module")
def diagnosed() -> ForceDiagnosis:
    return diagnose_forces(benches(1, mu=1e-4), VALVE)


@pytest.fixture(scope="module")
def page(diagnosed: ForceDiagnosis, tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("report") / "forces.html"
    report_forces(diagnosed, path, Subject(VALVE, ("seal.csv",)))
    return read(path)


def test_it_is_reported_in_full_and_fetches_nothing(page: Page, diagnosed: ForceDiagnosis) -> None:
    wanted = ["verdict", "fall", "friction", "where", "ranking", "added", "indistinguishable", "recording", "words"]
    assert page.sections == wanted
    assert page.fetched == []
    for said in (diagnosed.sentence, "seal.csv", "3 recordings", "The missing effect is found."):
        assert said in page.words


def test_the_tables_have_the_diagnosis_s_numbers(page: Page, diagnosed: ForceDiagnosis) -> None:
    base, best = page.tables["table-fall"][1:]
    assert base[2][1] == f"{diagnosed.base.test_rms_n:.6g} N"
    assert best[0][0] == "+ pressure_friction"
    assert best[2][1] == f"{diagnosed.best.test_rms_n:.6g} N"
    outcomes = {row[0][0].removesuffix("\n"): row[1][0] for row in page.tables["table-ranking-1"][1:]}
    for each in diagnosed.steps[0].candidates:
        (said,) = (outcome for name, outcome in outcomes.items() if name.startswith(each.name))
        assert said == "added" if each.name == "pressure_friction" else each.rejection_reason in said
    parameters = {row[0][0]: row for row in page.tables["table-parameters"][1:]}
    growth = parameters["pressure friction: growth"]
    assert (growth[1][0], growth[4][0]) == ("–", "N/kPa")
    assert float(growth[2][0]) == pytest.approx(0.1, rel=0.05)


def test_friction_and_what_is_left_of_it_are_drawn(page: Page, diagnosed: ForceDiagnosis) -> None:
    measured, balance = page.figures["plot-friction"]["data"]
    every = -(-len(diagnosed.rows) // 6000)
    left_n = np.array(measured["y"]) - np.array(balance["y"])
    np.testing.assert_allclose(left_n, diagnosed.best.residual_n[::every], atol=2e-3)
    opening = diagnosed.rows.direction[::every] > 0.0
    level_n = np.median(np.array(measured["y"])[opening])
    assert level_n == pytest.approx(60.0 + 1e-4 * float(np.median(diagnosed.rows.pressure_pa)), rel=0.1)
    before, after = page.figures["plot-over-pressure"]["data"]
    assert max(np.abs(before["y"])) > 4.0 * max(np.abs(after["y"]))
    assert before["y"][-1] > 4.0 > -1.0 > before["y"][0], "the stem resists the more, the higher the pressure"


def test_what_is_balanced_is_the_load_of_a_bench(diagnosed: ForceDiagnosis) -> None:
    assert balanced_n(diagnosed.rows, VALVE.valve) is diagnosed.rows.load_n


def test_the_command_reports_a_bench(tmp_path: Path) -> None:
    files = [str(tmp_path / f"{i}.csv") for i in range(3)]
    for file, recording in zip(files, benches(1, mu=1e-4), strict=True):
        write_recording(Path(file), recording)
    (tmp_path / "valve.toml").write_text(valve_toml(VALVE), encoding="utf-8")
    report = tmp_path / "forces.html"
    assert main(["diagnose", *files, "--valve", str(tmp_path / "valve.toml"), "--report", str(report)]) == 1
    words = read(report).words
    assert all(file in words for file in files)


def test_a_static_curve_shows_every_reading_and_has_no_floor(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    report = tmp_path / "curve.html"
    assert main(["diagnose", str(tmp_path / "curve.csv"), "--valve", "seed", "--report", str(report)]) == 1
    page = read(report)
    assert "each place is passed once" in page.words
    assert len(page.figures["plot-over-opening"]["data"][0]["x"]) == 13
    assert page.figures["plot-fall"]["layout"]["shapes"] == []
    assert "plot-over-pressure" not in page.figures


def test_plotly_knows_all_that_is_drawn(page: Page) -> None:
    from plotly import graph_objects

    for each in page.figures.values():
        graph_objects.Figure(each)
