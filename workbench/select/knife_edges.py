"""Slips on held-out data that a model mistimes: knife edges, each by its time.

Static and sliding friction are only known to an interval. A held-out slip that comes or stays away within it leaves an
error up to the next slip, whatever the model, and with it an rms that says nothing. So each stretch of a large error is
asked whether the same model with F_s or F_c changed a little, or with any F_s that what was fitted allows, would not
make it:

    |r| > 5 floors, gaps of less than 0.2 s closed                        a stretch
    rms over it, changed, <= max(1.75 floors, a fifth of what it was)     a knife edge
    rms over what was fitted, changed, <= 1.75 floors                     allowed; asked of changes above 2 %

Of few slips, static friction is known to a tenth of itself, or to a half: any value between those of the slips that
came and those that stayed away does as well.

An error that no such change takes away is no knife edge. Nor are many: where these stretches hold more than a tenth of
the slips it is the model's, unless one change puts all of them right, or leaves of all that was held out no more than
1.75 floors (a lone sample far off may stay), and what was fitted allows it. A friction that what was fitted refutes is
another friction, and no narrow miss.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from config.recording import Column
from config.results.result import Brief
from config.valve_file import ValveFile
from sim.composition import Composition
from workbench.data.held_out import Part, residual_m
from workbench.data.motion import slips
from workbench.model.free_run import FreeRun

LARGE = 5.0
"""Floors from which an error is large."""
AT_MOST, FELL = 1.75, 0.2
"""Floors that may be left; or of the error that there was."""
CLOSED_S = 0.2
CHANGES = (0.001, 0.0025, 0.005, 0.01, 0.02)
"""Of either friction: an interval that any recording leaves."""
WIDE_CHANGES = (0.03, 0.04, 0.05, 0.065, 0.08, 0.1, 0.125, 0.15, 0.175, 0.2, 0.25, 0.3, 0.4, 0.5)
"""Of static friction, if what was fitted allows it."""
MOST_SHARE = 0.1
"""Of the slips held out; one may always be, with the one that ends its stretch."""


@dataclass(frozen=True, slots=True, repr=False)
class KnifeEdge(Brief):
    """A stretch of held-out error that a small change of friction takes away."""

    from_s: float
    to_s: float
    """On the recording's clock."""
    parameter: str
    change: float
    """By what part the parameter is changed."""

    @property
    def sentence(self) -> str:
        """Say so."""
        name = {"static_n": "static", "coulomb_n": "sliding"}[self.parameter]
        narrowly, allowed = (
            ("narrowly ", "") if abs(self.change) <= CHANGES[-1] else ("", ", allowed by what was fitted,")
        )
        return (
            f"a slip is {narrowly}mistimed from {self.from_s:.6g} to {self.to_s:.6g} s: {name} friction "
            f"{100 * abs(self.change):.3g} % {'higher' if self.change > 0 else 'lower'}{allowed} puts it right"
        )


def knife_edges(
    valve: ValveFile,
    fitted: Part,
    part: Part,
    error_m: Column,
    floor_m: float,
    *,
    from_pressure: bool,
) -> tuple[KnifeEdge, ...]:
    """Return the stretches of a held-out error that are knife edges, in order; none if they are too many.

    Args:
        valve: as fitted.
        fitted: what it was fitted to.
        part: what was held out.
        error_m: the fit's error on it, simulated less measured, m, (n,), NaN where a sample does not count.
        floor_m: what no model undercuts.
        from_pressure: whether the fit runs from the measured pressure.
    """
    stretches = list(_stretches(part, error_m, LARGE * floor_m))
    few = _few(stretches, _slips(part))
    found: dict[tuple[int, int], KnifeEdge] = {}
    time_s = part.record.time_s
    for name, change in _changes():
        if few and len(found) == len(stretches):
            break
        changed = _changed(valve, name, change)
        if changed is None:
            continue
        other_m = _error_m(changed, part, from_pressure)
        right = {
            (first, end): KnifeEdge(float(time_s[first]), float(time_s[end - 1]), name, change)
            for first, end in stretches
            if rms(other_m[first:end]) <= max(AT_MOST * floor_m, FELL * rms(error_m[first:end]))
        }
        new = right.keys() - found
        all_right = len(right) == len(stretches) or rms(other_m) <= AT_MOST * floor_m
        if not (new or all_right):
            continue
        needs_leave = all_right or abs(change) > CHANGES[-1]
        allowed = needs_leave and rms(_error_m(changed, fitted, from_pressure)) <= AT_MOST * floor_m
        if all_right and allowed:
            return tuple(right.values())
        if allowed or abs(change) <= CHANGES[-1]:
            found = right | found
    return tuple(found[each] for each in sorted(found)) if _few(found, _slips(part)) else ()


def _few(stretches: Collection[tuple[int, int]], slip_rows: Sequence[int]) -> bool:
    """Whether stretches hold few of the slips, given by the rows where these begin; the last only ends its stretch."""
    held = [sum(first <= row < end for row in slip_rows) for first, end in stretches]
    return sum(max(1, each - 1) for each in held) <= max(1, int(MOST_SHARE * len(slip_rows)))


def error_without(time_s: Column, error_m: Column, edges: tuple[KnifeEdge, ...]) -> Column:
    """Return an error, m, (n,), that does not count, NaN, in the stretches of knife edges."""
    kept = np.isfinite(error_m)
    for each in edges:
        kept &= (time_s < each.from_s) | (time_s > each.to_s)
    return np.where(kept, error_m, np.nan)


def _changes() -> Iterator[tuple[str, float]]:
    """Yield what is changed and by what part, the smallest changes first."""
    for size in CHANGES:
        for name in ("static_n", "coulomb_n"):
            yield from ((name, size), (name, -size))
    for size in WIDE_CHANGES:
        yield from (("static_n", size), ("static_n", -size))


def _changed(valve: ValveFile, name: str, change: float) -> ValveFile | None:
    """Return a valve with a parameter changed; None where static friction would be less than sliding friction."""
    base = valve.valve
    changed = base.model_copy(update={name: (1.0 + change) * getattr(base, name)})
    return None if changed.static_n < changed.coulomb_n else valve.model_copy(update={"valve": changed})


def _error_m(valve: ValveFile, part: Part, from_pressure: bool) -> Column:
    composition = Composition.from_file(valve)
    run = FreeRun(composition, part.record, from_pressure=from_pressure)
    return residual_m(part, run.position_m(composition.theta))


def _stretches(part: Part, error_m: Column, large_m: float) -> Iterator[tuple[int, int]]:
    """Yield the rows, half open, over which an error is large."""
    time_s = part.record.time_s
    rows = np.flatnonzero(np.abs(np.nan_to_num(error_m)) > large_m)
    if not rows.size:
        return
    within_s = max(CLOSED_S, 2.5 * part.record.period_s)
    breaks = np.flatnonzero(np.abs(np.diff(time_s[rows])) > within_s)
    for first, last in zip([0, *(breaks + 1).tolist()], [*breaks.tolist(), rows.size - 1], strict=True):
        yield int(rows[first]), int(rows[last]) + 1


def _slips(part: Part) -> list[int]:
    """Return the rows at which the slips that count begin."""
    record = part.record
    counted = np.where(part.counted, record.position_m, np.nan)
    return [first + each.first for first, end in record.segments for each in slips(counted[first:end], record.scale_m)]


def rms(values: Column) -> float:
    """Return the rms of what is a number; 0 of nothing."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
