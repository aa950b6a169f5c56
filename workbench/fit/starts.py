"""Where searches begin: the data sheet; beside an added effect, the fit without it, and what the effect declares.

Of all strengths that an effect declares, and those that the record suggests (`guesses`), the landings choose: where
slides end is simulated at each, and costs a thousandth of a fit.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sim.composition import COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.fit_thresholds import FIT
from workbench.fit.guesses import guessed_values
from workbench.fit.likelihood import Groups, Likelihood, cost_of, with_static
from workbench.model.search_coordinates import Parameter, strengths


@dataclass(frozen=True, slots=True)
class Origin:
    """A valve without the effects that are added, and the onsets that suit it, if they are known."""

    theta: Vector
    onsets_s: Vector | None = None


def base_starts(like: Likelihood) -> list[Vector]:
    """Return coordinates of the data sheet, then with more and with less friction."""
    factors = (1.0, 1.0 / FIT.sheet.off_factor, FIT.sheet.off_factor)
    return [_times(like, factor, COULOMB, STATIC) for factor in factors]


def swinging_starts(like: Likelihood) -> list[Vector]:
    """Return coordinates of the data sheet with less damping."""
    return [_times(like, factor, VISCOUS) for factor in FIT.sheet.less_damping_factors]


def _times(like: Likelihood, factor: float, *rows: int) -> Vector:
    theta = like.composition.theta.copy()
    theta[list(rows)] *= factor
    return like.coordinates(theta)


def near_start(
    like: Likelihood, added: Sequence[Parameter], fitted: Origin, points: Sequence[tuple[float, ...]] = ()
) -> Vector:
    """Return coordinates beside a fit, with the strengths of the effects that suit it best."""
    onsets_s = like.run.first_onsets_s() if fitted.onsets_s is None else fitted.onsets_s
    return _likeliest(like, strewn(like, added, fitted, points), onsets_s)


def with_strengths(
    like: Likelihood, added: Sequence[Parameter], z: Vector, points: Sequence[tuple[float, ...]] = ()
) -> Vector:
    """Return coordinates with the strengths that suit all samples best, or as they are.

    Where slides end does not tell how long they take: what acts in time is chosen by the motion.
    """
    theta = like.theta(z)
    return _likeliest(like, [theta, *strewn(like, added, Origin(theta), points)], like.run.first_onsets_s())


def in_other_order(like: Likelihood, z: Vector) -> Vector | None:
    """Return coordinates with a lag and the stem's own time, F_v / k_s, exchanged; None of a valve without a lag.

    The stem follows its force as a lag does, and two lags one after another come to the same in either order, but where
    friction ends a slide: each order is a valley.
    """
    lags = [each for each in like.parameters if each.guess == "lag"]
    theta = like.theta(z)
    if len(lags) != 1 or theta[SPRING] == 0.0:
        return None
    lag_s = float(theta[lags[0].index])
    theta[lags[0].index] = theta[VISCOUS] / theta[SPRING]
    theta[VISCOUS] = lag_s * theta[SPRING]
    return like.coordinates(theta)


def _likeliest(like: Likelihood, thetas: Iterable[Vector], onsets_s: Vector) -> Vector:
    """Return the coordinates of the likeliest of parameter vectors, each with its own static friction."""
    found = [_at_its_static(like, theta, onsets_s) for theta in thetas]
    costs = [cost_of(groups.whole) for _, groups in found]
    return like.coordinates(found[_first_of_least(costs)][0])


def _first_of_least(costs: Sequence[float]) -> int:
    return int(np.argmax(np.array(costs) <= min(costs) + FIT.ends.same_start_nats))


def _at_its_static(like: Likelihood, theta: Vector, onsets_s: Vector) -> tuple[Vector, Groups]:
    path = like.path(theta, onsets_s)
    there = with_static(like, theta, path)
    return there, like.of_path(path, there)


def starts_by_landings(
    like: Likelihood,
    added: Sequence[Parameter],
    fitted: Origin,
    sheet: Origin,
    points: Sequence[tuple[float, ...]] = (),
) -> list[Vector]:
    """Return the coordinates that landings like best, of all strengths beside the fit and the data sheet.

    Where the fit without the effect has another damping than the data sheet, it may have taken the effect's time for
    the stem's own, of which landings know nothing: then both are searched from.

    Args:
        like: of the valve with the effects.
        added: their parameters.
        fitted: the fit without them, and its onsets.
        sheet: the data sheet.
        points: values of the parameters in place of those that the effects declare.
    """
    apart = abs(np.log(max(fitted.theta[VISCOUS], FIT.nothing) / max(sheet.theta[VISCOUS], FIT.nothing)))
    origins = ((fitted,), (sheet,)) if apart > np.log(FIT.sheet.off_factor) else ((fitted, sheet),)
    return [_best_by_landings(like, added, each, points) for each in origins]


def _best_by_landings(
    like: Likelihood, added: Sequence[Parameter], origins: Sequence[Origin], points: Sequence[tuple[float, ...]]
) -> Vector:
    thetas, costs = [], []
    for origin in origins:
        onsets_s = like.run.first_onsets_s() if origin.onsets_s is None else origin.onsets_s
        for theta in strewn(like, added, origin, points):
            thetas.append(theta)
            costs.append(cost_of(like.wide_landings(like.at(theta, onsets_s))))
    return like.coordinates(thetas[_first_of_least(costs)] if thetas else origins[0].theta)


def strewn(
    like: Likelihood, added: Sequence[Parameter], origin: Origin, points: Sequence[tuple[float, ...]]
) -> Iterator[Vector]:
    """Yield an origin's parameters with each of the strengths, (parameters,)."""
    for values in points or (*strengths(added), *guessed_values(added, like.record)):
        theta = origin.theta.copy()
        for each, value in zip(added, values, strict=True):
            theta[each.index] = value
        yield theta
