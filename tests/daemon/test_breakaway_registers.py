"""F_s / A in the registers: behind the others, which have not moved, and as the identification says it."""

import math

import pytest

from config.codes import Refusal
from config.registers import BY_NAME
from tests.daemon.panel import Panel

FORCE_AT_BREAKAWAY_PA = 1708.09 / 0.0645


def test_they_stand_where_nothing_stood() -> None:
    names = ("breakaway_e", "breakaway_std", "breakaway_valid", "breakaway_reason")
    assert [BY_NAME[name].address for name in names] == [252, 254, 256, 257]
    assert {BY_NAME[name].unit for name in names[:2]} == {"Pa"}
    assert (BY_NAME["refusal"].end, BY_NAME["cycles"].address) == (251, 300)


def test_before_anything_broke_away_there_is_none() -> None:
    panel = Panel()
    panel.run(10)
    assert math.isnan(panel.get("breakaway_e"))
    assert panel.get("breakaway_valid") == 0
    assert panel.get("breakaway_reason") != Refusal.VALID


def test_excited_by_a_jump_the_interval_is_wide_and_said_to_be() -> None:
    panel = Panel()
    panel.set("mode", 2)
    panel.set("reference", 0.1)
    panel.run(300)
    for name, value in {"alpha": 60e3, "beta": 13e3, "omega": 1.0, "eta_1": 0, "eta_2": 0, "eta_3": 0}.items():
        panel.set(name, value)
    panel.run(1500)
    assert panel.get("k_over_c_valid") == 1
    assert panel.get("breakaway_reason") == Refusal.TOO_UNCERTAIN
    assert abs(panel.get("breakaway_e") - FORCE_AT_BREAKAWAY_PA) < 2 * panel.get("breakaway_std")
    known = panel.cycle.snapshot.decision.estimates.breakaway
    assert panel.get("breakaway_e") == pytest.approx(known.value, rel=1e-6)
