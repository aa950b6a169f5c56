"""The report as found and as left: every column that tables of plants have, with its +-; what changed; its pictures."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from matplotlib.figure import Figure as Drawn

from config.codes import ValveTestVerdict
from positioner.cli.main import main
from positioner.history.kept_tests import folder_of
from positioner.response.figure import Figure
from positioner.tests_on_the_valve.as_found_report import ValveReport, as_html, recommended_by
from positioner.tests_on_the_valve.kept_records import keep, records
from positioner.tests_on_the_valve.outcome import Outcome, Quantity
from positioner.tests_on_the_valve.signature import signature
from tests.tests_on_the_valve.test_signature import PLATE, TIGHT, recorded
from tests.tests_on_the_valve.virtual_valve import STROKE_M, daemon_file, told

WORN = told(coulomb_n=800.0, static_n=880.0)
STROKES = Outcome(
    "commissioning",
    "FV-1",
    (
        Quantity("opening_s", "opens within", "s", Figure(1.1, 0.05)),
        Quantity("closing_s", "closes within", "s", Figure(None, None, "longer than the 6 s that were <waited>")),
    ),
    (ValveTestVerdict.PASSED,),
)
LAW: dict[str, float] = {"b_over_c_pa_per_m": -2e6, "k_over_c_pa": -6000.0, "offset_pa": 20e3}
CONFIGURATION = {
    "valve": {"name": "FV-1", "stroke_m": STROKE_M},
    "law": LAW,
    "device": {f"key_{number}": 0.0 for number in range(45)},
}
SITE = f"[valve]\nname = 'FV-1'\nstroke_m = {STROKE_M}\n[law]\nb_over_c_pa_per_m = -2e6\nk_over_c_pa = -6000.0\n"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    (folder / "site.toml").write_text(SITE)
    kept = folder_of(folder, "FV-1")
    keep(kept, signature(recorded(WORN), PLATE), "as_found", 1e9, CONFIGURATION)
    keep(kept, signature(recorded(TIGHT, seed=1), PLATE), "as_left", 2e9, CONFIGURATION)
    keep(kept, STROKES, "as_left", 3e9, CONFIGURATION)
    return folder / "site.toml"


class Page(HTMLParser):
    """Rows of cells, and what is fetched."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.fetched += [value for name, value in attrs if name in ("src", "href") and value]
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_every_column_that_tables_of_plants_have_is_there_with_its_plus_minus(site: Path, tmp_path: Path) -> None:
    out = tmp_path / "FV-1.html"
    assert main(["report", str(site), "-o", str(out), "--recommended", "seat_load_n=1200"]) == 0
    text = out.read_text()
    page = Page(text)
    rows = {row[0]: row for row in reversed(page.rows) if row}  # the first of each name
    wanted = (
        "friction",
        "dynamic error band at the slowest rate, largest",
        "linearity: farthest from the best line",
        "seat load",
        "bench set, lower end",
        "bench set, upper end",
        "spring rate",
    )
    for name in wanted:
        assert all("±" in cell for cell in rows[name][2:4]), rows[name]
    assert rows["figure"] == ["figure", "recommended", "as found", "as left"]
    assert rows["seat load"][1] == "1200 N"
    friction = rows["friction at half travel, extrapolated to rate 0"]
    assert [cell.endswith("*") for cell in friction[1:4]] == [False, True, False], "6 kPa: twice of it was found"
    assert rows["opens within"][-1] == "1.100 ± 0.050 s"
    assert rows["closes within"][-1].startswith("cannot be determined: longer than")
    assert rows["bench set, upper end"][1] == "80 kPa"
    assert text.count("packing loose or worn") == 1, "one line, whatever shows it"
    assert page.fetched == []
    assert "&lt;waited&gt;" in text
    assert text.count("<svg") == 1
    assert {"as found", "as left"} <= set(re.findall(r">(as found|as left)</text>", text))
    for field in ("tested by", "accepted by", "signature"):
        assert f"<dt>{field}</dt>" in text


