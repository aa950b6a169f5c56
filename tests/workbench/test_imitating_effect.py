"""What was named only stands in for something where a form without a name does better, and acts elsewhere."""

from typing import Any

import pytest

from workbench.blind.hiding import hide
from workbench.diagnosis import imitating_effect
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.diagnosis_json import as_json
from workbench.diagnosis.imitating_effect import StandIn
from workbench.discover import form_search
from workbench.discover.form_search import SearchedForms
from workbench.discover.grammar import FORMS

FEW = ("force_over_position_power", "scaled_over_direction_sign")
FLOW_FORCE = 85010
"""A seed that hides a flow's force on the plug."""
NAMED = ("spring_hardening", "asymmetric_friction")

BOW = 85019
"""A seed that hides a bowed sensor."""


def test_what_leaves_the_noise_alone_is_held_against_forms_too(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = hide(BOW)
    assert [each.name for each in hidden.truth.effect] == ["sensor_nonlinearity"]
    bent = tuple(each for each in FORMS if each.name == "indication_over_position_power")
    monkeypatch.setattr(form_search, "FORMS", bent)
    found = diagnose(hidden.fit, hidden.base, test=hidden.test, effects=("flow_force",))
    assert found.best.errors.leaves_nothing(found.best.floor_m)
    assert found.doubt(StandIn) is not None
    assert (found.verdict, found.missing) == ("unexplained", ("flow_force",))


@pytest.mark.long
def test_two_effects_that_imitate_a_flow_force_which_was_not_tried_are_no_explanation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hidden = hide(FLOW_FORCE)
    assert [each.name for each in hidden.truth.effect] == ["flow_force"]
    asked: list[SearchedForms] = []

    def searched(*args: Any, **settings: Any) -> SearchedForms:
        asked.append(form_search.search_forms(*args, **settings))
        return asked[-1]

    monkeypatch.setattr(imitating_effect, "search_forms", searched)
    monkeypatch.setattr(form_search, "FORMS", tuple(each for each in FORMS if each.name in FEW))
    found = diagnose(hidden.fit, hidden.base, effects=NAMED)
    assert found.best.explained, "it reaches the floor: by what is left alone it would be called all that is missing"
    stand_in = found.doubt(StandIn)
    assert stand_in is not None
    assert (found.verdict, found.missing, stand_in.form) == ("unexplained", NAMED, FEW[0])
    assert found.best.fit.terms.landings.mean_square > 2.0, "slides end elsewhere, however small the error"
    assert stand_in.form_rmse_m < stand_in.named_rmse_m
    assert found.sentence.endswith(f" But {stand_in.sentence(found.kind)}.")
    assert as_json(found)["stand_in"]["form"] == FEW[0]
    assert FEW[0] in [each.name for each in asked[0].candidates]
    right = diagnose(hidden.fit, hidden.base, effects=("flow_force",))
    assert (right.verdict, right.missing, right.doubts) == ("missing", ("flow_force",), ())
