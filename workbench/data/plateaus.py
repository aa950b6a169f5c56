"""Where the stem rests in a record of few samples a move: plateaus of three samples and more.

Neighbours belong together while they differ by less than 5 sigma; a stretch of at least three is a plateau, unless its
halves differ, as those of a stem that creeps do. What noise alone cuts in two is one: of a long rest here and there a
sample differs from its neighbours by more, often so where a historian keeps what differs, and no slide ended behind it.
How the stem came to it says the last sample before that was elsewhere, in motion or on the plateau before.
"""

from typing import NamedTuple

import numpy as np

from config.recording import Column

APART = 5.0
"""Standard deviations by which samples at rest differ at most."""
FEWEST_PLATEAU_SAMPLES = 3
CREEPS, DEVIATIONS = 1.0, 3.0
"""Noises, and deviations of the difference, by which the halves of a plateau may differ."""


class Plateau(NamedTuple):
    """Rows first to end (half open) at rest at a position, m; direction of the slide that ended here, 0 if none did."""

    first: int
    end: int
    position_m: float
    direction: int


def plateaus(position_m: Column, noise_m: float, offset: int = 0) -> tuple[Plateau, ...]:
    """Return the plateaus of an unbroken stretch of positions, m, (n,), whose first row in the record is `offset`.

    A sample that is not a number ends no plateau and counts for none.
    """
    rows = np.flatnonzero(np.isfinite(position_m))
    x = position_m[rows]
    within_m = APART * noise_m
    still = np.abs(np.diff(x)) <= within_m
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    found: list[Plateau] = []
    begins = ended = 0
    for still_from, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        end = last + 1
        if end - still_from < FEWEST_PLATEAU_SAMPLES or _creeps(x[still_from:end], noise_m):
            continue
        first = _reached(x, ended, still_from, end, within_m)
        if found and _cut_by_noise(x[begins:ended], x[ended:first], x[first:end], noise_m):
            ended, over = end, offset + int(rows[end - 1]) + 1
            found[-1] = found[-1]._replace(end=over, position_m=float(np.mean(x[begins:end])))
            continue
        middle_m = float(np.mean(x[first:end]))
        direction = 0
        if first:
            before_m = found[-1].position_m if found and ended == first else x[first - 1]
            direction = int(np.sign(middle_m - before_m))
        begins, ended = first, end
        found.append(Plateau(offset + int(rows[first]), offset + int(rows[end - 1]) + 1, middle_m, direction))
    return tuple(found)


def _reached(x: Column, ended: int, still_from: int, end: int, within_m: float) -> int:
    """Return where a stem that is still from a row on was already near that place, after the rest that ended before."""
    elsewhere = np.abs(x[ended:still_from] - np.mean(x[still_from:end])) > within_m
    return ended + int(np.max(np.flatnonzero(elsewhere), initial=-1)) + 1


def _cut_by_noise(before: Column, strays: Column, after: Column, noise_m: float) -> bool:
    """Return whether two stretches, and the samples between them, are one rest.

    Their means tell: halves of the whole would not show a short stretch elsewhere beside a long one.
    """
    near = np.abs(strays - np.mean(before)) <= APART * noise_m
    return bool(np.all(near)) and not _elsewhere(before, after, noise_m)


def _creeps(x: Column, noise_m: float) -> bool:
    half = x.size // 2
    return _elsewhere(x[:half], x[-half:], noise_m)


def _elsewhere(one: Column, other: Column, noise_m: float) -> bool:
    apart_m = abs(float(np.mean(other) - np.mean(one)))
    return bool(apart_m > CREEPS * noise_m + DEVIATIONS * noise_m * (1.0 / one.size + 1.0 / other.size) ** 0.5)
