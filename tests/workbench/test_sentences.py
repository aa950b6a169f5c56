"""Counts of slips in plain words."""

from dataclasses import replace

import numpy as np
import pytest

from config.drive import VALVE
from signals.moves import Slip
from workbench.compare.comparison_sentences import Findings, judge_findings, sentences, shorten_notes, slip_sentences
from workbench.compare.slip_matching import MatchedSlip, SlipEvents

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
    length=VALVE.length,
)


@pytest.mark.parametrize(
    ("missed", "spurious", "said"),
    [
        (0, 3, "the model makes 3 spurious slips"),
        (0, 1, "the model makes 1 spurious slip"),
        (2, 0, "the model misses 2 of 22 slips"),
        (2, 1, "the model misses 2 of 22 slips and makes 1 spurious slip"),
    ],
)
def test_slips_missed_and_spurious_are_counted_and_none_is_not_said(missed: int, spurious: int, said: str) -> None:
    pair = MatchedSlip(0.0, 1, False, 0.0, 0.0)  # 20 of the 25 have their own match, the others share one
    events = SlipEvents((pair,) * 20, tuple(map(float, range(missed))), tuple(map(float, range(spurious))))
    told = sentences(replace(FOUND, events=events))
    assert said in told
    assert not [each for each in told if " 0 " in each]


def test_a_stem_at_rest_that_the_model_moves_is_said() -> None:
    at_rest_m = np.full(100, 0.01)
    still = replace(FOUND, position_m=at_rest_m, measured_slips=(), events=SlipEvents((), (), (1.0,)))
    assert "the model makes 1 spurious slip:" in sentences(still)[0]


def test_a_thousand_notes_are_counted_and_not_all_told() -> None:
    notes = [f"note {i}" for i in range(1000)]
    assert shorten_notes(notes) == (*notes[:8], "and 992 more of the kind")
    assert shorten_notes(notes[:9]) == tuple(notes[:9])


def test_a_sentence_of_slips_points_to_them_the_gravest_first_and_to_no_others() -> None:
    slips = [MatchedSlip(10.0 * i, (-1) ** i, i % 4 < 2, 0.0, (1.0 + 0.01 * i) * 1e-3) for i in range(24)]
    slips += [MatchedSlip(300.0 + i, 1, False, 0.0, 1e-6 * i) for i in range(4)]
    told = judge_findings(replace(FOUND, events=SlipEvents(tuple(slips), (), ())))
    said = next(each for each in told if each.text.startswith("after a reversal"))
    assert [each.begin_s for each in said.stretches] == [10.0 * i for i in range(23, -1, -1) if i % 4 < 2]


def test_where_most_of_the_error_is_the_worst_run_of_samples_is_shown_first() -> None:
    phase = np.where(np.isin(np.arange(100) // 10, (2, 5, 7)), 1, 0)
    residual_m = np.where(phase == 1, np.where(np.arange(100) // 10 == 5, 3e-3, 1e-3), 1e-5)
    told = judge_findings(replace(FOUND, phase=phase, residual_m=residual_m))
    said = next(each for each in told if "of the squared error" in each.text)
    assert [round(each.begin_s) for each in said.stretches] == [5, 2, 7]
    assert said.stretches[0].end_s == pytest.approx(5.9)


def test_each_slip_is_told() -> None:
    events = SlipEvents((MatchedSlip(3.304, -1, True, -0.02, 6.6e-3),), (1.0,), (2.0,))
    assert slip_sentences(events, VALVE.length) == {
        "missed": ("at 1.00 s the stem slips, and the model does not",),
        "spurious": ("at 2.00 s the model slips, and the stem does not",),
        "matched": ("slip at 3.30 s, closing, after a reversal: the model comes 0.02 s early and ends 6.6 mm too far",),
    }
