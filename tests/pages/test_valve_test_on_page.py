"""A test begun on the operator's page by an engineer who consents; its outcome, an alarm, the report, in a browser."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from config.codes import Ne107Cause
from config.role_passwords import set_password
from positioner.cli.parts.children import port_in
from tests.children import child
from tests.pages.browser import needs_chromium, opened, served
from tests.pages.test_operator_journey import PASSWORDS, sign_in
from tests.tests_on_the_valve.test_running_daemon import SLAVE, Site, running

pytestmark = [pytest.mark.long, pytest.mark.patient, needs_chromium]


def test_an_engineer_consents_begins_a_test_and_takes_the_report(tmp_path: Path) -> None:
    roles = tmp_path / "roles.json"
    set_password(roles, "engineer", PASSWORDS["engineer"])
    (tmp_path / "slave.toml").write_text(SLAVE)
    with (
        child("sim", tmp_path / "slave.toml", "--listen-port", "0") as (_, listening),
        running(tmp_path, port_in(listening), "[alarms.high]\nthreshold = 0.3\n") as site,
        served("page", "--config", str(site.config), "--roles", str(roles)) as address,
        opened(address) as page,
    ):
        expect(page.get_by_test_id("tests-why")).to_have_text("a test on the valve needs the role engineer")
        expect(page.get_by_test_id("begin-test")).to_be_disabled()
        page.get_by_test_id("door").click()
        sign_in(page, "engineer", PASSWORDS["engineer"])
        expect(page.get_by_test_id("tests-why")).to_contain_text("the mode is not automatic")
        with site.dcs() as dcs:
            dcs.set("mode", 2)
        shelved(page)
        played(page, site)


def shelved(page: Page) -> None:
    """The valve is farther open than the alarm permits: seen, and put aside."""
    alarm = page.get_by_test_id(f"alarm-{Ne107Cause.HIGH.name.lower()}")
    expect(alarm).to_contain_text("active, unacknowledged")
    alarm.get_by_role("button", name="Acknowledge").click()
    expect(alarm).to_contain_text("active, acknowledged")
    alarm.get_by_role("button", name="Shelve 30 min").click()
    expect(alarm).to_contain_text("shelved, the first till")


def played(page: Page, site: Site) -> None:
    """Consent is given with the answer, and gone with the test."""
    page.get_by_test_id("kept-as").click()
    page.get_by_role("option", name="as found").click()
    page.get_by_test_id("begin-test").click()
    page.get_by_test_id("answer-begin").click()
    expect(page.get_by_test_id("break-off-test")).to_be_visible()
    expect(page.get_by_test_id("said")).to_contain_text("partial stroke test of FV-1: passed")
    expect(page.get_by_test_id("test-said")).to_contain_text("kept (as found)")
    with site.dcs() as dcs:
        assert dcs.get("experiment_consent") == 0
    with page.expect_download() as taken:
        page.get_by_test_id("report").click()
    assert "partial stroke test" in taken.value.path().read_text().lower()
