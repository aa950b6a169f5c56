"""A person's way through the workbench page, in a real browser: from a dropped file to an error at the floor."""

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from sim.own_effect import EXAMPLE
from tests.pages.browser import LONGEST_MS, needs_chromium, opened, served
from workbench.blind.hiding import hide
from workbench.blind.sealing import seal

pytestmark = [pytest.mark.patient, needs_chromium]

DRAGS = 4
SEED = 7
"""Hides a preload."""
ROWS_APART = """table => [...table.querySelectorAll("tbody tr")].every(row => [...row.children].every(
    cell => cell.getBoundingClientRect().bottom <= row.getBoundingClientRect().bottom + 1))"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("case")
    seal(folder, hide(SEED, duration_s=10.0))
    return folder


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served("workbench") as where:
        yield where


def drop(page: Page, where: str, path: Path) -> None:
    page.get_by_test_id(where).locator("input[type=file]").set_input_files(path)


def error_mm(page: Page) -> float:
    return float(page.get_by_test_id("error").inner_text().removesuffix(" mm"))


def shown(page: Page) -> None:
    expect(page.locator(".scatterlayer .trace").first).to_be_visible()


def select_forces(page: Page) -> None:
    """Drag over a plot of forces; once more where it was drawn anew under the hand, with what is now seen of time."""
    figure = page.get_by_role("img", name="friction over velocity")
    expect(figure.locator(".scatterlayer .trace").first).to_be_attached()
    marked = page.locator(".legendtext", has_text="chosen")
    for _ in range(DRAGS):
        figure.locator(".nsewdrag").hover()  # once it stands still: what is drawn above it late moves it
        box = figure.locator(".nsewdrag").bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 0.1 * box["width"], box["y"] + 0.1 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.5 * box["height"], steps=3)
        page.mouse.up()
        with suppress(AssertionError):
            expect(marked).to_be_visible(timeout=LONGEST_MS / DRAGS)
            return
    pytest.fail("nothing is marked over time")


def goes_to_where_it_fails_and_in_other_units(page: Page, given_mm: float) -> None:
    # A sentence goes to where it shows; in other units everything is said anew.
    page.get_by_test_id("sentences").get_by_role("button", name="after a reversal").click()
    expect(page.get_by_test_id("where")).to_have_text(re.compile(r"^1 of \d+: after a reversal"))
    expect(page.locator(".shapelayer path").first).to_be_attached()
    # What is selected in a plot of forces is marked over time.
    select_forces(page)
    page.get_by_test_id("unit-position").click()
    page.get_by_role("option", name="in", exact=True).click()
    expect(page.get_by_test_id("error")).to_have_text(f"{given_mm / 25.4:.4g} in")
    page.get_by_test_id("unit-position").click()
    page.get_by_role("option", name="mm", exact=True).click()
    expect(page.get_by_test_id("error")).to_have_text(f"{given_mm:.4g} mm")


@pytest.mark.long
@pytest.mark.timeout(600)
def test_from_a_dropped_file_to_the_floor(address: str, case: Path, tmp_path: Path) -> None:
    with opened(address) as page:
        drop(page, "drop", case / "fit.csv")
        expect(page.get_by_test_id("opened")).to_contain_text("1001 samples over 10 s")
        drop(page, "drop-valve", case / "valve.toml")
        expect(page.get_by_test_id("verdict")).to_have_attribute("data-kind", "bad")
        shown(page)
        given_mm = error_mm(page)

        goes_to_where_it_fails_and_in_other_units(page, given_mm)

        # Dragging changes the error, and undo takes it back.
        slider = page.get_by_test_id("slider-spring_n_per_m")
        slider.hover()  # once it stands still: plots that are drawn anew above it move it
        box, said = slider.bounding_box(), page.get_by_test_id("sentences").inner_text()
        assert box is not None
        middle_y = box["y"] + box["height"] / 2
        page.mouse.move(box["x"] + box["width"] / 2, middle_y)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.6 * box["width"], middle_y, steps=3)
        expect(page.get_by_test_id("error")).not_to_have_text(f"{given_mm:.4g} mm")
        page.mouse.up()
        expect(page.get_by_test_id("sentences")).not_to_have_text(said, use_inner_text=True)
        after = slider.bounding_box()
        assert after is not None
        assert after["y"] == box["y"], "it stays under the hand, whatever is said above it"
        page.get_by_test_id("undo").click()
        expect(page.get_by_test_id("error")).to_have_text(f"{given_mm:.4g} mm")

        # A diagnosis of two effects finds what is hidden; added, the error is at the floor.
        diagnosed(page, "preload", "backlash")
        expect(page.get_by_test_id("found")).to_have_attribute("data-kind", "good")
        expect(page.get_by_test_id("found-sentence")).to_contain_text("preload")
        expect(page.get_by_test_id("candidates")).to_contain_text("more than 10 needed")
        page.set_viewport_size({"width": 400, "height": 900})
        assert page.get_by_test_id("candidates").evaluate(ROWS_APART), "nothing lies over another row"
        page.set_viewport_size({"width": 1400, "height": 900})
        expect(page.get_by_role("button", name="add backlash", exact=True)).to_be_enabled()
        page.get_by_test_id("add").click()
        expect(page.get_by_test_id("journal-step")).to_contain_text("falls from")
        expect(page.get_by_test_id("verdict")).to_have_attribute("data-kind", "good")
        with page.expect_download() as saved:
            page.get_by_test_id("save").click()
        assert 'name = "preload"' in Path(saved.value.path()).read_text()

        # The page loaded again has it all, and the way back is there.
        page.reload()
        expect(page.get_by_test_id("journal-step")).to_contain_text("preload")
        shown(page)
        assert error_mm(page) < 0.01 * given_mm
        page.get_by_test_id("back").click()
        expect(page.get_by_test_id("error")).to_have_text(f"{given_mm:.4g} mm")
        expect(page.get_by_test_id("comparison")).to_be_focused()  # which would close a list that is open already

        # Of several that do as well any may be added.
        diagnosed(page, "preload", "sensor_offset")
        expect(page.get_by_test_id("found")).to_have_attribute("data-kind", "open")
        page.get_by_test_id("add").first.click()
        expect(page.get_by_test_id("journal-step")).to_contain_text("falls from")


def diagnosed(page: Page, *effects: str) -> None:
    """Begin a diagnosis that tries these alone."""
    page.get_by_test_id("effects").click()
    for name in effects:
        page.get_by_role("option", name=name, exact=True).click()
    page.keyboard.press("Escape")
    page.get_by_test_id("diagnose").click()


def export_of(case: Path, path: Path) -> None:
    """Write a recording as another program would: other names, positions in mm that nobody says are."""
    rows = [line.split(",") for line in (case / "fit.csv").read_text().splitlines() if not line.startswith("#")]
    at = [rows[0].index(name) for name in ("time_s", "position_m", "command_pa")]
    told = [[f"{float(row[at[0]]):.3f}", f"{1e3 * float(row[at[1]]):.4f}", row[at[2]]] for row in rows[1:]]
    path.write_text("\n".join(";".join(each) for each in [["Zeit", "Hub", "Stellsignal [Pa]"], *told]))


@pytest.mark.long
def test_another_tab_sees_none_of_it_and_a_bad_file_is_told(address: str, case: Path, tmp_path: Path) -> None:
    rubbish = tmp_path / "rubbish.csv"
    rubbish.write_bytes(b"\x00\x01 no recording")
    with opened(address, width_px=400, dark=True) as page:
        expect(page.get_by_test_id("drop")).to_be_visible()
        expect(page.get_by_test_id("opened")).to_have_count(0)
        drop(page, "drop", rubbish)
        expect(page.get_by_role("alert")).to_have_text(re.compile(r"^(warning)?rubbish\.csv: "))
        assert page.evaluate("document.documentElement.scrollWidth") <= 400
        # What the browser itself turns away is told why.
        page.get_by_role("button", name="close").click()
        expect(page.get_by_role("alert")).to_have_count(0)
        drop(page, "drop-valve", rubbish)
        expect(page.get_by_role("alert")).to_contain_text("rubbish.csv: a file whose name ends in .toml is wanted here")

        # Of another program's file the columns are proposed, and drawn as they would be read before they are taken.
        export_of(case, tmp_path / "export.csv")
        drop(page, "drop", tmp_path / "export.csv")
        expect(page.get_by_test_id("preview-said")).to_contain_text("stroke")
        page.get_by_test_id("unit-position_m").click()
        page.get_by_role("option", name="mm", exact=True).click()
        expect(page.get_by_test_id("preview")).to_contain_text("Read so: 1001 samples over 10 s")
        expect(page.get_by_role("img", name="as it would be read").locator(".scatterlayer path").first).to_be_visible()
        page.get_by_test_id("confirm").click()
        expect(page.get_by_test_id("opened")).to_contain_text("export.csv: 1001 samples over 10 s")
        assert page.evaluate("document.documentElement.scrollWidth") <= 400

        # On a narrow page verdict and controls come before the plots.
        drop(page, "drop-valve", case / "valve.toml")
        shown(page)
        parts = [page.get_by_test_id(each) for each in ("verdict", "slider-spring_n_per_m", "diagnose")]
        parts.append(page.get_by_role("img", name="position, error and pressure over time"))
        tops = [each.evaluate("each => each.getBoundingClientRect().top") for each in parts]
        assert tops == sorted(tops)


@pytest.mark.long
def test_another_recording_is_held_out_and_an_effect_of_ones_own_is_written(address: str, case: Path) -> None:
    with opened(address) as page:
        drop(page, "drop", case / "fit.csv")
        expect(page.get_by_test_id("opened")).to_be_visible()
        drop(page, "drop-valve", case / "valve.toml")
        shown(page)
        page.get_by_test_id("held-out").click()
        drop(page, "drop-held-out", case / "test.csv")
        expect(page.get_by_test_id("held-out")).to_contain_text("held out: test.csv")

        # What is wrong with an effect is said with its line; mended, it compiles and may be tried.
        page.get_by_test_id("own-effect").click()
        text = EXAMPLE.read_text(encoding="utf-8")
        page.get_by_test_id("effect-name").fill("tight")
        page.locator(".cm-content").fill(text.replace("depth = (x", "depth = x)"))
        page.get_by_test_id("effect-save").click()
        expect(page.get_by_test_id("effect-said")).to_contain_text("line 30: unmatched ')'")
        page.locator(".cm-content").fill(text)
        page.get_by_test_id("effect-save").click()
        expect(page.get_by_test_id("effect-said")).to_have_text("tight compiles, and joins the race")

        with page.expect_download() as saved:
            page.get_by_test_id("notebook").click()
        cells = json.loads(Path(saved.value.path()).read_text())["cells"]
        assert "test.csv" in "".join(line for cell in cells for line in cell["source"])
