"""How many of neighbouring samples are independent, where each hangs together with the one before.

n' / n = (1 - rho) / (1 + rho)      rho the correlation of neighbours: that of a first-order autoregression
"""

import numpy as np
import numpy.typing as npt

CLIPPED = 5.0
"""Robust deviations at which a residual is clipped: one wild sample is no correlation."""
DEVIATION = 1.4826
"""Standard deviations a median absolute deviation, of the normal distribution."""


def independent_share(r: npt.NDArray[np.float64]) -> float:
    """Return n' / n of residuals, (n,); 1 of fewer than two."""
    if r.size < 2:
        return 1.0
    most = CLIPPED * DEVIATION * float(np.median(np.abs(r)))
    held = np.clip(r, -most, most)
    power = float(np.mean(held**2))
    rho = float(np.mean(held[1:] * held[:-1])) / power if power > 0.0 else 0.0
    rho = min(max(rho, 0.0), 0.999)
    return (1.0 - rho) / (1.0 + rho)
