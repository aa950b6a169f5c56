"""A fit on its way: searches at the wide scale, the best of them at the middling one, the best of those to where they
stay, until searches from independent starts have come to the same; then on from there, off the stairs; and where more
than noise is left, between them and beyond.
"""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

import numpy as np

from sim.composition import Composition
from sim.karnopp import Vector
from workbench.fit.agreement import Place, agreeing
from workbench.fit.break_aways import by_break_aways, making_up
from workbench.fit.crossing import SURELY, crossed, leaves_noise, sticking, unlike
from workbench.fit.descent import COARSE, MIDDLING, NARROW, WIDE, descended, descended_through, settled
from workbench.fit.evolution import evolved, evolved_from_afar
from workbench.fit.fit_result import Fit, fit_at
from workbench.fit.guesses import FINEST, with_open_ends
from workbench.fit.objective import MIDDLE, WITHIN, SimulationError, smoothed
from workbench.fit.quanta import proved, with_best_quantum
from workbench.fit.shooting import shooting_starts
from workbench.fit.strewing import LOWER, on_lowest_tread, strewn, while_lower
from workbench.fit.threads import on_threads
from workbench.model.parameters import Parameter

LEAVES = 0.6
"""Cost a sample above which a fit leaves something to explain; that of white residuals of the noise is 0.485."""

STIRRED, MOST_STIRRED = 100, 6
"""Places about an end from which a search goes on; how often more, at most, as long as that leads clearly lower;"""
IN_VAIN = 3
"""rounds of crossing that do not, after which it ends;"""
EVOLVING, TURNS, MOST_EVOLVED = 40, 60, 4
"""places about the end that is left, how often they are crossed with each other, and how often more at most;"""
LIKELY = 1.5
"""and times the least cost up to which an end is gone on from beside the best."""

