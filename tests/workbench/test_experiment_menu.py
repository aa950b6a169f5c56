"""The inputs that an experiment is chosen from: each stays inside its range, and does what its name says."""

from itertools import pairwise

import numpy as np
import pytest

from workbench.select.separating_experiment import MENU

PHASE = np.linspace(0.0, 1.0, 10_001)[:-1]
RESTARTS = "restarts in the same direction after holds"


def stretches(levels: np.ndarray) -> list[tuple[int, int]]:
    """Return direction and length, in steps of the phase, of each stretch: +1 up, -1 down, 0 held."""
    way = np.sign(np.diff(levels).round(9)).astype(int)
    ends = [0, *(np.flatnonzero(np.diff(way)) + 1).tolist(), way.size]
    return [(int(way[first]), end - first) for first, end in pairwise(ends)]


@pytest.mark.parametrize("name", MENU)
def test_each_stays_inside_the_pressures_and_uses_most_of_them(name: str) -> None:
    levels = MENU[name](PHASE)
    assert 0.0 <= levels.min() < 0.35
    assert 0.65 < levels.max() <= 1.0


def test_restarts_go_on_the_way_they_went_after_holds_of_different_lengths() -> None:
    """Each way at least twice: what grows while a stem rests is told by restarts alike but for the hold."""
    parts = [each for each in stretches(MENU[RESTARTS](PHASE)) if each[1] > 5]
    ways = [way for way, _ in parts]
    assert ways[::2] == [1, 1, 1, -1, -1, -1, -1]
    held = [length / PHASE.size for way, length in parts if way == 0]
    assert len(held) == 7
    assert min(length / PHASE.size for _, length in parts) > 0.035
    assert max(held[:6]) < 0.13
    assert len({round(each, 2) for each in held[:3]}) == 3


def test_ramps_are_each_faster_than_the_one_before() -> None:
    lengths = [length for way, length in stretches(MENU["ramps of rising speed"](PHASE)) if length > 5]
    assert lengths == sorted(lengths, reverse=True)
    assert len(set(lengths)) == 6
