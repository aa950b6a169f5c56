"""A technician's evening, in virtual time: an unknown valve with two defects is commissioned, tested, mended, reported.

The packing has been tightened until it holds two and a half times as much, and the spring is set looser: the bench set
begins at 0.15 in place of 0.2 bar. The factory's signature is of the valve before.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from html.parser import HTMLParser
from pathlib import Path

import pytest

from config.daemon_file import DaemonFile, load_daemon
from config.slave_file import Initial
from config.valve_file import ValveFile
from positioner.cli.main import main
from positioner.history.kept_tests import folder_of
from positioner.tests_on_the_valve.kept_records import keep
from positioner.tests_on_the_valve.signature import Nameplate, signature
from tests.tests_on_the_valve.test_signature import recorded
from tests.tests_on_the_valve.virtual_valve import (
    AREA_M2,
    MAXIMUM_PA,
    ORDINARY,
    PARAMETERS,
    PRELOAD_N,
    STROKE_M,
    VirtualValve,
    told,
)

SITE = f"""[valve]
name = "FV-1"
[cycle]
pace = "device"
[pressure]
maximum_pa = {MAXIMUM_PA}
[safety]
stale_after_s = 0.5
[experiment]
travel_window = [0, 1]
limit_s = 90
"""
AREA = ["--area-m2", str(AREA_M2)]


def set_looser(valve: ValveFile, share: float) -> ValveFile:
    """Return the valve with a share of its preload."""
    effects = tuple(
        each.model_copy(update={"force_n": share * PRELOAD_N}) if each.name == "preload" else each
        for each in valve.effect
    )
    return valve.model_copy(update={"effect": effects})


DEFECT = set_looser(told(coulomb_n=2.5 * PARAMETERS.coulomb_n, static_n=2.8 * PARAMETERS.coulomb_n), 0.75)


class OnTheBus(VirtualValve):
    """In place of a valve on a bus, and of one that a daemon runs."""

    def __init__(self, file: DaemonFile, valve: ValveFile) -> None:
        super().__init__(valve, file, noise=2e-3, initial=Initial(position_m=0.5 * STROKE_M, pressure_pa=60e3))

    def stem_m(self) -> float:
        return self.cycle.snapshot.sample.position_m


@contextmanager
def on_the_bus(valve: ValveFile) -> Iterator[None]:
    @contextmanager
    def own_valve(file: DaemonFile, _: Path) -> Iterator[OnTheBus]:
        yield OnTheBus(file, valve)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("positioner.cli.commission.own_valve", own_valve)
        patched.setattr("positioner.cli.parts.experiment_player.require_ready", lambda *_: None)
        patched.setattr("positioner.cli.parts.experiment_player.RunningValve", lambda file, _: OnTheBus(file, valve))
        yield


class Findings(HTMLParser):
    """What a report says has changed, a line each."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, _: list[tuple[str, str | None]]) -> None:
        if tag == "li":
            self.lines.append("")

    def handle_data(self, data: str) -> None:
        if self.lines:
            self.lines[-1] += data

    def named(self, when: str, words: str) -> bool:
        """Return whether a line about the valve as found or as left has these words."""
        return any(line.startswith(f"{when}: ") and words in line for line in self.lines)


def test_the_defects_are_named_in_the_report_and_the_mended_valve_is_as_it_was(tmp_path: Path) -> None:
    site, found, left = (tmp_path / each for each in ("site.toml", "found.html", "left.html"))
    site.write_text(SITE)
    plate = Nameplate("FV-1", STROKE_M, AREA_M2)
    keep(folder_of(tmp_path, "FV-1"), signature(recorded(ORDINARY, noise=2e-3), plate), "factory", 1e9, {})
    with on_the_bus(DEFECT):
        assert main(["commission", str(site), "--yes", "--keep", "as_found"]) == 0
        assert load_daemon(site).valve.stroke_m == pytest.approx(STROKE_M, rel=5e-3)
        assert main(["signature", str(site), "--keep", "as_found", "--against", "factory", *AREA]) == 1, "has changed"
        assert main(["pst", str(site), "--keep", "as_found"]) == 0
    assert main(["report", str(site), "-o", str(found)]) == 0
    with on_the_bus(ORDINARY):
        assert main(["signature", str(site), "--keep", "as_left", "--against", "factory", *AREA]) == 0, "as it was"
        assert main(["pst", str(site), "--keep", "as_left"]) == 0
    assert main(["report", str(site), "-o", str(left)]) == 0

    for report in map(Findings, (found, left)):
        assert report.named("as found", "packing tight or dry")
        assert report.named("as found", "the spring is set looser")
        others = ("spring is broken", "another actuator", "seat worn", "lies on the seat", "air leaks")
        assert not any(report.named("as found", word) for word in others)
        assert not report.named("as left", ""), "the mended valve is as it was"
