"""What was named only stands in for something where a form without a name does better, and acts elsewhere."""

from typing import Any

import numpy as np
import pytest

from config.recording import Recording
from config.valve_file import ValveFile
from tests.workbench.valves import drawn_valve, record_of, with_effect
from workbench.blind.input_signal import excitation
from workbench.diagnosis import stand_in
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.diagnosis_json import as_json
from workbench.discover import form_search
from workbench.discover.form_search import SearchedForms
from workbench.discover.grammar import FORMS

FEW = ("scaled_over_direction_sign", "force_constant")
STICKS = 1.3
"""F_s/F_c: an asymmetry then differs from a preload, by 30 % of itself where the stem breaks loose."""
ASYMMETRY = 0.12


@pytest.fixture(scope="module")
def lopsided() -> tuple[Recording, ValveFile]:
    """A recording of a valve of lopsided packing, and the valve without."""
    drawn = drawn_valve(np.random.default_rng(11)).valve
    valve = ValveFile(valve=drawn.model_copy(update={"static_n": STICKS * drawn.coulomb_n}))
    command_pa = excitation(valve.valve, np.random.default_rng(5), 4000)
    return record_of(with_effect(valve, "asymmetric_friction", asymmetry=ASYMMETRY), 5, command_pa=command_pa), valve


@pytest.mark.long
def test_a_preload_that_imitates_an_asymmetry_which_was_not_tried_is_no_explanation(
    lopsided: tuple[Recording, ValveFile], monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, valve = lopsided
    asked: list[SearchedForms] = []

    def searched(*args: Any, **settings: Any) -> SearchedForms:
        asked.append(form_search.search_forms(*args, **settings))
        return asked[-1]

    monkeypatch.setattr(stand_in, "search_forms", searched)
    monkeypatch.setattr(form_search, "FORMS", tuple(each for each in FORMS if each.name in FEW))
    found = diagnose(recording, valve, effects=("preload",))
    assert found.best.explained, "it reaches the floor: by what is left alone it would be called all that is missing"
    assert found.stand_in is not None
    assert (found.verdict, found.missing, found.stand_in.form) == ("unexplained", ("preload",), FEW[0])
    assert found.best.fit.terms.landings.mean_square > 2.0, "slides end elsewhere, however small the error"
    assert found.stand_in.form_rmse_m < found.stand_in.named_rmse_m
    assert found.sentence.endswith(f" {found.stand_in.sentence}.")
    assert found.stand_in.named == ("preload",)
    assert as_json(found)["stand_in"]["form"] == FEW[0]
    assert [each.name for each in asked[0].candidates] == [FEW[0]], "a constant force acts where a preload does"
    right = diagnose(recording, valve, effects=("asymmetric_friction",))
    assert (right.verdict, right.missing, right.stand_in) == ("missing", ("asymmetric_friction",), None)
