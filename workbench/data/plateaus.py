"""Where the stem rests in a record of few samples a move: plateaus of three samples and more.

Neighbours belong together while they differ by less than 5 sigma; a stretch of at least three is a plateau, unless its
halves differ, as those of a stem that creeps do. What noise alone cuts in two is one. How the stem came to it says the
last sample before that was elsewhere, in motion or on the plateau before.
"""

from typing import NamedTuple

import numpy as np

from config.recording import Column

APART = 5.0
"""Standard deviations by which samples at rest differ at most."""
FEWEST = 3
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
    begins = 0
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        end = last + 1
        if end - first < FEWEST or _creeps(x[first:end], noise_m):
            continue
        if found and found[-1].end == offset + rows[first - 1] + 1 and not _creeps(x[begins:end], noise_m):
            # Noise has cut one rest in two.
            over, mean_m = offset + int(rows[end - 1]) + 1, float(np.mean(x[begins:end]))
            found[-1] = found[-1]._replace(end=over, position_m=mean_m)
            continue
        begins = first
        middle_m = float(np.mean(x[first:end]))
        direction = 0
        if first:
            before_m = found[-1].position_m if found and found[-1].end == offset + rows[first - 1] + 1 else x[first - 1]
            direction = int(np.sign(middle_m - before_m))
        found.append(Plateau(offset + int(rows[first]), offset + int(rows[end - 1]) + 1, middle_m, direction))
    return tuple(found)


def _creeps(x: Column, noise_m: float) -> bool:
    half = x.size // 2
    apart_m = abs(float(np.mean(x[-half:]) - np.mean(x[:half])))
    return bool(apart_m > CREEPS * noise_m + DEVIATIONS * noise_m * (2.0 / half) ** 0.5)
