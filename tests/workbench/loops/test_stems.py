import numpy as np
import pytest

from workbench.loops.stem_landings import rest_positions


@pytest.mark.parametrize("slides_on", [False, True])
def test_a_stem_rests_until_the_output_has_gone_its_stiction_after_a_turn(slides_on: bool) -> None:
    rising, falling = np.arange(0.0, 10.01, 0.1), np.arange(9.9, -0.01, -0.1)
    output = np.concatenate([rising, falling])
    (stem,) = rest_positions(output, np.array([3.0]), np.array([1.0]), np.array([slides_on])).T
    turned = stem[rising.size :]
    rests = np.flatnonzero(turned != stem[rising.size - 1])[0]
    if slides_on:  # it stood f_d = 1 behind the output: the whole S = 3 is to be gone
        assert output[rising.size - 1] - falling[rests] == pytest.approx(3.0, abs=0.11)
    assert stem[rising.size + rests] == pytest.approx(falling[rests] + 1.0)
    assert (np.abs(output - stem) <= 2.0 + 1e-9).all()


def test_without_friction_the_stem_is_the_output() -> None:
    output = np.sin(np.linspace(0.0, 9.0, 50))
    (stem,) = rest_positions(output, np.zeros(1), np.zeros(1), np.array([False])).T
    assert stem == pytest.approx(output)
