"""Whether a stem that does not follow its set point is held by the packing's friction or by the positioner's dead band.

Both leave small changes of the set point unanswered. Three valves are fitted: one with both, one without the dead band,
one without friction. What is freed is needed if it passes the stricter rule of `effect_acceptance` against the valve
without: it has evidence where it was fitted, by as many samples as are independent, and lowers the error that was held
out.

    no second search came as low        not told
    friction needed, dead band not      the packing
    dead band needed, friction not      the positioner
    the same, but the other may be      at least that one: a few moves do without much that is there
    there, half as large, or what was
    fitted speaks for it
    both needed                         both
    neither needed                      one stands in for the other, or none is there: not told

Where the actuator's pressure was measured, each is asked on its own side of it: friction from the pressure to the stem,
with the positioner out of the path; the dead band from the set point to the stem, with spring and friction kept as they
were found there. What the pressure's noise makes of friction is none: its play, 2 F_c / k_s, must be several times what
is left with friction (`play_of_error`). Where that does not tell, the set point is asked alone.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

from config.results.result import Brief
from config.valve_file import EffectTable, ValveFile
from sim.effect import find_effect
from workbench.data.held_out import Split
from workbench.diagnosis.diagnosis_thresholds import DIAGNOSIS
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.model.search_coordinates import BEHIND_POSITIONER as FREE
from workbench.select.block_errors import block_errors
from workbench.select.effect_acceptance import Gain, gain
from workbench.select.effect_candidates import EvaluatedModel
from workbench.select.selection_thresholds import SELECTION

Cause = Literal["packing", "positioner", "both", "at least packing", "at least positioner", "not told"]
DEAD_BAND = "dead_band_m"
ROUGH = "But the valve with both does not explain the recording: these figures are rough"
NOTHING = Gain(0.0, 0.0, 0.0)


class Worth(NamedTuple):
    """What something is worth, and the held-out rms errors with and without it, m."""

    gain: Gain
    with_m: float
    without_m: float
    at_floor: bool
    """Whether with it nothing is left that is known to be more than the floor; so it is taken where none is known."""


@dataclass(frozen=True, slots=True, repr=False)
class PositionerOrPacking(Brief):
    """What holds the stem, and what each of the two is worth against the valve without it."""

    cause: Cause
    friction: Worth
    dead_band: Worth
    """From the set point, with friction."""
    friction_n: float
    dead_band_m: float
    play_m: float
    """What friction alone leaves unanswered, 2 F_c / k_s."""
    found_twice: bool
    """Whether a second search came as low; its parameters may differ in what the recording does not determine."""
    from_pressure: bool
    """Whether friction was judged from the measured pressure; else that is from the set point, too."""

    @property
    def sentence(self) -> str:
        """Say it."""
        rough = "" if self.dead_band.at_floor or self.cause == "not told" else f". {ROUGH}"
        return f"{self._said}{rough} ({self._held})."

    @property
    def _said(self) -> str:
        """Say it, but for the errors."""
        friction = f"friction that is worth {1e3 * self.play_m:.3g} mm of the spring ({self.friction_n:.3g} N)"
        band = f"a dead band of {1e3 * self.dead_band_m:.3g} mm"
        besides = "holds the stem, too, is not known"
        neither = (
            "either alone explains it"
            if self.dead_band.at_floor
            else "neither is needed, and with both the valve does not explain it"
        )
        if self.cause == "not told" and not self.found_twice:
            return "Whether positioner or packing holds the stem is not known: no second search found as small an error"
        said: dict[Cause, str] = {
            "packing": f"It is the packing, not the positioner: {friction}; no dead band is needed",
            "positioner": f"It is the positioner, not the packing: {band}; no friction is needed",
            "both": f"It is both, packing and positioner: {friction}, and {band}",
            "at least packing": f"It is the packing: {friction}; whether a dead band {besides}",
            "at least positioner": f"It is the positioner: {band}; whether friction {besides}",
            "not told": f"The recording cannot tell the positioner's dead band from the packing's friction: {neither}. "
            "Measure the actuator pressure: with a dead band it stays constant, with friction it rises until the stem "
            "jumps",
        }
        return said[self.cause]

    @property
    def _held(self) -> str:
        """Say the held-out errors."""
        without, both = f"{1e3 * self.friction.without_m:.3g} without", f"{1e3 * self.dead_band.with_m:.3g} mm with"
        band = f"{1e3 * self.dead_band.without_m:.3g} without dead band"
        if not self.from_pressure:
            return f"held-out errors: {both} friction and dead band, {band}, {without} friction"
        return (
            f"held-out errors: from the measured pressure {1e3 * self.friction.with_m:.3g} mm with friction, "
            f"{without}; from the set point {both} dead band too, {band}"
        )


def positioner_or_packing(
    split: Split, both: EvaluatedModel, *, workers: int, progress: Callable[[float], None] | None = None
) -> PositionerOrPacking:
    """Fit the valve without either, and judge what each is worth.

    Args:
        split: a recording of set point and travel.
        both: the fitted valve, with its positioner.
        workers: threads.
        progress: called with the fraction done.
    """
    tell = progress or (lambda _: None)
    refit = partial(fit, split.train.recording, workers=workers)
    if all(each.record.pressure_pa is not None for each in (split.train, split.test)):
        stem = refit(both.fit.valve, from_pressure=True)
        banded = refit(stem.valve, free=[each for each in both.fit.parameters if each not in FREE], progress=tell)
        found = _asked(split, stem, banded, refit, tell)
        if found.cause != "not told":
            return found
    return _asked(split, both.fit, both.fit, refit, tell)


def _asked(
    split: Split, stem: Fit, banded: Fit, refit: Callable[..., Fit], tell: Callable[[float], None]
) -> PositionerOrPacking:
    """Hold the valve against itself without friction, and without the dead band.

    Args:
        split: the recording.
        stem: with friction, fitted from the set point or from the measured pressure.
        banded: with the dead band, from the set point; the same if that tells.
        refit: fits a valve to what is fitted.
        tell: called with the fraction done.
    """
    positioner = positioner_of(banded.valve).name
    dead_band = f"{positioner}.{DEAD_BAND}"

    def otherwise(found: Fit, valve: ValveFile, kept: Collection[str], done: float) -> Fit:
        free = [each for each in found.parameters if each not in kept]
        return refit(valve, from_pressure=found.from_pressure, free=free, progress=lambda part: tell(done + 0.3 * part))

    def with_friction(n: float, done: float) -> Fit:
        return otherwise(stem, _with_friction(stem.valve, n), FREE, done)

    def with_dead_band(m: float, done: float) -> Fit:
        return otherwise(banded, _with(banded.valve, positioner, {DEAD_BAND: m}), (dead_band,), done)

    valve, band_m = stem.valve.valve, banded.parameters[dead_band].value
    n_per_m = 0.5 * valve.spring_n_per_m
    play_m = valve.coulomb_n / n_per_m if n_per_m else 0.0
    friction = _worth(with_friction(DIAGNOSIS.friction_left * valve.coulomb_n, 0.0), stem, split)
    band = _worth(with_dead_band(0.0, 0.3), banded, split)
    if stem.from_pressure and play_m < DIAGNOSIS.play_of_error * friction.with_m:
        friction = friction._replace(gain=NOTHING)
    found = cause(friction.gain, band.gain) if banded.trusted else "not told"
    # What was fitted may speak for the other, though what was held out does not: then it is not said to be none.
    share = DIAGNOSIS.other_cause
    if found == "packing" and (
        band.gain.bic > SELECTION.least_evidence or not _excluded(with_dead_band(share * play_m, 0.6), banded, split)
    ):
        found = "at least packing"
    if found == "positioner" and (
        friction.gain.bic > SELECTION.least_evidence
        or not _excluded(with_friction(share * band_m * n_per_m, 0.6), stem, split)
    ):
        found = "at least positioner"
    return PositionerOrPacking(
        found, friction, band, valve.coulomb_n, band_m, play_m, banded.trusted, stem.from_pressure
    )


def _excluded(other: Fit, found: Fit, split: Split) -> bool:
    """Whether the recording speaks against another valve, by as many of its samples as are independent."""
    return _worth(other, found, split).gain.bic > SELECTION.least_evidence


def _worth(bare: Fit, full: Fit, split: Split) -> Worth:
    without, there = block_errors(bare, split), block_errors(full, split)
    at_floor = split.floor_m is None or there.at_floor(split.floor_m)
    return Worth(gain(bare, full, without, there), there.test_rmse_m, without.test_rmse_m, at_floor)


def cause(friction: Gain, dead_band: Gain) -> Cause:
    """Return what the stem is held by, from what each is worth against the valve without it."""
    needs_friction, needs_band = (not each.rejection_reason for each in (friction, dead_band))
    if needs_friction and needs_band:
        return "both"
    if needs_friction:
        return "packing"
    return "positioner" if needs_band else "not told"


def positioner_of(valve: ValveFile) -> EffectTable:
    """Return the table of the effect that obeys a set point.

    Raises:
        StopIteration: there is none.
    """
    return next(each for each in valve.effect if find_effect(each.name, "valve file").by_setpoint)


def _with(valve: ValveFile, name: str, changes: Mapping[str, float]) -> ValveFile:
    tables = [
        EffectTable.model_validate({"name": each.name, **each.parameters, **(changes if each.name == name else {})})
        for each in valve.effect
    ]
    return ValveFile(valve=valve.valve, effect=tuple(tables))


def _with_friction(valve: ValveFile, coulomb_n: float) -> ValveFile:
    base = valve.valve
    static_n = coulomb_n * (base.static_n / base.coulomb_n if base.coulomb_n else 1.0)
    return valve.model_copy(
        update={"valve": base.model_copy(update={"coulomb_n": coulomb_n, "static_n": static_n})},
    )
