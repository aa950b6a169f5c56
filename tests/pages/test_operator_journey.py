"""The operator's page in a real browser, against a running daemon and a simulated slave, each a process."""

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from config.role_passwords import set_password
from tests.pages.browser import needs_chromium, opened, served
from tests.pages.valve_site import valve_site

pytestmark = [pytest.mark.patient, needs_chromium]

MOST_AHEAD = 20
"""Messages to a browser that was busy for 2 s: those of two or three readings, and what has happened; not of twenty."""
PASSWORDS = {"operator": "valves-and-more", "engineer": "friction-matters"}


def sign_in(page: Page, role: str, password: str) -> None:
    page.get_by_test_id("role").click()
    page.get_by_role("option", name=role).click()
    page.get_by_test_id("password").fill(password)
    page.get_by_test_id("enter").click()


@pytest.mark.long
def test_an_operator_watches_signs_in_moves_the_valve_and_is_told_what_dies(tmp_path: Path) -> None:
    roles = tmp_path / "roles.json"
    for role, password in PASSWORDS.items():
        set_password(roles, role, password)
    with valve_site(tmp_path) as site:
        words = ("page", "--config", str(site.config), "--roles", str(roles))
        with served(*words) as address, opened(address) as page:
            watched(page)
            unheard(page, site.config)
            busy(page)
            signed_in_as_operator(page)
            moved_by_an_engineer(page)
            site.slave.kill()
            expect(page.get_by_test_id("fault")).to_have_text("no reply")
            expect(page.get_by_test_id("figure-position")).to_have_text("– %")
            expect(page.get_by_test_id("ne107")).to_have_text("F failure")
            site.daemon.kill()
            expect(page.get_by_test_id("stale")).to_contain_text("Not live: no connection")
            expect(page.get_by_test_id("live-values")).to_have_class(re.compile(r"\bstale\b"))
            expect(page.get_by_test_id("set-reference")).to_be_disabled()
            wrong_five_times(page)


def wrong_five_times(page: Page) -> None:
    """After five wrong passwords in a row none is looked at for a while."""
    page.get_by_test_id("door").click()
    page.get_by_test_id("door").click()
    for _ in range(5):
        page.get_by_test_id("password").fill("guessed")
        page.get_by_test_id("enter").click()
        expect(page.get_by_test_id("password")).to_have_value("")
    expect(page.get_by_test_id("sign-in-said")).to_have_text("wrong password")
    page.get_by_test_id("password").fill(PASSWORDS["engineer"])
    page.get_by_test_id("enter").click()
    expect(page.get_by_test_id("sign-in-said")).to_have_text(
        re.compile(r"too many wrong passwords: try again in \d+ s")
    )


def watched(page: Page) -> None:
    """See what an observer sees: live values, in words, and nothing to press."""
    expect(page.get_by_test_id("figure-position")).to_have_text(re.compile(r"29\.\d\d %"))
    expect(page.get_by_test_id("mode")).to_have_text("hold, S0 start")
    expect(page.get_by_test_id("causes")).to_have_text("not automatic")
    expect(page.get_by_test_id("estimates")).to_contain_text("identification has not been started")
    expect(page.get_by_test_id("trend").locator("canvas")).to_be_visible()
    expect(page.get_by_test_id("stale")).to_be_hidden()
    for name in ("set-reference", "mode-automatic", "acknowledge"):
        expect(page.get_by_test_id(name)).to_be_disabled()


def unheard(page: Page, config: Path) -> None:
    """A page whose server sends nothing greys by itself, and says so; it takes that back."""
    found = subprocess.run(["pgrep", "-f", f"page --config {config}"], capture_output=True, text=True, check=True)
    server = int(found.stdout)
    expect(page.get_by_test_id("unheard")).to_be_hidden()
    os.kill(server, signal.SIGSTOP)
    try:
        expect(page.get_by_test_id("unheard")).to_be_visible()
    finally:
        os.kill(server, signal.SIGCONT)
    expect(page.get_by_test_id("unheard")).to_be_hidden()


def busy(page: Page) -> None:
    """A browser that is busy for a while is not sent what it cannot show: after it, it shows what is now."""
    heard: list[str | bytes] = []

    def hear(message: str | bytes) -> None:
        heard.append(message)

    page.on("websocket", lambda socket: socket.on("framereceived", hear))
    page.reload()
    expect(page.get_by_test_id("unheard")).to_be_hidden()
    expect(page.get_by_test_id("mode")).to_have_text("hold, S0 start")
    before = len(heard)
    page.evaluate("() => { const begin = performance.now(); while (performance.now() - begin < 2000); }")
    page.evaluate("() => new Promise(done => setTimeout(done, 50))")
    assert before > 0
    assert len(heard) - before <= MOST_AHEAD
    expect(page.get_by_test_id("unheard")).to_be_hidden()


