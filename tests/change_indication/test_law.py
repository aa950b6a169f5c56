"""What the law of slides does on drawn valves is what it did; where it shall not be, `benchmarks.kept_law --keep`."""

from itertools import islice

import pytest

from benchmarks.kept_law import FIGURES, LINES_FILE, VALVES_PLAYED, changes, line, seeds
from benchmarks.kept_lines import Line, kept
from tests.cases import few_always

LINES = kept(LINES_FILE)
IN_SHORT = 4
"""Of twelve valves those that `make test` plays: of 18 thresholds, changed by 30 %, all see the same four."""


@pytest.mark.parametrize("before", few_always(LINES, IN_SHORT), ids=lambda each: str(each["seed"]))
def test_the_law_does_on_a_valve_what_it_did(before: Line) -> None:
    assert changes(before, line(before["seed"])) == [], "python -m benchmarks.kept_law says it of all"


def test_the_valves_are_those_that_the_command_plays_and_what_moved_is_said() -> None:
    assert [each["seed"] for each in LINES] == list(islice(seeds(), VALVES_PLAYED))
    moved = {**LINES[0], **{each: LINES[0][each] + 1e-3 for each in FIGURES}}
    assert [each.split()[0] for each in changes(LINES[0], moved)] == list(FIGURES)
