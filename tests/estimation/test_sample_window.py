"""The record of the last samples."""

from collections import deque

import numpy as np
import pytest

from positioner.estimation.sample_window import SampleWindow


def test_holds_the_last_samples_in_order_for_ever() -> None:
    record = SampleWindow(window_s=0.019)
    truth: deque[tuple[float, ...]] = deque(maxlen=20)
    for i in range(1000):
        sample = (i * 1e-3, float(i) ** 2, -float(i))
        record.append(*sample)
        record.set_derivatives(2.0 * i, 2.0)
        truth.append((*sample, 2.0 * i, 2.0))
        np.testing.assert_array_equal(record.time_s, [each[0] for each in truth])
        np.testing.assert_array_equal(record.position_m, [each[1] for each in truth])
        np.testing.assert_array_equal(record.pressure_pa, [each[2] for each in truth])
        assert record.oldest() == truth[0]
        assert record.full == (len(truth) == 20)


def test_a_missing_sample_is_no_gap_and_a_gap_is() -> None:
    record = SampleWindow(window_s=0.05)
    assert not record.breaks(0.0)
    for i in range(30):
        record.append(i * 1e-3, 0.0, 0.0)
    assert not record.breaks(0.029 + 0.049)
    assert record.breaks(0.029 + 0.053)
    assert record.breaks(0.029)
    assert record.breaks(0.010)


@pytest.mark.parametrize("period_s", [1e-5, 1e-3, 5e-3])
def test_its_length_follows_from_the_period(period_s: float) -> None:
    record = SampleWindow(window_s=0.05)
    for i in range(6):
        record.append(i * period_s, 0.0, 0.0)
    assert record.length == round(0.05 / period_s) + 1
    record.clear()
    assert not record.count