Progress = Callable[[float], None]
T = TypeVar("T")
S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much a search takes upon itself."""

    carried: int
    """Of the searches begun at the wide scale the best are carried on,"""
    settled: int
    """of those at most so many, two at a time, are brought to where they stay,"""
    agreeing: int
    """until searches from so many origins have come to the same."""
    near: float
    """Cost a sample up to which the ends are gone on from: above it, what a valve lacks is no stair beside them."""
    base: float = inf
    """Cost without what is added: an effect that has come to it makes nothing better. Such ends are not scanned for
    stairs, and do not agree, as the place where the effect is off can be reached from everywhere."""


@dataclass(frozen=True, slots=True)
class BegunFit:
    """A fit whose searches have come through the wide scale or the middling one, or the best to where they stay."""

    composition: Composition
    error: SimulationError
    places: Sequence[Place]
    """Where the searches have come to, the best first; through the middling scale, in the order in which they go on."""
    effort: Effort
    workers: int | None
    tell: Progress
    ends: tuple[Place, ...] = ()
    """Where the first of them stay, best first."""
    weakest: Place | None = None
    """Where what is added makes next to nothing of the base."""
    added: Sequence[Parameter] = ()
    """The parameters of what is added."""
    others: Callable[[], Sequence[Place]] = tuple
    """Finds the starts that no search has begun at."""
    strengths: Sequence[Sequence[Vector]] = ()
    """Coordinates of each strength of what is added, from which multiple shooting begins."""
    through: bool = False
    """Whether the searches have come through the middling scale."""

    @property
    def cost(self) -> float:
        """Cost of the best end."""
        return self.error.cost(self.ends[0].z)

    @property
    def screening_cost(self) -> float:
        """Cost by which searches are compared on their way, that of the best of them."""
        return min(self.error.rough.cost(place.z, MIDDLE) for place in self.places)

    @property
    def gain(self) -> float:
        """The cost by which searches are compared on their way, over that with next to nothing of what is added."""
        assert self.weakest is not None
        return self.screening_cost / self.error.rough.cost(self.weakest.z, MIDDLE)

    def all_begun(self) -> "BegunFit":
        """Begin the other searches too, if they are not there yet."""
        return replace(widely(self, self.others()), others=tuple)

    def carried(self) -> "BegunFit":
        """Carry the searches from the wide scale through the middling one, if they are not there yet."""
        rough = self.error.rough
        if self.through:
            return self

        def carried(place: Place) -> Place:
            return replace(place, z=descended(smoothed(rough, place.z), place.z, MIDDLING))

        found = _each(carried, self.places, self.workers, lambda done: self.tell(0.3 + 0.2 * done))
        ordered = sorted(found, key=lambda place: rough.cost(place.z, MIDDLE))
        return replace(self, places=_by_origins(ordered), through=True)

    @property
    def rms_m(self) -> float:
        """The rms error of the best that its searches have come to so far, m."""
        return self.error.rms_m((self.ends or self.places)[0].z)

    def settled(self, count: int) -> "BegunFit":
        """Bring at most so many more of the searches to where they stay."""
        chosen = self.places[len(self.ends) : len(self.ends) + count]
        found = _each(self._ended, chosen, self.workers, lambda done: self.tell(0.5 + 0.4 * done))
        return replace(self, ends=self._ordered([*self.ends, *found]))

    def _ended(self, start: Place) -> Place:
        z = settled(self.error, start.z, self.effort.base)
        return replace(start, z=strewn(self.error, z) if self._rounds(z) else z)

    def _ordered(self, ends: Sequence[Place]) -> tuple[Place, ...]:
        return tuple(sorted(ends, key=lambda end: self.error.cost(end.z)))

    def finished(self, *, profile: bool) -> Fit:
        """Return the fit, searches brought to where they stay two at a time until they agree.

        Where a sensor rounds by more than the noise hides, places about the best are tried before the agreement counts.

        Args:
            profile: follow the cost for the intervals.
        """
        here, most = self, min(self.effort.settled, len(self.places))
        while len(here.ends) < most and (not here.ends or agreeing(here.error, here.ends) < here.effort.agreeing):
            # One that was there already is the first of two: the fit is the same whether it was begun apart or not.
            here = here.settled(min(2 - len(here.ends) % 2, most - len(here.ends)))
        here = here.shot()
        best = here.ends[0].z
        if here._rounds(best):
            here = replace(here, ends=proved(here.error, with_best_quantum(here.error, here.ends)))
        elif here._visible(best):
            here = here.gone_on()
        return here.judged(profile=profile)

    def gone_on_up_to(self, cost: float) -> "BegunFit":
        """Let its ends be gone on from up to a cost only."""
        return replace(self, effort=replace(self.effort, near=min(self.effort.near, cost / self.error.count)))

    def gone_on(self) -> "BegunFit":
        """Go on from where the searches stay, unless that is far above the floor."""
        if self.cost > self.effort.near * self.error.count:
            return self
        here = self.stirred()
        if leaves_noise(here.error, here.ends[0].z):
            return here
        lower = here.crossed()
        lower = lower.stirred() if here.cost > LOWER * lower.cost else lower
        return lower.evolved()

    def evolved(self) -> "BegunFit":
        """Let places about the best end evolve: no end may lie along its valley."""

        def off_stairs(z: Vector) -> Vector:
            return settled(self.error, evolved(self.error, z, EVOLVING, TURNS))

        return self._with_best(while_lower(self.error, self.ends[0].z, off_stairs, MOST_EVOLVED))

    def _with_best(self, z: Vector) -> "BegunFit":
        """Return it with its best end moved to z."""
        return replace(self, ends=self._ordered([replace(self.ends[0], z=z), *self.ends[1:]]))

    def crossed(self) -> "BegunFit":
        """Search on from between the ends and beyond the best, until a few rounds in a row lead no lower.

        Where slips are mistimed also from what evolves from afar, and from every strength of what is added: by the cost
        where it begins a strong lag is far behind, but smooths the way down.
        """
        cost = self.error.cost

        def down(start: Vector) -> Vector:
            z = descended(self.error, start, COARSE)
            return z if cost(z) > LIKELY * self.cost else descended(self.error, z, NARROW)

        def anew(start: Vector) -> Vector:
            z = down(descended_through(self.error.rough, start, (WIDE, MIDDLING)))
            return z if cost(z) > LIKELY * self.cost else settled(self.error, z)

        pool, in_vain = unlike([each.z for each in (*self.ends, *self.places)]), 0
        more, begins = sticking(self.error, pool[0]), list[Vector]()
        if not leaves_noise(self.error, pool[0], SURELY):
            weakly_stuck = [each[-1] for each in self.strengths]
            begins = [*weakly_stuck, *evolved_from_afar(self.error, pool[0], self.strengths)]
        while in_vain < IN_VAIN:
            least = cost(pool[0])
            found = [
                *_each(down, [*more, *crossed(self.error, pool)], self.workers, lambda _: None),
                *_each(anew, begins, self.workers, lambda _: None),
            ]
            pool, more, begins = unlike(sorted([*pool, *found], key=cost)), [], []
            in_vain = 0 if least > LOWER * cost(pool[0]) else in_vain + 1
        if pool[0] is self.ends[0].z:
            return self
        return self._with_best(settled(self.error, pool[0]))

    def stirred(self) -> "BegunFit":
        """Go on from the lowest of the places strewn about the best end; where that leads lower, about others too.

        The stairs run across all coordinates at once: a descent and scans of each alone may end on one of them.
        """

        def off_stairs(z: Vector) -> Vector:
            near = (
                strewn(self.error, on_lowest_tread(self.error, z), STIRRED),
                by_break_aways(self.error, z),
                self._made_up(z),
            )
            found = [settled(self.error, each, self.effort.base) for each in near if each is not z]
            return min([z, *found], key=self.error.cost)

        def stirred(end: Place) -> Place:
            return replace(end, z=while_lower(self.error, end.z, off_stairs, MOST_STIRRED))

        best, *others = stirred(self.ends[0]), *self.ends[1:]
        here = replace(self, ends=self._ordered([best, *others]))
        if self.cost <= WITHIN * here.cost:
            return here
        likely = min(sum(self.error.cost(end.z) <= LIKELY * here.cost for end in others), self.effort.agreeing)
        found = _each(stirred, others[:likely], self.workers, lambda _: None)
        return replace(self, ends=self._ordered([best, *found, *others[likely:]]))

    def _made_up(self, z: Vector) -> Vector:
        """Return the lowest from z with what makes up for static friction of other strengths; z where nothing does."""
        own = np.array([each in self.added for each in self.error.parameters])
        anew = [np.where(own, strength[0], z) for strength in self.strengths]
        begins = making_up(self.error, z, anew)
        down = [descended_through(self.error, each, (COARSE, NARROW)) for each in begins]
        return min(down, key=self.error.cost) if down else z

    def shot(self) -> "BegunFit":
        """Search from starts by multiple shooting too, where the best end leaves something to explain."""
        if self.cost <= LEAVES * self.error.count:
            return self
        begins = shooting_starts(self.error, self.strengths, self.ends[0].z)
        found = _each(self._ended, begins, self.workers, lambda done: self.tell(0.9 + 0.05 * done))
        return replace(self, ends=self._ordered([*self.ends, *found]))

    def by_one(self) -> Fit:
        """Return the fit by the one search that is the best on its way."""
        return replace(self, places=self.places[:1]).carried().settled(1).judged(profile=False)

    def left(self) -> Fit:
        """Return the fit by the best place on the way: nothing has settled, and nothing is brought there."""
        return replace(self, ends=tuple(self.ends or self.places)[:1], weakest=None).judged(profile=False)

    def judged(self, *, profile: bool) -> Fit:
        """Return the fit by what has settled so far.

        Args:
            profile: follow the cost for the intervals.
        """
        here = self._never_worse()
        found = [with_open_ends(self.error, here.ends[0].z, self.added), *(end.z for end in here.ends[1:])]
        agree = agreeing(self.error, here.ends) if self._shows(found[0]) else 1
        result = fit_at(self.error, self.composition, found, agree, profile=profile)
        self.tell(1.0)
        return result

    def _never_worse(self) -> "BegunFit":
        """Search from the base too where all ends are worse than that."""
        if self.weakest is None or self.cost <= self.error.cost(self.weakest.z):
            return self
        end = replace(self.weakest, z=settled(self.error, self.weakest.z, self.effort.base))
        return replace(self, ends=(end, *self.ends))

    @property
    def shows(self) -> bool:
        """Whether what is added makes something better than the base, where its best search has ended."""
        return self._shows(self.ends[0].z)

    def _shows(self, z: Vector) -> bool:
        return self._improves(z) and self._visible(z)

    def _visible(self, z: Vector) -> bool:
        """Whether the noise does not hide that the sensor rounds at z, if it does."""
        theta, noise_m = self.error.theta(z), self.error.run.record.scale_m
        return all(theta[each.index] >= FINEST * noise_m for each in self.error.parameters if each.guess == "quantum")

    def _improves(self, z: Vector) -> bool:
        return WITHIN * self.error.cost(z) < self.effort.base

    def _rounds(self, z: Vector) -> bool:
        """Whether the sensor rounds at z, and that makes something better than the base."""
        return smoothed(self.error, z) is not self.error and self._improves(z)


def widely(fit: BegunFit, begins: Sequence[Place]) -> BegunFit:
    """Search from more starts at the wide scale."""
    rough = fit.error.rough

    def begun(start: Place) -> Place:
        return replace(start, z=descended(smoothed(rough, start.z), start.z, WIDE))

    found = [*fit.places, *_each(begun, begins, fit.workers, lambda done: fit.tell(0.3 * done))]
    ordered = sorted(found, key=lambda place: rough.cost(place.z, MIDDLE))
    return replace(fit, places=ordered[: fit.effort.carried])


def _by_origins(places: Sequence[Place]) -> list[Place]:
    """Return the first of each origin, then the second of each, and so on: those that can agree come first."""
    turns = [sum(other.origin == each.origin for other in places[:i]) for i, each in enumerate(places)]
    return [places[i] for i in sorted(range(len(places)), key=turns.__getitem__)]


def _each(function: Callable[[T], S], arguments: Sequence[T], workers: int | None, tell: Progress) -> list[S]:
    """Apply a function to each argument on the workers; results in the order of the arguments."""
    results = []
    with closing(on_threads(function, arguments, workers)) as found:
        for result in found:
            results.append(result)
            tell(len(results) / len(arguments))
    return results
