"""Period, law and shapes, by signals worked out by hand."""

import numpy as np
import pytest

from workbench.loops.controller_law import see_law
from workbench.loops.literature_votes import hagglund, he, horch
from workbench.loops.loop_record import LoopRecord
from workbench.loops.oscillation import find_oscillation
from workbench.loops.quality_gates import turns

TIME = np.arange(1000.0)
SINE = np.sin(2.0 * np.pi * TIME / 40.0)
TRIANGLE = 2.0 / np.pi * np.arcsin(SINE)
SQUARE = np.sign(np.cos(2.0 * np.pi * (TIME + 0.5) / 40.0))


@pytest.mark.parametrize("shape", [SINE, TRIANGLE, SQUARE])
def test_a_period_is_found_with_its_regularity(shape: np.ndarray) -> None:
    found = find_oscillation(shape, 2.0)
    assert found.period_s == pytest.approx(80.0, rel=0.02)
    assert found.regular


def test_noise_does_not_oscillate() -> None:
    assert not find_oscillation(np.random.default_rng(1).standard_normal(1000).cumsum(), 1.0).regular


def test_the_controllers_law_is_seen_in_its_output() -> None:
    rng = np.random.default_rng(0)
    pv = 50.0 + SINE + 0.1 * rng.standard_normal(TIME.size)
    error = 50.0 - pv
    output = 40.0 + 2.5 * error + 2.5 / 20.0 * np.cumsum(error) * 0.5
    law = see_law(LoopRecord("L", 0.0, 0.5, output, pv, np.full(TIME.size, 50.0)))
    assert law.seen
    assert law.action == 1
    assert law.gain == pytest.approx(2.5, rel=0.01)
    assert law.reset_s == pytest.approx(20.0, rel=0.02)


def test_an_output_that_stands_shows_no_law() -> None:
    law = see_law(LoopRecord("L", 0.0, 0.5, np.full(TIME.size, 40.0), 50.0 + SINE))
    assert (law.seen, law.explained, law.action) == (False, 0.0, 0)


def test_each_method_of_the_literature_tells_its_own_shape() -> None:
    assert (he(TRIANGLE, 40.0).says, he(SINE, 40.0).says) == ("sticks", "no")
    assert (hagglund(SQUARE, 40.0).says, hagglund(SINE, 40.0).says) == ("sticks", "no")
    quarter = np.sin(2.0 * np.pi * (TIME - 10.0) / 40.0)
    assert (horch(SINE, quarter, 40.0).says, horch(SINE, -SINE, 40.0).says) == ("sticks", "no")


def test_turns_are_counted_that_come_back_by_a_quarter() -> None:
    assert turns(np.linspace(0.0, 10.0, 50)) == 0
    assert turns(np.array([0.0, 10.0, 8.0, 9.0, 2.0, 3.0, 10.0])) == 2
    assert turns(SINE) == 50
