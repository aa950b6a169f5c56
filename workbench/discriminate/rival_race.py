"""Rivals weighed against each other in all recordings so far.

    lambda_i = n/2 log(C_i / C) + (k_i - k)/2 log n     log odds of the best against rival i; C cost, k parameters
    n = N^2 var(c) / sum_s (sum of c - mean c in s)^2   independent ones of N samples: c loss of the best, sample by
                                                        sample, s a slip and the rest that follows
    odds of the best = 1 / sum exp(-lambda_i)           against all the others together

So the noise is what the best itself scatters by: where break-away jitters, a slip that luck has mistimed spoils all
until the next, however long that is, and counts once. Besides, lambda_i is at most what agreement allows,

    log (Phi(z_i) / Phi(-z_i))                          log odds that the better by z_i standard errors is the better

where the errors of the two, slip by slip, differ by z_i standard errors (`block_errors`), or their costs by fewer: a
few slips that luck has mistimed for one of them make much of the cost, where all else is at the noise.

Where the best leaves nothing but the sensor's noise in any of B stretches, luck has mistimed no slip of it, and every
stretch tells what it tells; but a mistimed slip, which spoils two of them at most, no more than an accident that has
not happened in B stretches:

    lambda_i = sum of n/2 (C_i,b - C_b) / C, each within +-log(1 + B) / 2, + (k_i - k)/2 log n

What slips say (`slip_evidence`) is weighed beside the run: where both speak for the same rival the stronger counts, for
they come from the same samples; where they disagree the one takes from the other.

    lambda = the stronger of lambda_run and lambda_slips, or their sum if they disagree
    lambda_slips = l - l_i + (k_i - k)/2 log N_slips, at most what agreement allows    z = sum d / sqrt(N_slips var d)

d is the difference from slip to slip, z Vuong's statistic: no rival is the very valve, and what many slips make of a
small misfit that both have must not name one. If one is, z^2 is half of l - l_i.

Nothing is named by a search that failed: rivals that have lost are searched anew from many starts before the best one
is named, and the best must explain the experiments as it explains the recordings before: by the run, or, where luck
mistimes more slips of an experiment than of those, by where its slides land and what begins them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate, pairwise
from math import copysign, exp, inf, log
from typing import Any, Literal

import numpy as np
from scipy.special import log_expit, log_ndtr, ndtri_exp, stdtrit

from config.recording import Recording
from config.valve_file import EffectTable, ValveFile
from sim.composition import Composition
from sim.karnopp import Vector
from workbench.data.held_out import joined
from workbench.data.record import ready, require_few_samples, require_fittable
from workbench.discriminate.experiment_design import DesignedExperiment, Terms, designed
from workbench.discriminate.slip_evidence import FREEDOM, Slips, needed_m, slips, slips_off
from workbench.discriminate.slip_promise import promised_by_slips
from workbench.fit.descent import MIDDLING, descended, settled
from workbench.fit.fit_result import ELSEWHERE, Fit
from workbench.fit.fitting import fit
from workbench.fit.landings import FEWEST, rests
from workbench.fit.objective import FINAL, SimulationError, softs
from workbench.fit.threads import on_threads
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters
from workbench.select.block_errors import (
    NEGLIGIBLE,
    RARELY_OFF,
    block_logs,
    relative_error_reduction,
)
from workbench.select.experiment import REST_S

ODDS = 100.0
"""Of the best against all others, that name it."""
EXPLAINED = (0.5, 0.75)
"""Quantiles of the errors of blocks, landings and break-aways."""
BY_CHANCE = stdtrit(FREEDOM, 0.5 + 0.5 * np.array(EXPLAINED))
"""Of what scatters as `slip_evidence` has it, such quantiles of its distance, in scatters."""
ASKED = 3
"""Rivals that an experiment is designed for, the likeliest: to choose one costs by the square of their number."""
TINY = np.finfo(float).tiny
STRETCH_S = 2.0
"""Longer than an error lasts that begins with a mistimed slip, at the pace of an experiment's moves."""


@dataclass(frozen=True, slots=True)
class Weighed:
    """A rival in all recordings so far: its fit, log rms of its error slip by slip, what is independent, its slips."""

    fit: Fit
    logs: Vector
    share: float
    slips: Slips | None = None
    stretches: Vector = field(default_factory=lambda: np.empty(0))
    """C_b, (stretches,)."""
    steady: bool = False
    """Whether it leaves no more than the sensor's noise in any of them."""
    costs: Vector = field(default_factory=lambda: np.empty(0))
    """Slip by slip, as `logs`."""


