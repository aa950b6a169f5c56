"""How many of a series of samples are independent."""

import numpy as np
import pytest

from signals.independence import independent_share


def test_what_hangs_together_is_few_independent_samples() -> None:
    white = np.random.default_rng(2).standard_normal(20000)
    assert independent_share(white) == pytest.approx(1.0, abs=0.03)
    wandering = np.zeros(20000)
    for i in range(1, wandering.size):
        wandering[i] = 0.9 * wandering[i - 1] + white[i]
    assert independent_share(wandering) == pytest.approx(0.1 / 1.9, rel=0.15)
    assert independent_share(np.zeros(100)) == 1.0
