"""Whether a stem that does not follow its set point is held by the packing's friction or by the positioner's dead band.

Both leave small changes of the set point unanswered. Three valves are fitted: one with both, one without the dead band,
one without friction. What is freed is needed if it passes the stricter rule of `effect_acceptance` against the valve
without: it has evidence where it was fitted, by as many samples as are independent, and lowers the error that was held
out.

    no second search came as low        not told
    friction needed, dead band not      the packing
    dead band needed, friction not      the positioner
    both needed                         both
    neither needed                      one stands in for the other, or none is there: not told
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Literal

from config.results.result import Brief
from config.valve_file import EffectTable, ValveFile
from sim.effect import find_effect
from workbench.data.held_out import Split
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.fit.setpoint_starts import FREE
from workbench.select.block_errors import block_errors
from workbench.select.effect_acceptance import Gain, gain
from workbench.select.effect_candidates import EvaluatedModel

Cause = Literal["packing", "positioner", "both", "not told"]
DEAD_BAND = "dead_band_m"
AS_LOW = 1.25
"""Factor on the cost of the best search."""
NO_FRICTION = 1e-3
"""Of the fitted one: what a stem without friction has left, by which it comes to rest."""


@dataclass(frozen=True, slots=True, repr=False)
class PositionerOrPacking(Brief):
    """What holds the stem, and what each of the two is worth against the valve without it."""

    cause: Cause
    friction: Gain
    dead_band: Gain
    without_friction_m: float
    without_dead_band_m: float
    with_both_m: float
    """Held-out rms errors."""
    friction_n: float
    dead_band_m: float
    play_m: float
    """What friction alone leaves unanswered, 2 F_c / k_s."""
    found_twice: bool
    """Whether a second search came as low."""

    @property
    def sentence(self) -> str:
        """Say it."""
        held = (
            f"held-out errors: {1e3 * self.with_both_m:.3g} mm with friction and dead band, "
            f"{1e3 * self.without_dead_band_m:.3g} without dead band, {1e3 * self.without_friction_m:.3g} without "
            "friction"
        )
        friction = f"friction that is worth {1e3 * self.play_m:.3g} mm of the spring ({self.friction_n:.3g} N)"
        band = f"a dead band of {1e3 * self.dead_band_m:.3g} mm"
        match self.cause:
            case "packing":
                return f"It is the packing, not the positioner: {friction}; no dead band is needed ({held})."
            case "positioner":
                return f"It is the positioner, not the packing: {band}; no friction is needed ({held})."
            case "both":
                return f"It is both, packing and positioner: {friction}, and {band} ({held})."
            case "not told" if not self.found_twice:
                return (
                    f"Whether positioner or packing holds the stem is not told: no second search came as low ({held})."
                )
            case "not told":
                return (
                    "This recording does not tell the positioner's dead band from the packing's friction: either does "
                    f"without the other ({held}). Measured actuator pressure would: a dead band leaves it still, "
                    "friction lets it rise until the stem jumps."
                )


def positioner_or_packing(
    split: Split, both: EvaluatedModel, *, seed: int, workers: int, progress: Callable[[float], None] | None = None
) -> PositionerOrPacking:
    """Fit the valve without either, and judge what each is worth.

    Args:
        split: a recording of set point and travel.
        both: the fitted valve, with its positioner.
        seed: of the searches.
        workers: threads.
        progress: called with the fraction done.
    """
    tell = progress or (lambda _: None)
    name = positioner_of(both.fit.valve).name
    free = [each for each in both.fit.parameters if each != f"{name}.{DEAD_BAND}"]
    refit = partial(fit, split.train.recording, seed=seed, workers=workers, profile=False)
    no_band = refit(_with(both.fit.valve, name, {DEAD_BAND: 0.0}), free=free, progress=lambda done: tell(0.5 * done))
    frictionless = refit(
        _frictionless(both.fit.valve),
        free=[each for each in both.fit.parameters if each not in FREE],
        progress=lambda done: tell(0.5 + 0.5 * done),
    )
    bare = {each: block_errors(found, split) for each, found in (("band", no_band), ("friction", frictionless))}
    friction = gain(frictionless, both.fit, bare["friction"], both.errors)
    dead_band = gain(no_band, both.fit, bare["band"], both.errors)
    return PositionerOrPacking(
        cause(friction, dead_band) if _found_twice(both.fit) else "not told",
        friction,
        dead_band,
        bare["friction"].test_rmse_m,
        bare["band"].test_rmse_m,
        both.errors.test_rmse_m,
        _value(both.fit, "coulomb_n"),
        _value(both.fit, f"{name}.{DEAD_BAND}"),
        2.0 * _value(both.fit, "coulomb_n") / (both.fit.valve.valve.spring_n_per_m or inf),
        _found_twice(both.fit),
    )


def cause(friction: Gain, dead_band: Gain) -> Cause:
    """Return what the stem is held by, from what each is worth against the valve without it."""
    needs_friction, needs_band = (not each.rejection_reason(at_floor=True) for each in (friction, dead_band))
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


def _frictionless(valve: ValveFile) -> ValveFile:
    left_n = NO_FRICTION * valve.valve.coulomb_n
    return valve.model_copy(update={"valve": valve.valve.model_copy(update={"coulomb_n": left_n, "static_n": left_n})})


def _found_twice(found: Fit) -> bool:
    """Whether a second search came as low; its parameters may differ in what the recording does not determine."""
    return len(found.starts) > 1 and found.starts[1].cost <= AS_LOW * found.starts[0].cost


def _value(found: Fit, name: str) -> float:
    return found.parameters[name].value
