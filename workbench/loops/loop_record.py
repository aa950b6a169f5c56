"""The samples of a loop on an even clock: output OP in %, process value PV and set point SP in the plant's units."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from config.results.result import Brief
from workbench.imports.loop_reader import LoopSamples
from workbench.loops.loop_thresholds import LIMITS

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, repr=False)
class LoopRecord(Brief):
    """A loop's record, n samples.

    Attributes:
        name: of the loop.
        time_s: of the first sample kept.
        period_s: of the samples.
        op_pct: the controller's output, %, (n,).
        pv: the process value, in its own unit, (n,).
        sp: the set point, likewise, (n,); None where there is none on record.
        automatic: where the controller was in charge, (n,); None where no mode is on record.
        missing: share of the samples that had no value and were filled in on a straight line.
        notes: what was left out or put right.
    """

    name: str
    time_s: float
    period_s: float
    op_pct: Array
    pv: Array
    sp: Array | None = None
    automatic: npt.NDArray[np.bool_] | None = None
    missing: float = 0.0
    notes: tuple[str, ...] = ()

    @classmethod
    def of_samples(
        cls,
        name: str,
        time_s: Array,
        op_pct: Array,
        pv: Array,
        sp: Array | None = None,
        automatic: npt.NDArray[np.bool_] | None = None,
    ) -> "LoopRecord":
        """Return the record of samples, (n,) each: its longest stretch without a gap, on an even clock.

        Raises:
            InputError: time that does not increase, or no two samples with a value.
        """
        steps = np.diff(time_s)
        if time_s.size < 2 or not (steps > 0.0).all():
            raise InputError(name, "time must increase, and there must be two samples")
        period_s = float(np.median(steps))
        known = np.isfinite(op_pct) & np.isfinite(pv)
        if known.sum() < 2:
            raise InputError(name, "no two samples hold both an output and a process value")
        at = np.flatnonzero(known)
        parts = np.split(at, np.flatnonzero(np.diff(time_s[at]) > LIMITS.gap_periods * period_s) + 1)
        kept = max(parts, key=lambda part: float(time_s[part[-1]] - time_s[part[0]]))
        notes = []
        if len(parts) > 1:
            left_out = 1.0 - kept.size / at.size
            gaps = "a gap" if len(parts) == 2 else f"{len(parts) - 1} gaps"
            notes.append(
                f"{gaps} of more than {LIMITS.gap_periods:g} periods: the longest stretch is taken, "
                f"{100 * left_out:.0f} % of the samples are left out"
            )
        own_s = time_s[kept]
        grid_s = own_s[0] + period_s * np.arange(round(float(own_s[-1] - own_s[0]) / period_s) + 1)
        if np.abs(np.diff(own_s) / period_s - 1.0).max() > 0.5:
            notes.append("samples are missing, or the clock is uneven: values between are read on straight lines")
        values = [np.interp(grid_s, own_s, column[kept]) for column in (op_pct, pv)]
        rows = np.clip(np.searchsorted(time_s, grid_s + 0.5 * period_s) - 1, 0, time_s.size - 1)
        setpoint = None if sp is None or not np.isfinite(sp[rows]).any() else _held(sp[rows])
        return cls(
            name,
            float(own_s[0]),
            period_s,
            values[0],
            values[1],
            setpoint,
            None if automatic is None else automatic[rows],
            max(0.0, 1.0 - kept.size / grid_s.size),
            tuple(notes),
        )

    @classmethod
    def of_export(cls, read: LoopSamples, name: str | None = None) -> "LoopRecord":
        """Return the record of an export that was read.

        Raises:
            InputError: as `of_samples`.
        """
        time_s = read.begin_s + read.time_s
        record = cls.of_samples(name or read.name, time_s, read.op_pct, read.pv, read.sp, read.automatic)
        return replace(record, notes=(*(f"{what}: {said}" for what, said in read.notes.items()), *record.notes))

    @property
    def duration_s(self) -> float:
        """From the first to the last sample, s."""
        return self.period_s * (self.pv.size - 1)


def averaged(values: Array, every: int) -> Array:
    """Return means of each `every` rows of (n,)."""
    count = values.size // every
    return np.asarray(values[: count * every].reshape(count, every).mean(axis=1))


def _held(values: Array) -> Array:
    """Return values, (n,), with the last one known where there is none: a set point stays until it is written."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(values.size), -1))
    first = float(values[known][0])
    return np.where(last >= 0, values[np.maximum(last, 0)], first)