def log_odds(best: Weighed, rival: Weighed) -> float:
    """Return lambda_run of the best against a rival: 0 where nothing speaks against it."""
    n = best.share * best.fit.count
    price = 0.5 * (len(rival.fit.parameters) - len(best.fit.parameters)) * log(max(n, 1.0))
    if best.steady:
        told = 0.5 * n * (rival.stretches - best.stretches) / max(best.stretches.sum(), TINY)
        most = 0.5 * log(1.0 + told.size)
        return max(0.0, float(np.clip(told, -most, most).sum()) + price)
    ratio = log(max(rival.fit.cost, TINY) / max(best.fit.cost, TINY))
    _, z = relative_error_reduction(rival.logs, best.logs)
    if best.costs.size:
        z = min(z, _standard_errors(rival.costs - best.costs))
    return max(0.0, min(0.5 * n * ratio + price, agreed(max(0.0, z))))


def slip_odds(one: Weighed, other: Weighed) -> float:
    """Return lambda_slips of one rival against another, of either sign; 0 where slips do not tell of both."""
    if one.slips is None or other.slips is None:
        return 0.0
    price = 0.5 * (len(other.fit.parameters) - len(one.fit.parameters)) * log(one.slips.count)
    told = one.slips.log_likelihood - other.slips.log_likelihood + price
    z = _standard_errors(one.slips.logs - other.slips.logs)
    return copysign(min(abs(told), agreed(abs(z))), told) if z * told > 0.0 else 0.0


def _standard_errors(d: Vector) -> float:
    """Return the sum of what differs from slip to slip in its standard errors (Vuong)."""
    total, scatter = float(d.sum()), d.size**0.5 * float(np.std(d))
    return total / scatter if scatter > TINY else copysign(inf, total) if total else 0.0


def agreed(z: float) -> float:
    """Return the log odds that what is the better by z standard errors is the better, by a flat prior."""
    return float(log_ndtr(z) - log_ndtr(-z))


def evidence(one: Weighed, other: Weighed) -> float:
    """Return lambda of one rival against another, of either sign."""
    by_run, by_slips = log_odds(one, other) - log_odds(other, one), slip_odds(one, other)
    return by_run + by_slips if by_run * by_slips < 0.0 else max(by_run, by_slips, key=abs)


