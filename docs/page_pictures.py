"""The workbench's page in both themes, drawn anew: `python -m docs.page_pictures FOLDER`. Needs Debian's Chromium."""

import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, expect, sync_playwright

from workbench.blind.hiding import hide
from workbench.blind.sealing import seal

SEED, DURATION_S = 7, 30.0
EFFECTS = ("preload", "backlash", "ip_lag", "sensor_gain")
WIDE_PX, HIGH_PX = 1400, 900
LONGEST_MS = 300_000.0


def main(folder: Path) -> None:
    """Draw the page after an effect was added."""
    expect.set_options(timeout=LONGEST_MS)
    with tempfile.TemporaryDirectory() as case, sync_playwright() as playwright:
        seal(Path(case, "hidden"), hide(SEED, duration_s=DURATION_S))
        words = ["hidden/fit.csv", "--valve", "hidden/valve.toml"]
        command = [sys.executable, "-m", "positioner.cli", "workbench", *words, "--no-open", "--listen-port", "0"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=case) as server:
            assert server.stdout is not None
            address = server.stdout.readline().partition(": ")[2].strip()
            try:
                browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
                page = browser.new_page(viewport={"width": WIDE_PX, "height": HIGH_PX})
                page.goto(address)
                _walk(page, folder)
                browser.close()
            finally:
                server.terminate()


def _walk(page: Page, folder: Path) -> None:
    expect(page.locator(".scatterlayer .trace").first).to_be_visible()
    page.get_by_test_id("effects").click()
    for name in EFFECTS:
        page.get_by_role("option", name=name, exact=True).click()
    page.keyboard.press("Escape")
    page.get_by_test_id("diagnose").click()
    expect(page.get_by_test_id("found")).to_be_visible()
    page.get_by_test_id("add").click()
    expect(page.get_by_test_id("journal-step")).to_be_visible()
    page.get_by_role("img", name="how the error fell").locator(".trace").first.wait_for()
    page.evaluate("scrollTo(0, 0)")
    page.screenshot(path=folder / "workbench_page.png", full_page=True)
    page.emulate_media(color_scheme="dark")
    page.reload()
    page.get_by_role("img", name="how the error fell").locator(".trace").first.wait_for()
    page.screenshot(path=folder / "workbench_page_dark.png", full_page=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