def signed_in_as_operator(page: Page) -> None:
    """A wrong password is told; the right one gives an operator's rights and no more."""
    page.get_by_test_id("door").click()
    sign_in(page, "operator", PASSWORDS["engineer"])
    expect(page.get_by_test_id("sign-in-said")).to_have_text("wrong password")
    sign_in(page, "operator", PASSWORDS["operator"])
    expect(page.get_by_test_id("set-reference")).to_be_enabled()
    expect(page.get_by_test_id("mode-automatic")).to_be_disabled()
    expect(page.get_by_test_id("rights")).to_contain_text(
        "to write mode, pressure, identification, sign in as engineer"
    )
    page.get_by_test_id("door").click()
    expect(page.get_by_test_id("set-reference")).to_be_disabled()


def moved_by_an_engineer(page: Page) -> None:
    """The mode and the reference are set, confirmed by what is read back, and the stem follows."""
    page.get_by_test_id("door").click()
    sign_in(page, "engineer", PASSWORDS["engineer"])
    # What automatic is going to do is said, and asked, before anything is written.
    page.get_by_test_id("reference-input").fill("70")
    page.get_by_test_id("set-reference").click()
    expect(page.get_by_test_id("said")).to_contain_text("✓ reference is 70 %, as read back")
    expect(page.get_by_test_id("waiting")).to_have_text("waits: 70.00 %, followed in automatic")
    page.get_by_test_id("mode-automatic").click()
    expect(page.get_by_test_id("question")).to_contain_text("The reference is 70.00 %: written by 127.0.0.1")
    expect(page.get_by_test_id("question")).to_contain_text("in one step of the pressure")
    page.get_by_test_id("answer-cancel").click()
    expect(page.get_by_test_id("mode")).to_have_text("hold, S0 start")
    page.get_by_test_id("mode-automatic").click()
    page.get_by_test_id("answer-stay").click()
    expect(page.get_by_test_id("said")).to_contain_text("✓ mode is automatic, as read back")
    expect(page.get_by_test_id("figure-position")).to_have_text(re.compile(r"(29|30)\.\d\d %"))
    expect(page.get_by_test_id("waiting")).to_be_empty()
    # What a browser takes for no part of a number is not dropped: of 5,5 there would be 55 left.
    page.get_by_test_id("reference-input").clear()
    page.get_by_test_id("reference-input").press_sequentially("40,5")
    page.get_by_test_id("set-reference").click()
    expect(page.get_by_test_id("said")).to_contain_text("✓ reference is 40.5 %, as read back")
    page.get_by_test_id("reference-input").fill("5x0")
    page.get_by_test_id("set-reference").click()
    expect(page.get_by_test_id("said")).to_contain_text("must be a number such as 12.5")
    page.get_by_test_id("reference-input").fill("50")
    page.get_by_test_id("set-reference").click()
    expect(page.get_by_test_id("said")).to_contain_text("✓ reference is 50 %, as read back")
    expect(page.get_by_test_id("figure-position")).to_have_text(re.compile(r"(49|50)\.\d\d %"))
    expect(page.get_by_test_id("mode")).to_have_text("automatic, S1 up")
    expect(page.get_by_test_id("history")).to_contain_text("from the daemon's history")
    expect(page.get_by_test_id("history")).to_contain_text("the mode has changed: automatic")
    expect(page.get_by_test_id("history")).to_contain_text("the daemon started")
    expect(page.get_by_test_id("history")).to_contain_text("connected")
    expect(page.get_by_test_id("history")).not_to_contain_text("mode: hold -> automatic")  # told already
    page.get_by_test_id("work-out").click()
    expect(page.get_by_test_id("moves")).to_contain_text("reference_m")
    # Manual has its pressure, and asks before it commands it.
    page.get_by_test_id("pressure-input").fill("0,3")
    page.get_by_test_id("set-pressure").click()
    expect(page.get_by_test_id("question")).to_contain_text("to 0.300 bar at once")
    page.get_by_test_id("answer-manual").click()
    expect(page.get_by_test_id("figure-command")).to_have_text("0.300 bar")
    expect(page.get_by_test_id("mode")).to_have_text(re.compile("^manual"))
