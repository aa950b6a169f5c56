"""What is hardly known is refused as too uncertain, whatever rounding makes of its covariance."""

import numpy as np
import pytest

from config.codes import Refusal
from positioner.estimation.validity import ValidityCheck
from positioner.estimation.weighted_least_squares import Solution

CHECK = ValidityCheck(0.05, 1e-5, 10.0, 0.1)
THETA = np.array((-450.0, -38608.0, 0.0474))


@pytest.mark.parametrize("variance", [-1e9, np.nan])
def test_a_covariance_that_rounding_has_spoilt_says_that_nothing_is_known(variance: float) -> None:
    """Along the ratio b/c, whose variance is a small difference of large numbers, it may be negative."""
    ratio = np.array((0.0, 1 / THETA[2], -THETA[1] / THETA[2] ** 2))
    covariance = variance * np.outer(ratio, ratio) / float(ratio @ ratio) ** 2
    solution = Solution(THETA, covariance, np.zeros(3), 0.01, 1e3, 0, 1.0)
    b_over_c = CHECK.parameters(solution)[3]
    assert b_over_c.reason is Refusal.TOO_UNCERTAIN
    assert b_over_c.std == np.inf
