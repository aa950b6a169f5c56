"""What a fieldbus and a real valve add to white noise, row by row: our errors as multiples of the bound.

The motion is that of the noise table, sampled at 1 ms. Hardships, alone and together:

    uneven      samples taken up to 10 % of the period early or late, and their time stamps say so
    stamps      samples taken evenly, their time stamps up to 10 % of the period off
    lost        1 % of the samples missing
    Stribeck    v_s ten times the seed's: the drop from F_s to F_c lasts over the first 2.5 mm/s
    no rest     the record begins at the jump: where the stem rested is not known
    late        the record begins 5 ms after it: neither where the stem was nor how fast it went is known

Each is held against the bound of its own samples; where the beginning is not known, x_0, or x_0 and v_0, are unknowns
of the bound too. No estimator can be better than that, and it is the clean bound times the factor printed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.paper.noise_table import NAMES, SampledMotion, bound, motion_at, true_values
from config.valve_file import ValveFile
from positioner.estimation.array import Array
from positioner.estimation.batch import BatchSettings, identify

PERIOD_S, REST, ROWS = 1e-3, 100, 800
JITTER = 0.1
LOST = 0.01
STRIBECK = 10.0
LATE = 5
"""Samples after the jump at which a late record begins."""


@dataclass(frozen=True, slots=True)
class Hardship:
    """One row; shares of the true values, (6,) each, in the order of `NAMES`.

    Attributes:
        bound: mean over the runs' own bounds.
        clean: the bound without hardship, start known.
        rms: of the errors.
        covered: how often the truth lies within one reported standard deviation.
        valid: how often the value is valid.
    """

    name: str
    noise_pu: float
    bound: Array
    clean: Array
    rms: Array
    covered: Array
    valid: Array


@dataclass(frozen=True, slots=True)
class _Kind:
    name: str
    uneven: bool = False
    stamps: bool = False
    lost: bool = False
    stribeck: bool = False
    first: int = 0
    known: int = 2


KINDS = (
    _Kind("none"),
    _Kind("uneven", uneven=True),
    _Kind("stamps", stamps=True),
    _Kind("lost", lost=True),
    _Kind("Stribeck", stribeck=True),
    _Kind("no rest", first=REST, known=1),
    _Kind("late", first=REST + LATE, known=0),
    _Kind("uneven, lost, Stribeck", uneven=True, lost=True, stribeck=True),
    _Kind("and no rest", uneven=True, lost=True, stribeck=True, first=REST, known=1),
)


def hardships(file: ValveFile, noise_pu: float, seeds: int) -> Iterator[Hardship]:
    """Yield the rows at one noise."""
    clean = bound(file, motion_at(file, _even_s(), REST), noise_pu * file.valve.stroke_m)
    true = true_values(file)
    for kind in KINDS:
        make = _maker(file, kind)
        errors, within, valid, bounds = [], [], [], []
        for seed in range(seeds):
            rng = np.random.default_rng(seed)
            noise_m = noise_pu * file.valve.stroke_m
            moved = make(rng)
            measured = moved.position_m + rng.normal(0, noise_m, len(moved.position_m))
            stamps_s = moved.time_s
            if kind.stamps:
                stamps_s = stamps_s + PERIOD_S * JITTER * rng.uniform(-1, 1, len(stamps_s))
            found = identify(stamps_s, measured, moved.pressure_pa, BatchSettings(pressure_held=True)).estimates
            each = [getattr(found, name) for name in NAMES]
            errors.append([one.value / at - 1 for one, at in zip(each, true, strict=True)])
            within.append([abs(one.value - at) < one.std for one, at in zip(each, true, strict=True)])
            valid.append([one.valid for one in each])
            bounds.append(bound(file, moved, noise_m))
        off = np.array(errors)
        yield Hardship(
            name=kind.name,
            noise_pu=noise_pu,
            bound=np.mean(bounds, axis=0),
            clean=clean,
            rms=np.sqrt((off**2).mean(axis=0)),
            covered=np.mean(within, axis=0),
            valid=np.mean(valid, axis=0),
        )


def _even_s() -> Array:
    return PERIOD_S * np.arange(-REST, ROWS + 1, dtype=np.float64)


def _maker(file: ValveFile, kind: _Kind) -> Callable[[np.random.Generator], SampledMotion]:
    """Return what gives the motion of a run, without noise; the same one where nothing of it is random."""
    if kind.stribeck:
        slower = file.valve.stribeck_velocity_m_per_s * STRIBECK
        file = file.model_copy(update={"valve": file.valve.model_copy(update={"stribeck_velocity_m_per_s": slower})})

    def moved(rng: np.random.Generator | None) -> SampledMotion:
        time_s = _even_s()
        if rng is not None and kind.uneven:
            time_s += PERIOD_S * JITTER * rng.uniform(-1, 1, len(time_s))
        whole = motion_at(file, time_s, REST)
        keep = np.ones(len(time_s), dtype=np.bool_)
        if rng is not None and kind.lost:
            keep = rng.uniform(size=len(time_s)) >= LOST
            keep[kind.first] = True
        keep[: kind.first] = False
        start = max(kind.first, REST)
        return SampledMotion(
            time_s=whole.time_s[keep],
            position_m=whole.position_m[keep],
            pressure_pa=whole.pressure_pa[keep],
            start=int(np.count_nonzero(keep[:start])),
            velocity_m_per_s=whole.velocity_m_per_s[keep],
            known=kind.known,
        )

    if kind.uneven or kind.lost:
        return moved
    steady = moved(None)
    return lambda _: steady


def lines(rows: list[Hardship]) -> list[str]:
    """Return the table for people."""
    said = [
        "hardships at 1 ms: rms of errors as multiples of the bound of the same samples; that bound as multiples of",
        "the one without hardship, start known; how often the truth is within one reported deviation; how often valid",
        f"{'noise p.u.':11}{'hardship':24}{'':10}" + "".join(f"{name:>10}" for name in NAMES),
    ]
    for each in rows:
        table = (
            ("rms", [f"{value:.2f}" for value in each.rms / each.bound]),
            ("bound", [f"{value:.2f}" for value in each.bound / each.clean]),
            ("in 68 %", [f"{100 * value:.0f} %" for value in each.covered]),
            ("valid", [f"{100 * value:.0f} %" for value in each.valid]),
        )
        for number, (title, row) in enumerate(table):
            head = f"{each.noise_pu:<11.2g}{each.name:24}" if number == 0 else ""
            said.append(f"{head:35}{title:10}" + "".join(f"{one:>10}" for one in row))
    return said
