from typing import Any

import numpy as np
import pytest

from workbench.loops.stem_and_process import compiled, cost_of, costs_of_stems, respond, rest_positions


@pytest.mark.parametrize("slides_on", [False, True])
def test_a_stem_rests_until_the_output_has_gone_its_stiction_after_a_turn(slides_on: bool) -> None:
    rising, falling = np.arange(0.0, 10.01, 0.1), np.arange(9.9, -0.01, -0.1)
    output = np.concatenate([rising, falling])
    stem = rest_positions(output, 3.0, 1.0, slides_on)
    turned = stem[rising.size :]
    rests = np.flatnonzero(turned != stem[rising.size - 1])[0]
    if slides_on:  # it stood f_d = 1 behind the output: the whole S = 3 is to be gone
        assert output[rising.size - 1] - falling[rests] == pytest.approx(3.0, abs=0.11)
    assert stem[rising.size + rests] == pytest.approx(falling[rests] + 1.0)
    assert (np.abs(output - stem) <= 2.0 + 1e-9).all()


def test_without_friction_the_stem_is_the_output() -> None:
    output = np.sin(np.linspace(0.0, 9.0, 50))
    stem = rest_positions(output, 0.0, 0.0, False)
    assert stem == pytest.approx(output)


def test_the_process_and_the_stem_that_made_a_record_are_found_and_no_gain_against_the_action() -> None:
    rng = np.random.default_rng(1)
    output = np.sin(np.arange(600.0) / 15.0) * 4.0 + 0.1 * rng.standard_normal(600)
    made = respond(rest_positions(output, 3.0, 1.0, False), 2, 6.0, 3.0, 8)
    pv = 2.0 * made + 0.01 * rng.standard_normal(made.size)
    sizes, delays = np.array([0.0, 2.0, 3.0, 4.0]), np.array([0, 8, 16])
    lags = np.array([[6.0, 0.0], [6.0, 3.0], [6.0, 6.0]])
    jumps, manners = sizes / 3.0, np.zeros(4, np.bool_)
    costs, gains = costs_of_stems(output, pv, 2, sizes, jumps, manners, lags, delays, 1)
    best = np.unravel_index(np.argmin(costs), costs.shape)
    assert tuple(map(int, best)) == (2, 1, 1)
    assert gains[best] == pytest.approx(2.0, rel=0.01)
    costs, gains = costs_of_stems(output, pv, 2, sizes, jumps, manners, lags, delays, -1)
    assert costs[best] == cost_of(np.zeros((0, pv.size)), pv)[0]
    assert gains[best] == 0.0


def test_the_cost_is_that_of_the_residual_whitened() -> None:
    rng = np.random.default_rng(2)
    shocks, pv = rng.standard_normal(4000), np.zeros(4000)
    for row in range(2, 4000):
        pv[row] = 1.2 * pv[row - 1] - 0.5 * pv[row - 2] + 0.3 * shocks[row]
    assert cost_of(np.zeros((0, 4000)), pv)[0] == pytest.approx(3996 * np.log(0.3), rel=0.01)


def test_what_is_compiled_is_not_kept_where_no_folder_may_be_written() -> None:
    nowhere: dict[str, Any] = {}
    exec("def doubled(value): return 2.0 * value", nowhere)
    assert compiled(nowhere["doubled"])(2.0) == 4.0
