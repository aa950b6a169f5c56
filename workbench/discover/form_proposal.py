"""Which forms are likely, and where their fits begin, found by projection. It decides nothing.

At every strength, with every value of a shape's own parameters from which a fit may begin, what the form changes of
the residuals is projected on what the bare fit leaves of them (`workbench.select.tangent_preview`): of all residuals,
and of landings alone. Forms are taken by turns of the two, each in the order of the evidence that its share s promises,

    -n log(1 - s) - k log n      n landings and break-aways, k parameters of the form

and the fit of each begins at the best points of either.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import chain
from math import log

import numpy as np

from sim.effect import Effect
from workbench.fit.fit_problem import Problem
from workbench.fit.fit_result import Fit
from workbench.fit.threads import on_threads
from workbench.model.search_coordinates import MOST_GRID
from workbench.select.tangent_preview import Left

BEST = 2
"""Points that each of the two gives a fit to begin with."""

LEAST_SHARE_LEFT = 1e-9
"""Of what is left: a share that is all of it promises no more than this does."""

Point = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Proposal:
    """A form, by the name of its file, and the values of its parameters at which a fit is to begin."""

    name: str
    points: tuple[Point, ...]


def propose_forms(
    base: Fit,
    of: Problem,
    effects: Mapping[str, Effect],
    workers: int | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> tuple[Proposal, ...]:
    """Return the forms with where to begin, the likeliest first.

    Args:
        base: the fit of the valve as it is.
        of: the problem that it solves.
        effects: the forms as effects, by the names of their files.
        workers: threads, by default one a core.
        tell: called with the fraction done.
    """
    left, names = Left(base, of), tuple(effects)
    points = {name: effects[name].strengths(base.valve.valve)[:MOST_GRID] for name in names}
    shares: dict[str, tuple[list[float], list[float]]] = {}

    def shared(name: str) -> tuple[list[float], list[float]]:
        found = left.changes_by(effects[name], points[name])
        return [*map(left.share, found)], [*map(left.share_of_landings, found)]

    found = on_threads(shared, names, workers)
    for name, each in zip(names, found, strict=True):
        shares[name] = each
        tell(len(shares) / len(names))
    evidence = {name: [_promise_evidence(effects[name], max(each), base) for each in shares[name]] for name in names}
    by_all = sorted(names, key=lambda name: -evidence[name][0])
    by_landings = sorted(names, key=lambda name: -evidence[name][1])
    order = dict.fromkeys(chain.from_iterable(zip(by_all, by_landings, strict=True)))
    return tuple(Proposal(name, _begins(effects[name], points[name], shares[name])) for name in order)


def _promise_evidence(effect: Effect, share: float, base: Fit) -> float:
    """Return the evidence that a share of what is left, from 0 to 1, promises."""
    n, fitted = base.terms.events, sum(not each.given for each in effect.parameters.values())
    return -n * log(max(1.0 - share, LEAST_SHARE_LEFT)) - fitted * log(n)


def _begins(effect: Effect, points: list[Point], shares: tuple[list[float], list[float]]) -> tuple[Point, ...]:
    """Return the best points of either, without what is read from a drawing."""
    best = dict.fromkeys(points[i] for scores in shares for i in np.argsort(scores)[: -BEST - 1 : -1])
    declared = effect.parameters.values()
    return tuple(tuple(v for v, each in zip(point, declared, strict=True) if not each.given) for point in best)
