"""What a record suggests for a parameter of an effect: stops at the positions' ends, quanta of their rests, delays.

S(q) = sum w_j cos(2 pi x_j / q)      x_j median position of the j-th rest, where the noise is small, a multiple of the
                                      quantum q, m; w_j its samples, at most 60

Where rests are few, samples spread over the record stand in for them: these show a quantum of four noises and more.

A move that is first seen d samples after a change of the command came after d - 1 to d of them. Told when the stem
moves, a model is indifferent to its delay but within a sample of the right one: a search begins amid the likely ones.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from config.recording import Column
from signals.moves import moves, rests
from workbench.data.record import Record
from workbench.fit.fit_thresholds import FIT
from workbench.model.search_coordinates import Parameter


def guessed_values(added: Sequence[Parameter], record: Record) -> list[tuple[float, ...]]:
    """Return values of the parameters that the positions suggest, for an effect that declares what of them it may be.

    Just inside their highest or lowest, then both; the quanta to which they look rounded; the delays after which the
    stem moves. Empty if none is declared.
    """
    suggested: list[dict[str, float]] = []
    ends = _ends(added, record)
    if ends is not None:
        lowest_m, highest_m, below_m, above_m = ends
        for inside in (FIT.guesses.inside_noises**power * record.scale_m for power in range(3)):
            lower_m, upper_m = lowest_m + inside, highest_m - inside
            stops = ((below_m, upper_m), (lower_m, above_m), (lower_m, upper_m))
            suggested += [{"lowest": lower, "swept": upper - lower} for lower, upper in stops]
    if any(each.guess == "quantum" for each in added):
        suggested += [{"quantum": each} for each in likely_quanta_m(record)]
    if any(each.guess == "delay" for each in added):
        suggested += [{"delay": each} for each in likely_delays_s(record)]
    return [
        tuple(guess.get(each.guess, each.starts[0] if each.starts else each.least) for each in added)
        for guess in suggested
    ]


def _ends(added: Sequence[Parameter], record: Record) -> tuple[float, float, float, float] | None:
    """Return the lowest and highest position, and where a stop below and above is that none comes to, m.

    None for effects without stops.
    """
    declared = {each.guess: each.starts[0] for each in added if each.guess in ("lowest", "swept")}
    if declared.keys() != {"lowest", "swept"}:
        return None
    quantile = FIT.guesses.end_quantile
    lowest_m, highest_m = np.quantile(record.position_m[record.valid], (quantile, 1.0 - quantile)).tolist()
    aside_m = FIT.guesses.aside_of_swept * (highest_m - lowest_m)
    below_m = min(declared["lowest"], lowest_m - aside_m)
    return lowest_m, highest_m, below_m, max(declared["lowest"] + declared["swept"], highest_m + aside_m)


def likely_delays_s(record: Record) -> list[float]:
    """Return how long after a change of a held command the stem moves, s, amid two samples, the likeliest first."""
    delays: list[int] = []
    for first, end in record.segments:
        changed = np.flatnonzero(np.diff(record.command_pa[first:end])) + 1
        seen_m = np.where(record.valid, record.position_m, np.nan)[first:end]
        moved = np.array([each.before + 1 for each in moves(seen_m, record.scale_m)], dtype=np.int64)
        if not moved.size:
            continue
        after = moved[np.minimum(np.searchsorted(moved, changed), moved.size - 1)]
        before_next = (after >= changed) & (after < np.append(changed[1:], end - first))
        delays += (after - changed)[before_next].tolist()
    if len(delays) < FIT.guesses.fewest_rests:
        return []
    likely = np.quantile(delays, (0.5, 0.25, 0.75), method="nearest")
    return [(each - 0.5) * record.period_s for each in dict.fromkeys(likely.tolist()) if each]


def likely_quanta_m(record: Record) -> list[float]:
    """Return the steps, m, of which the positions look most to be multiples, of the highest S(q) first."""
    places_m, weights = _rests_m(record)
    finest = FIT.guesses.finest_of_rests_noises
    if places_m.size < FIT.guesses.fewest_rests:
        samples_m = record.position_m[record.valid]
        places_m = samples_m[:: 1 + samples_m.size // FIT.guesses.most_samples]
        weights, finest = np.ones(places_m.size), FIT.guesses.finest_noises
    swept_m = float(np.ptp(places_m))
    if swept_m < 2.0 * FIT.guesses.coarsest_of_swept * FIT.guesses.finest_noises * record.scale_m:
        return []
    farthest_m = float(np.abs(places_m).max())
    frequency = np.arange(
        FIT.guesses.coarsest_of_swept / swept_m,
        1.0 / (finest * record.scale_m),
        1.0 / (FIT.guesses.steps_a_lobe * farthest_m),
    )
    height = np.cos(2.0 * np.pi * np.outer(frequency, places_m)) @ weights
    peaks = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]))
    likeliest = peaks[np.argsort(-height[peaks])[: FIT.guesses.most_quanta]]
    half = frequency[1] - frequency[0]
    return [1.0 / _summit(float(each), half, places_m, weights) for each in frequency[likeliest]]


def _summit(frequency: float, half: float, places_m: Column, weights: Column) -> float:
    """Return where S is highest within half a width of a frequency, 1/m."""

    def depth(there: float) -> float:
        return -float(np.cos(2.0 * np.pi * there * places_m) @ weights)

    return float(minimize_scalar(depth, bounds=(frequency - half, frequency + half), method="bounded").x)


def _rests_m(record: Record) -> tuple[Column, Column]:
    """Return the median position of each rest long enough, which a sample of the next quantum does not move, and w."""
    places, weights = [], []
    for first, end in record.segments:
        position_m = np.where(record.valid, record.position_m, np.nan)[first:end]
        for each in rests(position_m, record.scale_m):
            if each.end - each.first >= FIT.guesses.fewest_samples:
                places.append(float(np.nanmedian(position_m[each.first : each.end])))
                weights.append(min(each.end - each.first, FIT.guesses.sure_samples) / FIT.guesses.sure_samples)
    return np.array(places), np.array(weights)
