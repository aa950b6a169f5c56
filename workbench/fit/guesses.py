"""What the positions of a record suggest for a parameter of an effect: stops at their ends, quanta of their rests.

S(q) = |sum exp(2 pi i x_j / q)|      x_j median position of the j-th rest, where the noise is small; q quantum, m

Where rests are few, samples spread over the record stand in for them: these show a quantum of four noises and more.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from config.recording import Column
from workbench.data.motion import directions
from workbench.data.record import Record
from workbench.model.parameters import Parameter

ENDS, INSIDE, ASIDE = (0.002, 0.998), (1.0, 4.0, 16.0), 0.1
"""Quantiles of the positions at their ends; how far inside these, in noises; how far outside, of what is swept."""
LEAST_REST, FEWEST_RESTS = 8, 6
MOST_SAMPLES = 500
"""Samples that stand in for rests."""
LIKELY_QUANTA = 8
FINEST, COARSEST = 2.0, 8.0
"""A quantum is sought from so many noises to the swept positions divided by so many."""
PER_LOBE = 8.0


def guessed_values(added: Sequence[Parameter], record: Record) -> list[tuple[float, ...]]:
    """Return values of the parameters that the positions suggest, for an effect that declares what of them it may be.

    Just inside their lowest or highest, or both; and the quanta to which they look rounded. Empty if none is declared.
    """
    kinds = {each.guess for each in added}
    suggested: list[dict[str, float]] = []
    if kinds & {"lowest", "swept"}:
        suggested += _ends(record.position_m[record.valid], record.scale_m)
    if "quantum" in kinds:
        suggested += [{"quantum": each} for each in likely_quanta_m(record)]
    return [
        tuple(guess.get(each.guess, each.starts[0] if each.starts else each.least) for each in added)
        for guess in suggested
    ]


def _ends(position_m: Column, noise_m: float) -> list[dict[str, float]]:
    lowest, highest = np.quantile(position_m, ENDS).tolist()
    aside = ASIDE * (highest - lowest)
    return [
        {"lowest": lowest + low, "swept": highest - high - (lowest + low)}
        for inside in (inside * noise_m for inside in INSIDE)
        for low, high in ((inside, inside), (inside, -aside), (-aside, inside))
    ]


def likely_quanta_m(record: Record) -> list[float]:
    """Return the steps, m, of which the positions look most to be multiples, of the highest S(q) first."""
    places_m = _rests_m(record)
    if places_m.size < FEWEST_RESTS:
        samples_m = record.position_m[record.valid]
        places_m = samples_m[:: 1 + samples_m.size // MOST_SAMPLES]
    swept_m = float(np.ptp(places_m))
    if swept_m < 2.0 * COARSEST * FINEST * record.scale_m:
        return []
    frequency = np.arange(COARSEST / swept_m, 1.0 / (FINEST * record.scale_m), 1.0 / (PER_LOBE * swept_m))
    height = np.abs(np.exp(2j * np.pi * np.outer(frequency, places_m)).sum(axis=1))
    peaks = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]))
    likeliest = peaks[np.argsort(-height[peaks])[:LIKELY_QUANTA]]
    half = frequency[1] - frequency[0]
    return [1.0 / _summit(float(each), half, places_m) for each in frequency[likeliest]]


def _summit(frequency: float, half: float, places_m: Column) -> float:
    """Return where S is highest within half a width of a frequency, 1/m."""

    def depth(there: float) -> float:
        return -float(np.abs(np.exp(2j * np.pi * there * places_m).sum()))

    return float(minimize_scalar(depth, bounds=(frequency - half, frequency + half), method="bounded").x)


def _rests_m(record: Record) -> Column:
    """Return the median position of each rest long enough: a sample of the next quantum does not move it."""
    places = []
    for first, end in record.segments:
        position_m = np.where(record.valid, record.position_m, np.nan)[first:end]
        way = directions(position_m, record.scale_m)
        edges = [0, *(1 + np.flatnonzero(np.diff(way != 0))).tolist(), way.size]
        for begin, over in pairwise(edges):
            if way[begin] == 0 and over - begin >= LEAST_REST:
                places.append(float(np.nanmedian(position_m[begin:over])))
    return np.array(places)
