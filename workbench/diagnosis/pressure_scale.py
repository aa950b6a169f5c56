"""Whether the measured pressure is on the command's scale: the one is what the other asks for.

    p = u_m + D + c (m - u_m) + e     m the command behind the lag of which the least mean |e| is left, u_m its median

A fit by the measured pressure takes it at its word: psi read as bar make all forces 14.5 times as large, bar absolute a
preload, and both fit. So c more than a quarter off, or D more than a fifth of what m spans, is said. Where the pressure
does not follow the command, as |e| of a third of its own changes shows, there is no scale to speak of.
"""

from dataclasses import dataclass
from itertools import permutations
from typing import Any, ClassVar

import numpy as np

from config.drive import Kind
from config.recording import Column
from workbench.data.pressure_lag import command_followed_pa
from workbench.data.record import UNITS_PA, Record
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.diagnosis.doubt import Case, Doubt
from workbench.imports.cell_units import ATMOSPHERE_PA


@dataclass(frozen=True, slots=True, repr=False)
class PressureScale(Doubt):
    """How a measured pressure stands to its command, where that is not one to one."""

    key: ClassVar[str] = "pressure_scale"

    span: float
    """c."""
    above_pa: float
    """D."""

    def sentence(self, kind: Kind) -> str:
        """Say so."""
        off_span = _is_another_span(self.span)
        way = f"{self.span:.3g} times as large as" if off_span else "off"
        read = next((f", as {one} read as {other} are" for one, other in _units(self.span)), "") if off_span else ""
        by = "" if off_span else f" by {kind.command.read.said(self.above_pa)}"
        zero = ", like an absolute one" if not off_span and _is_one(self.above_pa / ATMOSPHERE_PA) else ""
        return kind.text(
            f"the measured {kind.command.word} is {way} the command{by}{read or zero}, so forces fitted by it are "
            "wrong; correct its unit, zero or line, or diagnose by the command"
        )

    def as_json(self) -> dict[str, Any]:
        """Return it in plain types."""
        return {"span": self.span, "above_pa": self.above_pa}


def driven_at_another_scale(case: Case) -> PressureScale | None:
    """Return how the measured pressure that drives the stem stands to its command; None where the command does."""
    return pressure_scale(case.parts.train.record) if case.best.fit.from_pressure else None


def pressure_scale(record: Record) -> PressureScale | None:
    """Return how the measured pressure of a record stands to its command; None where that is one to one, or unknown."""
    p = record.pressure_pa
    if p is None or record.by_setpoint:
        return None
    rows = np.concatenate([np.arange(*each) for each in record.segments])
    rows = rows if record.pressure_known is None else rows[record.pressure_known[rows]]
    if not rows.size:
        return None
    lags = np.geomspace(DIAGNOSIS.shortest_lag, DIAGNOSIS.longest_lag, DIAGNOSIS.lags)
    found = min((_fitted(record, p, rows, share * record.period_s) for share in lags), key=lambda each: each[0])
    left_pa, span, above_pa, spanned_pa = found
    if left_pa > DIAGNOSIS.pressure_unfollowed * float(np.mean(np.abs(p[rows] - np.median(p[rows])))):
        return None
    off = _is_another_span(span) or abs(above_pa) > DIAGNOSIS.scale_off * spanned_pa
    return PressureScale(span, above_pa) if off else None


def _fitted(record: Record, pressure_pa: Column, rows: Column, lag_s: float) -> tuple[float, float, float, float]:
    """Return mean |e|, Pa, c, D, Pa, and what m spans, Pa, for a lag, s."""
    u = record.command_pa
    m = command_followed_pa(record.period_s, lag_s, u, u)[rows]  # settled where the record begins
    p, middle_pa = pressure_pa[rows], float(np.median(m))
    beside_pa, w = m - middle_pa, np.ones(rows.size)
    for _ in range(DIAGNOSIS.scale_rounds):
        at_pa, mean_pa = np.average(beside_pa, weights=w), np.average(p, weights=w)
        spread = float(w @ (beside_pa - at_pa) ** 2)
        span = float(w @ ((beside_pa - at_pa) * (p - mean_pa))) / spread if spread else 1.0
        above_pa = float(mean_pa - span * at_pa) - middle_pa
        off_pa = np.abs(p - middle_pa - above_pa - span * beside_pa)
        w = 1.0 / (off_pa + DIAGNOSIS.pressure_none)
    return float(off_pa.mean()), span, above_pa, float(np.ptp(m))


def _is_another_span(span: float) -> bool:
    least = 1.0 - DIAGNOSIS.scale_off
    return not least < span < 1.0 / least


def _units(span: float) -> list[tuple[str, str]]:
    """Return which units read as which others would make a pressure so many times as large."""
    pairs = permutations(UNITS_PA, 2)
    return [(one, other) for one, other in pairs if _is_one(span * UNITS_PA[one] / UNITS_PA[other])]


def _is_one(ratio: float) -> bool:
    return abs(ratio - 1.0) < DIAGNOSIS.units_alike
