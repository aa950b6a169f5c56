"""A parameter of the valve file that the recording wants elsewhere is said, with what may look the same."""

import numpy as np
import pytest

from config.drive import KINDS
from config.valve_file import EffectTable, ValveFile
from tests.workbench.hand_made import LIBRARY, fit_of
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.data.held_out import split
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.moved_parameters import Moved, excluded_parameters
from workbench.fit.fitting import fit
from workbench.fit.parameter_estimate import Fitted
from workbench.select.block_errors import block_errors


def moved(before_n: float, lower_n: float, upper_n: float) -> tuple[Moved, ...]:
    preload = EffectTable.model_validate({"name": "preload", "force_n": before_n})
    value_n = 0.5 * (lower_n + upper_n)
    found = Fitted(value_n, 1.0, lower_n, upper_n, at_bound=False, physical=True)
    fit = fit_of("preload", found={"preload.force_n": found})
    return excluded_parameters(ValveFile(valve=SEED.valve, effect=(preload,)), fit, LIBRARY)


def test_a_preload_that_the_recording_excludes_is_said_with_what_may_look_the_same() -> None:
    (found,) = moved(900.0, 938.0, 941.0)
    assert found.name == "preload.force_n"
    assert {"asymmetric_friction", "sensor_offset"} <= {*found.like}
    said = found.sentence(KINDS["valve"])
    assert all(each in said for each in ("preload.force_n", "939.5", "938 to 941", "900"))
    assert "asymmetric_friction" in said


@pytest.mark.parametrize(("lower_n", "upper_n"), [(850.0, 960.0), (901.0, 905.0)], ids=["unsure", "next to nothing"])
def test_one_that_is_not_excluded_or_hardly_moved_is_no_news(lower_n: float, upper_n: float) -> None:
    assert moved(900.0, lower_n, upper_n) == ()


def test_what_the_file_leaves_at_nothing_counts_however_little_it_moves() -> None:
    (found,) = moved(0.0, 2.0, 4.0)
    assert found.before == 0.0


def test_a_right_file_is_not_called_wrong_though_a_fit_would_have_it_otherwise() -> None:
    """Break-aways scatter, so that the interval of the asymmetry is too narrow: 0.132, 95 % 0.125 to 0.139."""
    right = with_effect(drawn_valve(np.random.default_rng(103)), "asymmetric_friction", asymmetry=0.12)
    parts = split([record_of(right, 3, 2000, dirty=True)])
    found = fit(parts.train.recording, right)
    assert AsGiven.of(right, parts, found).holds(block_errors(found, parts))
    twice = with_effect(drawn_valve(np.random.default_rng(103)), "asymmetric_friction", asymmetry=0.24)
    assert not AsGiven.of(twice, parts, found).holds(block_errors(found, parts))
