"""How far a fit's pressure is off the measured one, second by second: what lies before the actuator, what at the stem.

    p_measured = c_0 + c_1 p + e     c_0, c_1 by least squares: zero and span of a transmitter are nobody's effect
    l_b = log rms of e in block b    the blocks of `block_errors`

Effects that do as well on the position may do it by different pressures: a supply limit cuts the pressure, a stop
does not. Where the actuator's pressure was measured, it tells them apart. The transmitter is taken at its word: a lag
of its own is a lag of the pressure.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.recording import Column
from config.results.result import Brief
from workbench.data.held_out import Part, Split
from workbench.fit.fit_result import Fit
from workbench.select.block_errors import block_logs, indistinguishable
from workbench.select.selection_thresholds import SELECTION


@dataclass(frozen=True, slots=True, repr=False)
class PressureErrors(Brief):
    """How far a fit's pressure is off the measured one, zero and span of the transmitter apart."""

    rms_pa: float
    logs: Column
    """l_b of the fitted and the held-out blocks, (blocks,)."""
    structured_pa: float = 0.0
    """Of it what goes on from sample to sample, rms: it is no noise."""

    def speaks_against(self, other: "PressureErrors") -> bool:
        """Whether another's pressure is off by more than this one's, and not by chance."""
        return not indistinguishable(self.logs, other.logs)


def pressure_errors(fit: Fit, split: Split) -> PressureErrors | None:
    """Return how far a fit's pressure is off; None where none was measured, or the fit begins with the measured one."""
    parts = (split.train, split.test)
    if fit.from_pressure or any(each.record.pressure_pa is None for each in parts):
        return None
    errors_pa = [_error_pa(fit, each) for each in parts]
    scale_pa = SELECTION.negligible_pressure * max(float(np.nanstd(_measured_pa(each))) for each in parts)
    logs = [
        block_logs(part.record.time_s, error_pa, scale_pa, part.record.period_s)
        for part, error_pa in zip(parts, errors_pa, strict=True)
    ]
    rms_pa = float(np.sqrt(np.nanmean(np.concatenate(errors_pa) ** 2)))
    return PressureErrors(rms_pa, np.concatenate(logs), _structured_pa(errors_pa))


def _structured_pa(errors_pa: Sequence[Column]) -> float:
    """Return of errors, Pa, each (n,), what goes on over the next samples, rms; none where no two neighbours count."""
    distances = range(1, SELECTION.noise_memory + 1)
    products = np.concatenate([each[k:] * each[:-k] for each in errors_pa for k in distances])
    known = products[np.isfinite(products)]
    return float(np.sqrt(max(known.mean(), 0.0))) if known.size else 0.0


def _measured_pa(part: Part) -> Column:
    """Return the measured pressure, Pa, (n,), NaN where it does not count, or none was measured."""
    measured_pa = part.record.measured_pa
    assert measured_pa is not None
    return np.where(part.counted, measured_pa, np.nan)


def _error_pa(fit: Fit, part: Part) -> Column:
    """Return e, Pa, (n,), NaN where it does not count."""
    measured_pa, pressure_pa = _measured_pa(part), fit.pressure_pa(part.record)
    rows = np.isfinite(measured_pa) & np.isfinite(pressure_pa)
    A = np.column_stack([np.ones(rows.sum()), pressure_pa[rows]])
    error_pa = np.full(rows.size, np.nan)
    error_pa[rows] = measured_pa[rows] - A @ np.linalg.lstsq(A, measured_pa[rows])[0]
    return error_pa
