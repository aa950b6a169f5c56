"""The window of a spectrum and the parabola of an acceleration, as scipy.signal's own."""

import numpy as np
import pytest

from workbench.compare.residuals import LONGEST_WINDOW, spectrum
from workbench.data.motion import PARABOLA_ROWS, acceleration_m_per_s2

PERIOD_S = 0.02


@pytest.mark.parametrize("count", [9, 100, 1023, 1024, 1025, 2560])
def test_the_spectrum_and_the_acceleration_are_those_of_scipy(count: int) -> None:
    from scipy.signal import savgol_filter, welch  # takes as long to load as all else together

    position_m = 0.03 + 1e-5 * np.random.default_rng(count).normal(size=count)
    frequency_hz, density = welch(position_m, 1.0 / PERIOD_S, nperseg=min(LONGEST_WINDOW, count))
    found = spectrum(position_m, PERIOD_S)
    np.testing.assert_allclose(found.frequency_hz, frequency_hz)
    np.testing.assert_allclose(found.density_m2_per_hz, density, atol=1e-12 * density.max())
    acceleration = savgol_filter(position_m, PARABOLA_ROWS, 2, deriv=2, delta=PERIOD_S)
    np.testing.assert_allclose(acceleration_m_per_s2(position_m, PERIOD_S), acceleration, atol=1e-9)