@pytest.mark.long
def test_a_pdf_has_a_page_for_each_with_all_its_words_on_it(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.backends.backend_pdf import PdfPages  # a second of every worker that only collects this file

    out, words = tmp_path / "FV-1.pdf", list[str]()
    drawn: Callable[..., None] = PdfPages.savefig

    def looked_at(pages: PdfPages, figure: Drawn) -> None:
        drawn(pages, figure)
        for each in figure.texts:
            words.append(each.get_text())
            box, page = each.get_window_extent(), figure.bbox
            assert page.x0 <= box.x0 < box.x1 <= page.x1, each.get_text()
            assert page.y0 <= box.y0 < box.y1 <= page.y1, each.get_text()

    monkeypatch.setattr(PdfPages, "savefig", looked_at)
    assert main(["report", str(site), "-o", str(out)]) == 0
    told = "\n".join(words)
    assert "packing loose or worn" in told
    assert told.count("tested by") == told.count("accepted by") == 1
    assert "two standard deviations" in told
    pages = re.findall(rb"/Type /Page\b", out.read_bytes())
    assert len(pages) == 5, "what has changed, signature and its pictures, commissioning, configuration"


@contextmanager
def nothing_kept(folder: Path) -> Iterator[Path]:
    (folder / "site.toml").write_text(SITE)
    yield folder / "site.toml"


def test_bad_input_is_one_line(site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with nothing_kept(tmp_path) as bare:
        assert main(["report", str(bare), "-o", str(tmp_path / "out.html")]) == 1
        assert "nothing is kept in" in capsys.readouterr().err
    assert main(["report", str(site), "-o", str(tmp_path / "out.docx")]) == 2
    assert "allowed are .html and .pdf" in capsys.readouterr().err
    assert main(["report", str(site), "-o", str(tmp_path / "x.html"), "--recommended", "wear=1"]) == 2
    assert "no figure of that name; there are: " in capsys.readouterr().err
    broken = folder_of(site.parent, "FV-1") / "29990101_signature.json"
    broken.write_text("{}")
    try:
        assert main(["report", str(site), "-o", str(tmp_path / "x.html")]) == 2
        assert "is no record of a test on the valve" in capsys.readouterr().err
    finally:
        broken.unlink()


def test_a_note_says_whose_it_is_where_it_is_not_of_all(tmp_path: Path) -> None:
    for number, (kind, notes) in enumerate({"factory": ("no reference", "slow"), "as_found": ("slow",)}.items(), 1):
        keep(tmp_path, replace(STROKES, notes=notes), kind, number * 1e9, {})
    assert ValveReport("FV-1", records(tmp_path)).notes("commissioning") == ["slow", "factory: no reference"]


def test_a_report_of_what_was_found_alone_has_one_column(tmp_path: Path) -> None:
    keep(tmp_path, STROKES, "as_found", 1e9, {})
    report = ValveReport("FV-1", records(tmp_path))
    assert report.table("commissioning").headings == ("figure", "recommended ", "as found ")
    assert report.changed("commissioning") == []
    assert "as found and as left" in as_html(report)


def test_the_factorys_record_is_recommended_before_what_the_file_was_commissioned_to(tmp_path: Path) -> None:
    """A file that was written as the valve was found must not mark the mended one."""
    keep(tmp_path, STROKES, "factory", 1e9, {})
    keep(tmp_path, STROKES, "as_left", 2e9, {})
    report = ValveReport("FV-1", records(tmp_path), by_file={"opening_s": 3.0})
    (opens,) = (row for row in report.table("commissioning").rows if row[0] == "opens within")
    assert opens[1:] == ("1.100 ± 0.050 s", "1.100 ± 0.050 s", "1.100 ± 0.050 s")


@pytest.mark.parametrize(
    ("name", "now", "factory", "marked", "means"),
    [
        ("low_m", Figure(-9.8e-6, 2e-6), Figure(0.0, 1e-6), False, False),
        ("low_m", Figure(6e-4, 1e-4), Figure(0.0, 1e-5), True, True),
        ("low_m", Figure(6e-4, 5e-4), Figure(0.0, 1e-5), False, False),
        ("bench_low_pa", Figure(150.0, 10.0), Figure(0.0, 10.0), False, False),
        ("bench_low_pa", Figure(2000.0, 200.0), Figure(500.0, 200.0), True, True),
        ("friction_pa", Figure(6300.0, 50.0), Figure(6000.0, 10.0), False, True),
        ("friction_pa", Figure(6600.0, 50.0), Figure(6000.0, 400.0), False, False),
        ("friction_pa", Figure(6600.0, 50.0), Figure(6000.0, 10.0), True, True),
    ],
)
def test_a_place_is_held_against_what_its_kind_spans_and_every_figure_against_both_uncertainties(
    tmp_path: Path, name: str, now: Figure, factory: Figure, marked: bool, means: bool
) -> None:
    """A lower end of -0.01 mm in 40 mm is no other end than 0; nor is a figure that the factory's left open."""
    spans = Quantity("travel_m", "", "m", Figure(0.04, 1e-5)), Quantity("spring_pa_per_m", "", "Pa/m", Figure(2e6, 1e3))
    for kind, figure in (("factory", factory), ("as_found", now)):
        outcome = Outcome("signature", "FV-1", (Quantity(name, "it", "m", figure), *spans), (ValveTestVerdict.PASSED,))
        keep(tmp_path, outcome, kind, 1e9 if kind == "factory" else 2e9, {})
    report = ValveReport("FV-1", records(tmp_path))
    (row,) = (row for row in report.table("signature").rows if row[0] == "it")
    assert [cell.endswith("*") for cell in row[2:]] == [marked, False]
    assert bool(report.findings()) is means


@pytest.mark.parametrize(
    ("by_file", "found", "shown"),
    [
        (0.1016, Figure(0.10143, 5e-5), "101.6 mm"),
        (0.0412345, Figure(0.0401, 3e-4), "41.2 mm"),
        (0.0412345, Figure(0.0401, 0.02), "41 mm"),
        (0.0412345, Figure(None, None, "it did not move"), "41.2 mm"),
        (0.0, Figure(1e-5, 1e-6), "0 mm"),
    ],
)
def test_what_is_recommended_has_the_digits_that_what_was_found_can_be_held_against(
    tmp_path: Path, by_file: float, found: Figure, shown: str
) -> None:
    travel = Quantity("travel_m", "travel", "m", found)
    keep(tmp_path, Outcome("signature", "FV-1", (travel,), (ValveTestVerdict.PASSED,)), "as_found", 1e9, {})
    (row,) = ValveReport("FV-1", records(tmp_path), by_file={"travel_m": by_file}).table("signature").rows[1:]
    assert row[1] == shown


def test_what_the_file_says_is_recommended() -> None:
    assert recommended_by(daemon_file(law=LAW)) == {
        "travel_m": STROKE_M,
        "spring_pa_per_m": 2e6,
        "friction_pa": 6000.0,
        "bench_low_pa": 20e3,
        "bench_high_pa": pytest.approx(100e3),
    }
    assert recommended_by(daemon_file()) == {"travel_m": STROKE_M}


def test_what_a_test_asked_for_is_shown_and_judged_by_its_verdict_alone(tmp_path: Path) -> None:
    """A partial stroke of 10 % that turned at 11.2 % has passed; what somebody else recommends is marked."""
    reached = Quantity("reached_m", "travel reached", "m", Figure(4.48e-3, 1e-6), expected=4e-3)
    keep(tmp_path, Outcome("pst", "FV-1", (reached,), (ValveTestVerdict.PASSED,)), "as_found", 1e9, {})
    for asked, shown in ({}, "4.4800 ± 0.0010 mm"), ({"reached_m": 4e-3}, "4.4800 ± 0.0010 mm *"):
        (row,) = ValveReport("FV-1", records(tmp_path), recommended=asked).table("pst").rows[1:]
        assert row[1:] == ("4 mm", shown)
