"""What is proved of the law on an identified valve: no drawn valve violates it, and bad laws are refused."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from benchmarks.certified_valves import (
    BAD_LAWS,
    DEAD_BAND_STAYS,
    drawn_inside,
    drawn_known,
    report,
    violated,
    wrongly_given,
)
from positioner.control.laws.slides.certificate import Certificate, KnownValve, Refused, certified
from positioner.control.laws.slides.slide_bounds import SlideThresholds
from positioner.estimation.landings.breakaway_distance import Interval
from tests.control.scripted_stem import SETTINGS

NARROW = Interval(4.9e-3, 5.0e-3, seen=True)
KNOWN = KnownValve(low_m=-2e-5, high_m=2e-5, scatter_m=1e-5, onward=NARROW, turning=NARROW, friction_m=0.01)


def test_a_well_known_valve_by_hand() -> None:
    """d = 5 mm, A = 0.05 mm, E = 0.06 mm, Λ = 1.012: least = 4.45 mm, 1.3 of it is longer than what surely breaks.

    The dead band of 0.05 mm must widen twice: 5 landings, a hold at first, one of each interval: 10 slides.
    """
    found = certified(KNOWN, SETTINGS)
    assert isinstance(found, Certificate)
    assert found.beyond_m == pytest.approx(1.02 * 1.3 * 1.012**2 * (1.012 * 5e-3 + 5e-5) + 6e-5, rel=1e-3)
    assert found.most_slides == 10
    assert found.ends_within_m == pytest.approx(6e-5)


def test_no_valve_inside_the_intervals_violates_its_certificate() -> None:
    given = 0
    for number in range(30):
        rng = np.random.default_rng([5, number])
        known = drawn_known(rng)
        found = certified(known, SETTINGS)
        if isinstance(found, Certificate):
            given += 1
            assert list(islice(violated(drawn_inside(known, rng), found, 4), 1)) == []
            assert list(wrongly_given(known)) == []
    assert given > 15


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_none_of_ten_thousand_valves_violates_its_certificate() -> None:
    said = list(report(10_000, 8, 0))
    assert "violated certificates: 0 of 10000" in said
    assert "bad laws that were given one: {}" in said


@pytest.mark.parametrize("bad", [*BAD_LAWS.values(), DEAD_BAND_STAYS], ids=[*BAD_LAWS, "the dead band stays"])
def test_a_bad_law_is_refused(bad: SlideThresholds) -> None:
    assert isinstance(certified(KNOWN, replace(SETTINGS, thresholds=bad)), Refused)


def test_a_law_that_would_break_the_certificate_of_the_good_one_is_refused() -> None:
    rng = np.random.default_rng(1)
    found = certified(KNOWN, SETTINGS)
    assert isinstance(found, Certificate)
    for name in ("the way back is shorter", "a move has one slide"):
        bad = replace(SETTINGS, thresholds=BAD_LAWS[name])
        assert isinstance(certified(KNOWN, bad), Refused)
        assert any(True for _ in violated(drawn_inside(KNOWN, rng, bad), found, 8))


@pytest.mark.parametrize(
    ("known", "parameter"),
    [
        (replace(KNOWN, scatter_m=1e-3), "scatter of the landings"),
        (replace(KNOWN, high_m=2e-4), "balance: its bend over the travel"),
        (replace(KNOWN, turning=Interval(2e-3, 5e-3, seen=True)), "break-away: between"),
        (replace(KNOWN, onward=Interval(1e-3, 5e-3, seen=True)), "break-away: between"),
        (replace(KNOWN, onward=Interval(4.9e-3, 5e-3)), "break-away: between"),
    ],
)
def test_what_cannot_be_proved_is_refused_with_what_would_have_to_be_known_better(
    known: KnownValve, parameter: str
) -> None:
    found = certified(known, SETTINGS)
    assert isinstance(found, Refused)
    assert found.parameter.startswith(parameter)