class RivalRace:
    """The rivals in all recordings so far."""

    def __init__(
        self,
        fits: Mapping[str, Fit],
        recordings: tuple[Recording, ...],
        seed: int,
        workers: int | None,
        begun: "RivalRace | None" = None,
    ) -> None:
        self._recordings = recordings
        self._begun = begun or self
        """As it stood before the experiments."""
        self._whole = joined(recordings)
        require_few_samples(self._whole)
        self.record = ready(self._whole)
        require_fittable(self.record)
        self._seed = seed
        self._workers = workers
        self.fits = dict(fits)
        self._sigma_m = self.record.scale_m or TINY

    @property
    def _first_rows(self) -> list[int]:
        return list(accumulate(map(len, self._recordings[:-1]), initial=0))

    @cached_property
    def _all(self) -> dict[str, Weighed]:
        fits = list(self.fits.values())
        least_m = max(on_threads(lambda each: needed_m(each, self.record, self._first_rows), fits, self._workers))
        weighed = on_threads(lambda each: self._weighed(each, least_m), fits, self._workers)
        return dict(zip(self.fits, weighed, strict=True))

    @cached_property
    def best(self) -> str:
        """The likeliest: against whom the least is said; of equals by cost and number of parameters."""

        def least_said(name: str) -> tuple[float, float]:
            others = (evidence(self._all[name], each) for other, each in self._all.items() if other != name)
            return min(others, default=0.0), -_criterion(self.fits[name])

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
        return [self.fits[name] for name in self._alive]

    @property
    def _alive(self) -> list[str]:
        ranked = sorted(self.relative.items(), key=lambda each: -each[1])
        return [name for i, (name, odds) in enumerate(ranked) if i < 2 or odds > 1.0 / ODDS]

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

    def promised(self, chosen: DesignedExperiment) -> float:
        """Return by how much an experiment is to raise the log odds."""
        samples = (chosen.course.duration_s - REST_S) / self.record.period_s
        by_run = 0.5 * self._all[self.best].share * samples * log(max(1.0, chosen.separation))
        return max(by_run, chosen.by_slips)

    def expected(self, chosen: DesignedExperiment) -> float:
        """Return by how much log odds are to rise that say no more than slips agree: z^2 by half of what is promised.

        Differences of a mean m^2/2 and a deviation m, as they are if a rival is the valve, add to l = N m^2/2 and
        z = sqrt(l/2).
        """
        lambda_ = sorted(self.behind.values())[1]
        z = float(ndtri_exp(log_expit(lambda_)))
        return agreed((z**2 + 0.5 * self.promised(chosen)) ** 0.5) - lambda_

    def told_since(self, before: "RivalRace") -> float:
        """Return by how much log odds of the best before have changed, against whom, of those left, they did most."""
        of_best = self.behind[before.best]
        return max((self.behind[name] - of_best - before.behind[name] for name in before._alive), key=abs)

    def promised_by(self, chosen: DesignedExperiment, moves: int) -> float:
        """Return by how much an experiment is to raise the log odds, repeated for so many moves."""
        return self.promised(chosen) * max(1.0, moves / max(1, chosen.course.moves))

    def run_experiment(self, terms: Terms) -> DesignedExperiment | None:
        """Return the experiment designed for the likeliest rivals' runs; None if no course stays inside the bounds."""
        return designed(self.alive[:ASKED], self.record, terms, workers=self._workers)

    def slip_experiment(self, terms: Terms) -> DesignedExperiment | None:
        """Return the course whose slips promise most; None where slips do not tell of all that are asked.

        An input whose run has told little is asked, too: its slips may tell more.
        """
        asked = [self._all[name] for name in self._alive[:ASKED]]
        told = [(each.fit, each.slips) for each in asked if each.slips]
        if len(told) < len(asked):
            return None
        any_input = replace(terms, without=frozenset())
        chosen = promised_by_slips(told, self.record, self._first_rows, any_input, workers=self._workers)
        return None if chosen is None else DesignedExperiment(chosen[0], 1.0, by_slips=chosen[1])

    @property
    def explained(self) -> bool:
        """Whether the best does as well in the experiments as in the recordings before, or as the sensor allows.

        In half of the blocks, and in three quarters: what acts only where the stem moves leaves the rests alone.
        """
        earlier_m = self._begun.off_m(self.best)
        now_m = self.off_m(self.best, sum(map(len, self._begun._recordings)))
        by_run = np.all(now_m <= RARELY_OFF * np.maximum(self.record.floor_or_scale_m, earlier_m))
        return bool(by_run) or self._explained_by_slips

    @property
    def _explained_by_slips(self) -> bool:
        """Whether the best is as near to where slides land, and to what begins them, as in the recordings before.

        What began those is known to the size of their steps: how far that scatters is estimated (S_s).
        """
        before, off = self._begun._all[self.best].slips, slips_off(self.fits[self.best], self.record, self._first_rows)
        played = len(self._begun._recordings)
        landed_m, broke_n = off.landed_m[off.landed_in >= played], off.broke_n[off.broke_in >= played]
        if before is None or min(landed_m.size, broke_n.size) < FEWEST:
            return False
        earlier_m = np.quantile(off.landed_m[off.landed_in < played], EXPLAINED)
        usual_n = before.static_n * BY_CHANCE
        landed = np.all(np.quantile(landed_m, EXPLAINED) <= RARELY_OFF * earlier_m)
        return bool(landed and np.all(np.quantile(broke_n, EXPLAINED) <= RARELY_OFF * usual_n))

    def off_m(self, name: str, first: int = 0) -> Vector:
        """Return by how much a rival is off from a row on, m: `EXPLAINED` quantiles of its blocks' errors."""
        error_m = self._error_m(self.fits[name])[first:]
        return np.asarray(np.exp(np.quantile(block_logs(self.record.time_s[first:], error_m, 0.0), EXPLAINED)))

    def with_recording(self, recording: Recording) -> "RivalRace":
        """Return it after another recording: every rival refitted from where it was, and from where the best was.

        One that has lost is followed from where it was alone: all are searched anew before the best is named.
        """
        race = RivalRace(self.fits, (*self._recordings, recording), self._seed, self._workers, self._begun)
        best, left, names = self.fits[self.best], self._alive, list(self.fits)

        def refitted(name: str) -> Fit:
            return race._refitted(self.fits[name], best if name in left else None)

        found = race._with(dict(zip(names, on_threads(refitted, names, self._workers), strict=True)))
        return found.searched_anew() if found.odds >= ODDS else found

    def searched_anew(self) -> "RivalRace":
        """Return it with every rival searched from many starts; the better of both is kept."""
        found, bases = {}, dict[tuple[EffectTable, ...], Fit]()
        for name, here in self.fits.items():
            others = tuple(each for each in here.valve.effect if each.name != name)
            bare = ValveFile(valve=self.fits[self.best].valve.valve, effect=others)
            how: dict[str, Any] = {"seed": self._seed, "workers": self._workers, "profile": False}
            base = bases.get(others) or fit(self._whole, bare, from_pressure=here.from_pressure, **how)
            bases[others] = base
            there = fit(self._whole, bare, effects=(name,), base=base, **how)
            found[name] = min(here, there, key=lambda each: each.cost)
        return self._with(found)

    def _with(self, fits: Mapping[str, Fit]) -> "RivalRace":
        return RivalRace(fits, self._recordings, self._seed, self._workers, self._begun)

    def _refitted(self, here: Fit, best: Fit | None) -> Fit:
        """Return a fit to the whole record, from its own parameters and from those that it shares with the best.

        All starts descend. The lowest is settled first, and no other that has come to where one has been; nor are the
        stairs of what stays behind scanned.
        """
        composition = Composition.from_file(here.valve)
        parameters = free_parameters(composition, tuple(here.parameters))
        run = FreeRun(composition, self.record, from_pressure=here.from_pressure)
        error = SimulationError(run, composition, parameters, composition.theta)
        starts = [error.coordinates(composition.theta)]
        if best:
            starts += map(error.coordinates, (_shared(composition, best), *here.seeds))
        z, *others = sorted((descended(error, each, MIDDLING) for each in starts), key=error.cost)
        came = [z, z := settled(error, z)]
        for other in others:
            if min(float(np.max(np.abs(other - each))) for each in came) > ELSEWHERE:
                end = settled(error, other, error.cost(z))
                came += [other, end]
                z = min(z, end, key=error.cost)
        theta = error.theta(z)
        values: dict[str, float] = dict(zip(composition.names, theta.tolist(), strict=True))
        base = here.valve.valve.model_copy(
            update={name: value for name, value in values.items() if name in type(here.valve.valve).model_fields}
        )
        tables = tuple(
            each.model_copy(update={key: values[f"{each.name}.{key}"] for key in each.parameters})
            for each in here.valve.effect
        )
        fitted = {
            each.name: replace(here.parameters[each.name], value=float(theta[each.index])) for each in error.parameters
        }
        return replace(
            here,
            valve=ValveFile(valve=base, effect=tables),
            parameters=fitted,
            rms_m=error.rms_m(z),
            cost=error.cost(z),
            count=error.count,
        )

    def _error_m(self, found: Fit) -> np.ndarray[Any, np.dtype[np.float64]]:
        composition = Composition.from_file(found.valve)
        position_m = FreeRun(composition, self.record, from_pressure=found.from_pressure).position_m(composition.theta)
        return np.where(self.record.valid, position_m - self.record.position_m, np.nan)

    @cached_property
    def _parts(self) -> list[slice]:
        """The record, cut where a recording begins and where the stem leaves a rest."""
        leaves = {each.leaves for each in rests(self.record)}
        cuts = sorted({*self._first_rows, *leaves, len(self.record.time_s)})
        return [slice(*each) for each in pairwise(cuts)]

    def _weighed(self, found: Fit, least_m: float) -> Weighed:
        error_m = self._error_m(found)
        negligible_m = NEGLIGIBLE * self.record.floor_or_scale_m
        cost = softs(error_m / self._sigma_m, FINAL)
        recordings = [slice(*each) for each in pairwise([*self._first_rows, len(self.record.time_s)])]
        stretches = [part for each in recordings for part in _stretches(cost[each], self.record.period_s)]
        by_slips = [each for each in self._parts if np.isfinite(error_m[each]).any()]
        return Weighed(
            found,
            np.log([np.hypot(np.sqrt(np.nanmean(error_m[each] ** 2)), negligible_m) for each in by_slips]),
            _independent_share([cost[each] for each in self._parts]),
            slips(found, self.record, self._first_rows, least_m),
            np.array([np.nansum(each) for each in stretches]),
            costs=np.array([np.nansum(cost[each]) for each in by_slips]),
            steady=self.record.noise_m is not None
            and all(self._is_noise(each) for each in _stretches(error_m, self.record.period_s)),
        )

    def _is_noise(self, error_m: Vector) -> bool:
        return not np.isfinite(error_m).any() or float(np.nanmean(error_m**2)) <= (RARELY_OFF * self._sigma_m) ** 2


def _shared(composition: Composition, best: Fit) -> Vector:
    """Return theta of a rival with what it shares with the best as it is there."""
    theta, bests = composition.theta.copy(), Composition.from_file(best.valve)
    for name, value in zip(bests.names, bests.theta.tolist(), strict=True):
        if name in composition.names:
            theta[composition.names.index(name)] = value
    return theta


def _stretches(each: Vector, period_s: float) -> list[Vector]:
    """Return what belongs to each stretch of `STRETCH_S`; the last one may be longer."""
    size = max(1, round(STRETCH_S / period_s))
    return np.split(each, range(size, each.size // size * size, size)) if each.size >= size else [each]


def _independent_share(parts: Sequence[Vector]) -> float:
    """Return n / N of the losses, sample by sample, in parts that tell nothing of each other."""
    counted = [part[np.isfinite(part)] for part in parts]
    cost = np.concatenate(counted)
    spread = sum(float(np.sum(part - cost.mean())) ** 2 for part in counted)
    return min(1.0, cost.size * float(np.var(cost)) / spread) if spread > 0.0 else 1.0


def _criterion(found: Fit) -> float:
    n = found.count
    return n * log(max(found.cost, TINY)) + len(found.parameters) * log(n)
