"""How a valve is used: counted by second and day, bounded, kept; the trend of its end; what the command prints."""

import json
from dataclasses import replace
from itertools import pairwise
from math import nan
from pathlib import Path

import numpy as np
import pytest

from config.codes import EndTrend, Mode
from config.daemon_file import load_daemon
from config.errors import InputError
from config.loading import SHIPPED
from config.travel import Travel
from fieldbus.modbus.server import RegisterServer
from positioner.cli.main import main
from positioner.control.travel.cutoffs import HIGH, LOW
from positioner.daemon.health import Health, HealthKeeper, StoredHealth
from positioner.daemon.health.daily_figures import DAYS, Operation, Turned, end_trend
from positioner.daemon.health.health_file import kept_days
from positioner.daemon.health.travel_accumulator import SPANS, TravelAccumulator
from positioner.estimation.acceptance import Ratios
from tests.daemon.health.test_valve_health import LAW, STROKE_M, Panel, in_automatic

RANGE_PA = (0.0, 200e3)
NOT_TURNED = Turned((0,) * (len(SPANS) + 1), 0.0)


def test_each_second_is_counted_once_and_a_month_is_kept() -> None:
    _, sample, decision = in_automatic()
    operation = Operation(Travel(STROKE_M), RANGE_PA)
    decision = decision._replace(reference_m=0.5 * STROKE_M, command_pa=50e3)
    for day in range(DAYS + 9):
        for second, opening in enumerate((0.5, 0.52, 0.52, 0.56, nan, -0.01, 1.01)):
            seen = sample._replace(position_m=opening * STROKE_M)
            operation.look(seen, decision, NOT_TURNED, 86400.0 * day + second)
    assert len(operation.days) == DAYS
    today = operation.today
    assert (today.day, today.seconds, sum(today.opening), sum(today.deviation)) == (DAYS + 8, 6, 6, 6)
    assert (today.opening[0], today.opening[10], today.opening[11], today.opening[-1]) == (1, 3, 1, 1)
    assert today.away.value == pytest.approx((0.0 + 0.02 + 0.02 + 0.06 + 0.51 + 0.51) / 6)


@pytest.mark.parametrize("closes", [False, True])
def test_ends_are_those_of_the_valve_whatever_air_does(closes: bool) -> None:
    _, sample, decision = in_automatic()
    travel = Travel(STROKE_M, closes)
    operation = Operation(travel, RANGE_PA)
    for cut_off, opening in ((HIGH if closes else LOW, 0.002), (LOW if closes else HIGH, 0.998)):
        seen = sample._replace(position_m=travel.stem_m(opening))
        operation.look(seen, decision._replace(cut_off=cut_off), NOT_TURNED, 0.0)
    assert (operation.today.shut.value, operation.today.opened.value) == pytest.approx((0.002, 0.998))
    assert operation.today.saturated == 0


def test_a_command_at_its_limit_a_leak_a_poor_supply_and_a_stem_beside_its_course_are_told_apart() -> None:
    _, sample, decision = in_automatic()
    operation = Operation(Travel(STROKE_M), RANGE_PA)
    ratios = Ratios(-1e6, -2e4)
    applied = replace(decision.applied, ratios=ratios)
    for command_pa, short_pa in ((60e3, 4e3), (60e3, 4e3), (190e3, 30e3), (190e3, 30e3)):
        seen = sample._replace(position_m=0.06, pressure_pa=command_pa - short_pa)
        now = decision._replace(command_pa=command_pa, applied=applied)
        operation.look(seen, now, NOT_TURNED, 0.0)
    today = operation.today
    assert (today.short.value, today.short_high.value) == pytest.approx((0.02, 0.15))
    assert (today.course.count, today.course.total) == pytest.approx((2, (0.19 - 0.06 - 0.02) / STROKE_M))
    operation.look(sample, decision._replace(command_pa=199.5e3), NOT_TURNED, 0.0)
    assert operation.today.saturated == 1
    turned = Turned((1, *NOT_TURNED.spans[1:]), 2 * 101_325.0)
    operation.look(sample, decision, turned, 0.0)
    assert (operation.today.span[0], operation.today.exhausted) == pytest.approx((1, 2.0))


