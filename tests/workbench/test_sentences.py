"""Counts of slips in plain words."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.compare.comparison_sentences import Findings, sentences, shortened
from workbench.compare.slip_matching import MatchedSlip, SlipEvents
from workbench.data.motion import Slip

SLIPS = tuple(Slip(i, i + 1, 0.0, 1e-3 * (-1) ** i, (-1) ** i) for i in range(25))
FOUND = Findings(
    time_s=0.1 * np.arange(100, dtype=np.float64),
    residual_m=np.full(100, 1e-3),
    position_m=np.linspace(0.0, 0.05, 100),
    phase=np.zeros(100, np.int64),
    direction=np.zeros(100),
    floor_m=5e-5,
    scale_m=5e-5,
    rms_m=1e-3,
    events=SlipEvents((), (), ()),
    measured_slips=SLIPS,
    depends_on_input=False,
    close=False,
)


@pytest.mark.parametrize(
    ("missed", "spurious", "said"),
    [
        (0, 3, "it makes 3 spurious slips"),
        (0, 1, "it makes 1 spurious slip"),
        (2, 0, "it misses 2 of 22 slips"),
        (2, 1, "it misses 2 of 22 slips and makes 1 spurious slip"),
    ],
)
def test_slips_missed_and_spurious_are_counted_and_none_is_not_said(missed: int, spurious: int, said: str) -> None:
    pair = MatchedSlip(0.0, 1, False, 0.0, 0.0)  # 20 of the 25 have their own match, the others share one
    events = SlipEvents((pair,) * 20, tuple(map(float, range(missed))), tuple(map(float, range(spurious))))
    told = sentences(replace(FOUND, events=events))
    assert said in told
    assert not [each for each in told if " 0 " in each]


def test_a_stem_at_rest_that_the_model_moves_is_said() -> None:
    still = replace(FOUND, measured_slips=(), events=SlipEvents((), (), (1.0,)))
    assert "the model makes 1 spurious slip:" in sentences(still)[0]


def test_a_thousand_notes_are_counted_and_not_all_told() -> None:
    notes = [f"note {i}" for i in range(1000)]
    assert shortened(notes) == (*notes[:8], "and 992 more of the kind")
    assert shortened(notes[:9]) == tuple(notes[:9])
