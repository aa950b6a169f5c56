"""Where a segment of a record begins: what its samples say; behind a positioner, the pressure that none of them says.

A valve stands still with any pressure of a band, |A p - k_s x + F| <= F_s. A positioner brings the pressure from where
it is to where the stem breaks loose, and how long that takes tells where it was:

    the stem was seen to come:   A p = k_s x - F + sigma F_c                where a slide ended
    it is seen to leave, at t:   A p(t) = k_s x - F + sigma F_s             p(t) - p(0) by the positioner, the stem held
    neither:                     A p = k_s x - F                            the middle of the band

sigma direction of that motion, +1 opening; F with all effects.
"""

from dataclasses import dataclass

import numpy as np

from config.errors import InputError
from config.recording import Column
from sim.composition import COULOMB, STATIC
from sim.karnopp import Vector
from workbench.data.record import Record

STILL_DEVIATIONS = 4.0
"""Standard deviations of the noise within which the stem stands still."""
LONGEST_START = 50
"""Samples of the start that are averaged at most."""
LEAVING_ROWS = 4
"""Samples within which a stem that leaves its place is in motion from the start."""
CREPT, SURELY = 3.0, 5.0
"""Standard deviations of the noise, and of what is compared, by which a stem that creeps goes in its first samples."""
FASTER = 1.5
"""So many times as far as in its first samples it goes in the next ones at most: what breaks loose goes farther."""
LOOSE = 2.0
"""Standard deviations of the noise: a stem that leaves was within these of its place when it broke loose."""
IMMOVABLE_N = 1e12
"""Friction that holds the stem wherever it is."""


@dataclass(frozen=True, slots=True)
class InitialState:
    """Where a segment begins: position, m, and velocity, m/s."""

    position_m: float
    velocity_m_per_s: float


@dataclass(frozen=True, slots=True)
class BeforeStart:
    """What a record tells of the pressure that a segment begins with, behind a positioner."""

    came: int
    """Direction in which the stem was seen to come to where it begins, +1 opening; 0: it was not."""
    leaves: int
    """Direction in which it leaves; 0: it was seen to come, or never leaves."""
    rests: int
    """Periods until then; it leaves in the last of them."""


def initial_state(record: Record, first: int, end: int, *, moving: bool = True) -> InitialState:
    """Return where a segment begins, from its first valid samples; at rest unless it may be moving.

    A stem that creeps behind a pressure still on its way is in motion, however slowly: friction holds it one way.

    Raises:
        InputError: no sample of it has a position.
    """
    rows = first + np.flatnonzero(record.valid[first:end])
    if not rows.size:
        raise InputError("recording", f"samples {first + 1} to {end}: no position is a number")
    following_m, rows = record.position_m[rows[: 2 * LONGEST_START]], rows[:LONGEST_START]
    position_m, time_s = record.position_m[rows], record.time_s[rows]
    band_m = STILL_DEVIATIONS * record.scale_m
    away = np.abs(position_m - position_m[0]) > 2.0 * band_m
    still = int(away.argmax()) if away.any() else position_m.size
    in_motion = LEAVING_ROWS if still < LEAVING_ROWS else still if _creeps(following_m, still, record.scale_m) else 0
    if not in_motion or position_m.size < LEAVING_ROWS or not moving:
        return InitialState(float(np.median(position_m[: max(1, still - 1)])), 0.0)
    slope, place = np.polyfit(time_s[:in_motion] - time_s[0], position_m[:in_motion], 1)
    return InitialState(float(place), float(slope))


def _creeps(position_m: Column, still: int, noise_m: float) -> bool:
    """Whether a stem that so many first samples do not show to leave its place goes on evenly, or slows down."""
    half = still // 2
    if position_m.size < 2 * still:
        return False
    begun_m, gone_on_m = (float(np.mean(each)) for each in (position_m[:half], position_m[still - half : still]))
    went_m = gone_on_m - begun_m
    if abs(went_m) < min(CREPT, SURELY * float(np.sqrt(2.0 / half))) * noise_m:
        return False
    goes_m = np.sign(went_m) * float(np.mean(position_m[still : 2 * still]) - np.mean(position_m[:still]))
    return bool(0.0 < goes_m < FASTER * 2.0 * abs(went_m))


def before_start(record: Record, first: int, end: int, place_m: float) -> BeforeStart:
    """Return what the samples around the first of a segment, at rest at a place, m, tell of the pressure before it."""
    band_m = 2.0 * STILL_DEVIATIONS * record.scale_m
    # What was left out as it was in motion lies right before the segment, without a gap.
    unbroken = first > 0 and record.time_s[first] - record.time_s[first - 1] < 1.5 * record.period_s
    if unbroken and record.valid[first - 1] and not any(last == first for _, last in record.segments):
        away_m = place_m - record.position_m[:first][record.valid[:first]]
        moved = np.flatnonzero(np.abs(away_m) > band_m)
        if moved.size:
            return BeforeStart(int(np.sign(away_m[moved[-1]])), 0, 0)
    rows = first + np.flatnonzero(record.valid[first:end])
    off_m = record.position_m[rows] - place_m
    left = np.flatnonzero(np.abs(off_m) > band_m)
    if not left.size or rows[left[0]] == first:
        return BeforeStart(0, 0, 0)
    leaves = int(np.sign(off_m[left[0]]))
    in_place = np.flatnonzero(leaves * off_m[: left[0]] <= LOOSE * record.scale_m)
    return BeforeStart(0, leaves, int(rows[in_place[-1] + 1 if in_place.size else left[0]] - first))


def held(theta: Vector) -> Vector:
    """Return the parameters, (parameters,), of the same valve with a stem that nothing moves."""
    still = np.array(theta)
    still[COULOMB] = still[STATIC] = IMMOVABLE_N
    return still