def test_a_poor_supply_is_seen_by_commands_that_the_valve_needs_however_far_the_limits_are() -> None:
    """The shipped file allows 420 kPa, of which its valve never needs more than 105 before it is pressed shut."""
    file = load_daemon(SHIPPED / "profiles" / "daemon.toml")
    _, sample, decision = in_automatic()
    limits_pa = (file.pressure.minimum_pa, file.pressure.maximum_pa)
    for ratios, short, high in ((Ratios(-814.5e3, -22.07e3), 1, 1), (None, 2, 0)):
        operation = Operation(Travel(file.valve.stroke_m), limits_pa)
        now = decision._replace(applied=replace(decision.applied, ratios=ratios))
        for command_pa in (70e3, 70e3, 95e3, 95e3):
            seen = sample._replace(position_m=0.05, pressure_pa=command_pa - 5e3)
            operation.look(seen, now._replace(command_pa=command_pa), NOT_TURNED, 0.0)
        assert (operation.today.short.count, operation.today.short_high.count) == (short, high)


def test_spans_go_from_turn_to_turn() -> None:
    accumulator = TravelAccumulator(1.0, 0.005)
    turns = (0.0, 0.3, 0.22, 0.9, 0.8)
    at = [each for begin, end in pairwise(turns) for each in np.linspace(begin, end, 100).tolist()]
    for position in [0.0] * 3000 + at:
        accumulator.enter(position)
    assert accumulator.reversals == 3
    assert accumulator.spans == [0, 0, 0, 1, 0, 1, 1, 0], "8 %, 30 % and 68 %"


@pytest.mark.parametrize(
    ("means", "kind"),
    [
        ([0.001] * 4, EndTrend.NOT_KNOWN),
        ([0.001, nan, 0.001, 0.002, 0.001, 0.0015], EndTrend.STEADY),
        ([0.001 * day for day in range(10)], EndTrend.RISING),
        ([-0.001 * day for day in range(10)], EndTrend.FALLING),
        ([0.001, 0.0012, 0.0009, 0.001, 0.001, 0.02], EndTrend.JUMPED),
        ([0.0, 0.01, 0.002, 0.009, 0.001, 0.008, 0.0, 0.007], EndTrend.SCATTERED),
    ],
)
def test_the_trend_of_an_end_has_a_kind(means: list[float], kind: EndTrend) -> None:
    assert end_trend(means) is kind


def test_days_are_kept_served_and_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    panel = Panel(LAW)
    panel.set("mode", Mode.AUTOMATIC)
    config = tmp_path / "site.toml"
    stored = StoredHealth.in_folder(tmp_path / "health", "FV-1", {})
    keeper = HealthKeeper(panel.health, lambda: panel.cycle.snapshot, "FV-1", stored, alarms=panel.alarms)
    for reference in (0.6, 0.7, 0.6):
        panel.set("reference", reference)
        panel.run(1.0)
    keeper.check()
    keeper.stop()
    assert kept_days(stored.path, "FV-1") == panel.health.operation.days
    again = Health.idle(STROKE_M)
    HealthKeeper(again, lambda: panel.cycle.snapshot, "FV-1", StoredHealth.in_folder(tmp_path / "health", "FV-1", {}))
    assert again.operation.days == panel.health.operation.days
    assert sum(each.exhausted for each in panel.health.operation.days) > 0.0
    server = RegisterServer(panel.registers, "127.0.0.1", 0, 1)
    server.start()
    tables = ('valve]\nname = "FV-1"', f"supervisory]\nport = {server.port}", 'health]\nfolder = "health"')
    text = "".join(f"[{each}\n" for each in tables)
    config.write_text(text.replace('"FV-1"', f'"FV-1"\nstroke_m = {STROKE_M}'))
    try:
        assert main(["health", "--config", str(config), "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["days"][-1]["seconds"] == panel.health.operation.today.seconds
        assert main(["health", "--config", str(config)]) == 0
        assert "cycle span" in capsys.readouterr().out
        stored.path.write_text("{")
        assert main(["health", "--config", str(config)]) == 2
        assert "FV-1.health.json: is not JSON" in capsys.readouterr().err
    finally:
        server.stop()
    with pytest.raises(InputError):
        kept_days(stored.path, "FV-1")
    assert stored.path.read_text() == "{", "a reader sets nothing aside"
