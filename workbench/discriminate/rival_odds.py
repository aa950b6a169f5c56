"""Rivals weighed against each other in all recordings so far.

    lambda_i = 1/2 evidence(best, rival i)     log odds, by the likelihood of all recordings and the parameters spent
                                               (`workbench.select.effect_acceptance.evidence_for`)
    odds of the best = 1 / sum exp(-lambda_i)  against all the others together

lambda_i is at most what agreement from event to event allows,

    log (Phi(z_i) / Phi(-z_i)),  z_i = sum d / sqrt(n var d)    d difference of the errors of n events (`block_errors`)

log odds that the better by z_i standard errors is the better (Vuong): no rival is the very valve, and one event that
luck has spoilt must not name one. The best must explain the experiments as it explains the recordings before.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign, exp, inf
from typing import Literal

import numpy as np
from scipy.special import log_ndtr

from config.recording import Recording
from sim.karnopp import Vector
from workbench.data.held_out import Part, join_recordings
from workbench.data.record import ready, require_few_samples, require_fittable
from workbench.discriminate.experiment_design import DesignedExperiment, Terms, design_experiment
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import problem_of, refit
from workbench.fit.threads import on_threads
from workbench.select.block_errors import event_errors_m, event_logs
from workbench.select.effect_acceptance import evidence_for
from workbench.select.selection_thresholds import SELECTION

ODDS = 100.0
"""Of the best against all others, that name it."""
ERROR_QUANTILES = (0.5, 0.75)
"""Quantiles of the errors of events."""
ASKED = 3
"""Rivals that an experiment is designed for, the likeliest: to choose one costs by the square of their number."""


@dataclass(frozen=True, slots=True)
class Weighed:
    """A rival in all recordings so far: its fit, and the errors of its events, l_k, (events,)."""

    fit: Fit
    logs: Vector


def evidence(one: Weighed, other: Weighed) -> float:
    """Return lambda of one rival against another, of either sign."""
    told = 0.5 * evidence_for(one.fit, other.fit)
    z = _standard_errors(other.logs - one.logs)
    return copysign(min(abs(told), agreed(abs(z))), told) if z * told > 0.0 else 0.0


def _standard_errors(d: Vector) -> float:
    """Return the sum of what differs from event to event in its standard errors."""
    total, scatter = float(d.sum()), d.size**0.5 * float(np.std(d))
    return total / scatter if scatter > 0.0 else copysign(inf, total) if total else 0.0


def agreed(z: float) -> float:
    """Return the log odds that what is the better by z standard errors is the better, by a flat prior."""
    return float(log_ndtr(z) - log_ndtr(-z))


class RivalOdds:
    """The rivals in all recordings so far."""

    def __init__(
        self,
        fits: Mapping[str, Fit],
        recordings: tuple[Recording, ...],
        workers: int | None,
        begun: "RivalOdds | None" = None,
    ) -> None:
        self._recordings = recordings
        self._begun = begun or self
        """As it stood before the experiments."""
        whole = join_recordings(recordings)
        require_few_samples(whole)
        self.record = ready(whole)
        require_fittable(self.record)
        self._part = Part(whole, self.record, self.record.valid)
        self._workers = workers
        self.fits = dict(fits)

    @cached_property
    def _all(self) -> dict[str, Weighed]:
        return {name: Weighed(each, event_logs(each, self._part)) for name, each in self.fits.items()}

    @cached_property
    def best(self) -> str:
        """The likeliest: against whom the least is said; of equals the one with the lowest cost."""

        def least_said(name: str) -> tuple[float, float]:
            others = (evidence(self._all[name], each) for other, each in self._all.items() if other != name)
            return min(others, default=0.0), -self.fits[name].cost

        return max(self.fits, key=least_said)

    @cached_property
    def behind(self) -> Mapping[str, float]:
        """By how much each rival is behind the best: lambda of the best against it, at least 0."""
        best = self._all[self.best]
        return {name: max(0.0, evidence(best, each)) if name != self.best else 0.0 for name, each in self._all.items()}

    @property
    def relative(self) -> Mapping[str, float]:
        """The odds of each rival against the best."""
        return {name: exp(-each) for name, each in self.behind.items()}

    @property
    def alive(self) -> list[Fit]:
        """Fits of the rivals that have not lost yet, at least two, likeliest first."""
        ranked = sorted(self.relative.items(), key=lambda each: -each[1])
        return [self.fits[name] for i, (name, odds) in enumerate(ranked) if i < 2 or odds > 1.0 / ODDS]

    @property
    def odds(self) -> float:
        """The odds of the best against all others together."""
        others = sum(self.relative.values()) - 1.0
        return 1.0 / others if others > 0.0 else inf

    @property
    def decided(self) -> Literal["resolved", "unexplained"] | None:
        """What the odds come to; None below `ODDS`."""
        if self.odds < ODDS:
            return None
        return "resolved" if self.explained else "unexplained"

    def experiment(self, terms: Terms) -> DesignedExperiment | None:
        """Return the experiment designed for the likeliest rivals; None if no course stays inside the bounds."""
        return design_experiment(self.alive[:ASKED], self.record, terms, workers=self._workers)

    @property
    def explained(self) -> bool:
        """Whether the best does as well in the experiments as in the recordings before, or as the sensor allows.

        In half of the events, and in three quarters.
        """
        earlier_m = np.quantile(self._begun.errors_m(self.best), ERROR_QUANTILES)
        played_from = sum(map(len, self._begun._recordings))
        now_m = np.quantile(self.errors_m(self.best, played_from), ERROR_QUANTILES)
        floors = np.array([SELECTION.at_floor, SELECTION.rarely_off])
        return bool(np.all(now_m <= floors * np.maximum(self.record.floor_or_scale_m, earlier_m)))

    def errors_m(self, name: str, first: int = 0) -> Vector:
        """Return the rms errors of a rival's events from a row on, m, (events,)."""
        counted = self._part.counted & (np.arange(len(self.record)) >= first)
        return event_errors_m(self.fits[name], replace(self._part, counted=counted))

    def with_recording(self, recording: Recording) -> "RivalOdds":
        """Return it after another recording: every rival fitted anew to all, from where it was."""
        race = RivalOdds(self.fits, (*self._recordings, recording), self._workers, self._begun)

        def refit_rival(found: Fit) -> Fit:
            return refit(problem_of(found, race.record), found)

        fits = on_threads(refit_rival, tuple(self.fits.values()), self._workers)
        race.fits = dict(zip(self.fits, fits, strict=True))
        return race
