"""What is proved of the law on an identified valve: no drawn valve violates it, and bad laws are refused."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from benchmarks.certified_valves import BAD_LAWS, OVERSHOOTS, drawn_inside, drawn_known, violated
from positioner.control.laws.slides.certificate import Certificate, KnownValve, Refused, certified
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from tests.control.scripted_stem import SETTINGS

NARROW = Interval(4.9e-3, 5.0e-3, seen=True)
KNOWN = KnownValve(balance_m=2e-5, scatter_m=1e-5, distances=BreakawayDistance(*(4 * [NARROW])), friction_m=0.01)


def test_a_well_known_valve_by_hand() -> None:
    """d = 5 mm, B = 0.02 mm: 5.1 mm beyond, and what a slide lands off; a hold each way is possible, for B."""
    found = certified(KNOWN, SETTINGS)
    assert isinstance(found, Certificate)
    assert found.beyond_m >= 1.02 * 5e-3 + 4e-5
    assert found.beyond_m < 1.4 * 5e-3
    assert found.most_slides <= 8
    assert found.ends_within_m < 5.1e-5


def test_no_valve_inside_the_intervals_violates_its_certificate() -> None:
    given = 0
    for number in range(30):
        rng = np.random.default_rng([5, number])
        known = drawn_known(rng)
        found = certified(known, SETTINGS)
        if isinstance(found, Certificate):
            given += 1
            assert list(islice(violated(drawn_inside(known, rng), found, 4), 1)) == []
    assert given > 5


@pytest.mark.parametrize("bad", BAD_LAWS)
def test_a_bad_law_is_refused(bad: str) -> None:
    assert isinstance(certified(KNOWN, replace(SETTINGS, thresholds=BAD_LAWS[bad])), Refused)


def test_a_law_that_overshoots_what_it_learns_is_refused() -> None:
    found = certified(KNOWN, SETTINGS, held_back=OVERSHOOTS)
    assert isinstance(found, Refused)
    assert found.parameter == "the law: held_back"


@pytest.mark.parametrize(
    ("known", "parameter"),
    [
        (replace(KNOWN, scatter_m=1e-3), "scatter of the landings"),
        (replace(KNOWN, balance_m=5e-3, scatter_m=2e-5), "balance: spring and friction"),
        (
            replace(KNOWN, distances=BreakawayDistance(*(4 * [Interval(1e-5, 5e-3, seen=True)])), quantum_m=2e-4),
            "break-away: between",
        ),
        (replace(KNOWN, distances=BreakawayDistance()), "break-away distances"),
    ],
)
def test_what_cannot_be_proved_is_refused_with_what_would_have_to_be_known_better(
    known: KnownValve, parameter: str
) -> None:
    found = certified(known, SETTINGS)
    assert isinstance(found, Refused)
    assert found.parameter.startswith(parameter)
