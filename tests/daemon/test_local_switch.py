"""The local switch, on the registers of a virtual valve."""

from pathlib import Path

import pytest
from pymodbus.constants import ExcCodes

from config.codes import Mode
from config.travel import Travel
from positioner.daemon.local_switch import locks_out
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from tests.daemon.history.test_history_keeper import Site
from tests.daemon.panel import refused


def test_the_switch_locks_out_all_writes_but_the_heartbeat_and_is_an_event(tmp_path: Path) -> None:
    switch = tmp_path / "local"
    site, locked = Site(tmp_path), locks_out(switch)
    site.panel.registers = SupervisoryRegisters(site.panel.cycle, Travel(0.1016), 0.0, 200e3, locked=locked)
    site.valve.locked = locked
    site.panel.set("mode", Mode.AUTOMATIC)
    switch.write_text("1\n")
    site.turn()
    for name, value in (("mode", 0), ("reference", 0.5), ("eta_1", 0), ("experiment_start", 2)):
        assert refused(site.panel, name, value) == ExcCodes.DEVICE_BUSY
    site.panel.set("heartbeat", 7)
    assert (site.panel.get("locked_out"), site.panel.get("heartbeat"), site.panel.get("mode")) == (1, 7, 2)
    switch.write_text("0\n")
    site.panel.set("reference", 0.5)
    site.turn()
    assert [each.name for each in site.events()] == ["STARTED", "MODE", "LOCKED_OUT", "LET_IN"]
    said = "writes are locked out by the local switch"
    assert {row.text for row in site.writes() if row.what == "refused"} == {said}
    site.keeper.stop("the end")


@pytest.mark.parametrize(("content", "on"), [("", True), ("1", True), ("0", False), ("0\n", False), ("local", True)])
def test_what_is_in_the_file_says_whether_it_is_on(tmp_path: Path, content: str, on: bool) -> None:
    switch = tmp_path / "local"
    assert not locks_out(switch)()
    switch.write_text(content)
    assert locks_out(switch)() is on


def test_a_switch_that_cannot_be_read_locks_out(tmp_path: Path) -> None:
    assert locks_out(tmp_path)(), "a folder"
    assert not locks_out(None)()
