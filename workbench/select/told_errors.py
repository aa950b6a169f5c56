"""How far a model is off on what was held out, told when the stem moves: what static friction leaves open is no error.

Static friction is known to an interval, between the loads that rests bore and those that broke the stem loose. A free
run must choose one value of it. Where slips are few, one held-out slip is made early or late by that choice, and all
that follows is off until the next. So the simulation is told the moves, which the record shows
(`workbench.fit.likelihood`): the valve is as it was fitted, and only the onsets of its moves are found. The choice is
open as long as one value does for all break-aways, fitted and held out:

    max_k L_bears,k - min_k L_breaks,k <= `SCATTER` F_c

An onset is known to a sample: what a rest bore is taken a sample sooner, what broke it loose a sample later. Where
samples lie farther apart than slides last, and behind a positioner, no onset is seen, and nobody is told.
"""

from dataclasses import dataclass

from config.recording import Column
from sim.composition import Composition
from workbench.data.held_out import Part, Split, residual_m
from workbench.fit.fit_result import Fit
from workbench.fit.likelihood import Likelihood
from workbench.fit.onsets import with_onsets
from workbench.model.told_run import told_moves

SCATTER = 0.1
"""Of F_c: break-aways of a packing scatter by some 4 % of static friction (`workbench.blind.trial`); two deviations."""


@dataclass(frozen=True, slots=True)
class _Told:
    """A part as it is told: what the model is off by, m, (n,), and L of each move, N."""

    error_m: Column
    bears_n: Column
    breaks_n: Column


def told_error_m(fit: Fit, split: Split) -> Column | None:
    """Return simulated less measured position of what was held out, told when the stem moves, m, (n,).

    None where no onset is seen, or no static friction does for the fitted and the held-out break-aways.
    """
    fitted, held_out = (_told(fit, part) for part in (split.train, split.test))
    if fitted is None or held_out is None:
        return None
    most_n = max(float(each.bears_n.max()) for each in (fitted, held_out))
    least_n = min(float(each.breaks_n.min()) for each in (fitted, held_out))
    return held_out.error_m if most_n - least_n <= SCATTER * fit.valve.valve.coulomb_n else None


def _told(fit: Fit, part: Part) -> _Told | None:
    by, record = fit.by.of(part.record, fit.valve.valve), part.record
    period_s = record.period_s
    told = told_moves(record)
    if by.slow or not told or (record.by_setpoint and not fit.from_pressure):
        return None
    composition = Composition.from_file(fit.valve)
    like = Likelihood(composition, record, told, by=by, from_pressure=fit.from_pressure)
    onsets_s, _ = with_onsets(like, composition.theta)
    if not like.broken.size:
        return None
    sooner, there, later = (like.run.run(composition.theta, onsets_s + by_s) for by_s in (-period_s, 0.0, period_s))
    return _Told(residual_m(part, there.indicated_m), sooner.bears_n[like.broken], later.breaks_n[like.broken])
