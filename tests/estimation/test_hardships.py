"""Jittered stamps, lost samples, a Stribeck term, an unknown start: each held against the bound of its own samples."""

import numpy as np
import pytest

from benchmarks.hardships import Hardship, hardships, lines
from config.valve_file import load_valve, shipped_valve

pytestmark = pytest.mark.long

ALLOWED = 1.5
SEEDS = 16
"""Fixed: they know a standard deviation to 18 %, and ours is at the bound, not at 1.5 times it."""


@pytest.fixture(scope="module")
def rows() -> dict[str, Hardship]:
    return {each.name: each for each in hardships(load_valve(shipped_valve("seed")), 1e-4, SEEDS)}


KNOWN_START = ("none", "uneven", "stamps", "lost", "Stribeck", "uneven, lost, Stribeck")
UNKNOWN_START = ("no rest", "late", "and no rest")


@pytest.mark.parametrize("name", KNOWN_START + UNKNOWN_START)
def test_each_within_one_and_a_half_times_its_bound(rows: dict[str, Hardship], name: str) -> None:
    row = rows[name]
    assert (row.rms < ALLOWED * row.bound).all()
    assert 0.5 < row.covered.mean() < 0.85


def test_with_the_start_known_a_hardship_hardly_moves_the_bound(rows: dict[str, Hardship]) -> None:
    for name in KNOWN_START:
        np.testing.assert_allclose(rows[name].bound, rows[name].clean, rtol=0.03)
        assert rows[name].valid.all()


def test_what_an_unknown_start_costs_is_the_bounds_and_late_the_mass_is_refused(rows: dict[str, Hardship]) -> None:
    for name in ("no rest", "and no rest"):
        assert (rows[name].bound[:4] > 1.25 * rows[name].clean[:4]).all()
        assert rows[name].valid.all()
    assert (rows["late"].bound[:4] > 10 * rows["late"].clean[:4]).all()
    assert not rows["late"].valid[:4].any()
    assert rows["late"].valid[4:].all()


def test_the_table_has_four_lines_a_row(rows: dict[str, Hardship]) -> None:
    said = lines(list(rows.values()))
    assert len(said) == 3 + 4 * len(rows)
    assert any("Stribeck" in line for line in said)
