"""Does the stem rest since the pressure was last changed, and where?

Samples are kept from the change of the pressure on, at t = 0. The stem rests at time T if nothing moves in the second
half of them, from T/2 to T: all samples within

    tolerance = max(5 sigma, quantum, 1e-4 stroke)
    sigma     the noise, from second differences; of few samples no more than twice that of the rests before, or a creep
              would pass for noise

of their mean, and the two quarters alike. So a stem must have rested for as long as it took to get there, T_s, and
behind a slow pressure, whose rate nobody has told, it is waited for as long as it creeps. Where noise hides the end of
the creep it is waited for longer: a creep from A down to the tolerance goes on down to 1e-4 stroke by

    T/2 >= T_s (1 + ln(tolerance / 1e-4 stroke) / ln(A / tolerance))

A measured pressure has to rest, too.

A stem whose packing flows under its load creeps on and on, and never rests so. It is taken to stand where it is if it
creeps evenly, by w_1 from T/4 to T/2 and by w_2 >= w_1/2 from T/2 to T, and that is no pressure still to come:

    w_2 <= a tenth of its way     no lag does that: while w_2 >= w_1/2 it goes 12 % of its way in w_2, or more
    w_2 <= v T/2                  v the speed that is no answer any more (landing_detector)

How short of its balance may it rest? Friction rises as a stem that creeps behind a slow pressure comes to an end, and
it sticks; or it goes by jumps. Neither shows where it rests, but in how abruptly it came there. With w_1 to w_4 the
ways in the quarters of the time from a tenth of the way to T_s, a creep that stopped before its end was to go on by

    w_4 r/(1 - r),   r = w_4/w_3      w_4 at the most, where it went by jumps, or was seen in few samples

A pressure that comes at a constant rate has ended there: w_2, w_3 and w_4 are alike, no sample in them is a jump, and
nothing is short. A creep of which no sample was seen cannot be judged.
"""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import isfinite, isnan, log, nan, sqrt

import numpy as np

from positioner.estimation.array import Array

MOST_ROWS = 512
"""Rows kept; when they are full, each becomes the mean of two."""
FEWEST_SECOND_HALF_ROWS = 4
"""Rows in the second half."""
TOLERANCE = 1e-4
"""Of the stroke: motion smaller than this is none."""
SCATTER, AGREEMENT = 5.0, 4.0
"""Standard deviations: of a sample, of the difference of two means."""
PRESSURE_LEFT = 0.01
"""Share of the range of the measured pressure by which its quarters may differ."""
SAME_PRESSURE = 1e-6
"""Of the measured pressure: a smaller difference is that of rounding, and moves no stem."""
POOLED = 0.2
"""Weight of a rest in the variance of the noise."""
NOISIER, FEW = 2.0, 32
"""Factor on the noise of the rests before; rows in the second half that are few."""
LONGEST_HIDDEN = 3.0
"""Of the time to come near: a creep hidden by noise is waited for no longer."""
BEGUN = 0.1
"""Of the way: a stem that went so far is under way."""
QUARTERS_ALIKE, A_JUMP = 0.25, 0.5
"""Share of their mean by which quarters at a constant rate may differ; of a quarter's way: a sample that is a jump."""
FEWEST_OF_A_LINE = 3
"""Samples that say how far a creep goes."""
FEWEST_OF_A_CREEP = 6
"""Samples from which r says something."""
SLACKENS, OF_ITS_WAY = 0.5, 0.1
"""Of w_1, of the whole way: a stem that creeps goes on by at least, and at most, so much."""
LOOKED_AGAIN = 1.1
"""Factor on the time between two looks."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A stem at rest: m, s."""

    position_m: float
    std_m: float
    """Of the position, which is a mean."""
    noise_m: float
    """Standard deviation of one sample."""
    count: int
    """Samples in the mean."""
    came_to_rest_s: float
    """When it was first seen there for good, after the change of the pressure."""
    came_by: tuple[Array, Array] | None = field(default=None, compare=False, repr=False)
    """Times, s, and positions, m, of the samples until it had come to rest; None of one that creeps."""
    crept_m: float = 0.0
    """How far it has crept towards it since a quarter of the time; it goes on."""
    pressure_pa: float = nan
    """Measured, a mean; NaN: it is not."""

    @property
    def short_m(self) -> float:
        """How far short of its balance it may have stuck."""
        return 0.0 if self.came_by is None else _short_m(*self.came_by)


class RestWindow:
    """The samples since the pressure was changed.

    Attributes:
        rest: None until the stem has come to rest.
        quantum_m: of the position, as known by now.
    """

    def __init__(self, stroke_m: float) -> None:
        self._tolerance_m = TOLERANCE * stroke_m
        self.quantum_m = 0.0
        self._variance_m2: float | None = None
        self.restart(0.0)

    def restart(self, time_s: float, from_m: float = nan) -> None:
        """Begin anew: the pressure is changed now, and the stem leaves a position, m; NaN: that of the first sample."""
        self._from_m = from_m
        self._each, self._in_row = 1, 0
        self._sums = (0.0, 0.0, 0.0)
        # Rows by columns: to append to these costs a tenth of a row of a matrix.
        self._times_s, self._positions_m, self._pressures_pa = array("d"), array("d"), array("d")
        self._start_s = time_s
        self._look_s = time_s
        self.rest: Rest | None = None

    def add(self, time_s: float, position_m: float, pressure_pa: float, no_answer: Callable[[], float] = float) -> None:
        """Take a sample; a pressure that is not measured is NaN.

        Args:
            time_s, position_m, pressure_pa: of the sample.
            no_answer: how slow a stem must go for that to be no answer to the change of the pressure any more, m/s; by
                default 0, it may always be one.
        """
        if self._each == 1:
            self._append(time_s - self._start_s, position_m, pressure_pa)
        else:
            self._add_up(time_s - self._start_s, position_m, pressure_pa)
        if time_s >= self._look_s and len(self._times_s) >= 2 * FEWEST_SECOND_HALF_ROWS:
            self._look_s = self._start_s + LOOKED_AGAIN * (time_s - self._start_s)
            self.rest = self._rest(no_answer())

    def _append(self, after_s: float, position_m: float, pressure_pa: float) -> None:
        """Add a row; when they are full, each becomes the mean of two."""
        self._times_s.append(after_s)
        self._positions_m.append(position_m)
        self._pressures_pa.append(pressure_pa)
        if len(self._times_s) == MOST_ROWS:
            self._times_s, self._positions_m, self._pressures_pa = (
                _of_pairs(each) for each in (self._times_s, self._positions_m, self._pressures_pa)
            )
            self._each *= 2

    def _add_up(self, after_s: float, position_m: float, pressure_pa: float) -> None:
        """Add a sample to those of its row."""
        each, (times_s, positions_m, pressures_pa) = self._each, self._sums
        self._sums = (times_s + after_s, positions_m + position_m, pressures_pa + pressure_pa)
        self._in_row += 1
        if self._in_row == each:
            times_s, positions_m, pressures_pa = self._sums
            self._append(times_s / each, positions_m / each, pressures_pa / each)
            self._in_row, self._sums = 0, (0.0, 0.0, 0.0)

    def look_again(self, time_s: float) -> None:
        """Look at the next sample: the stem has left its rest."""
        self.rest, self._look_s = None, time_s

    @property
    def usual_noise_m(self) -> float:
        """Standard deviation of a sample, m, of the rests so far; 0 before there was one."""
        return 0.0 if self._variance_m2 is None else sqrt(self._variance_m2)

    def learn_noise(self, rest: Rest) -> None:
        """Take a rest's noise for that of the rests before."""
        before = rest.noise_m**2 if self._variance_m2 is None else self._variance_m2
        self._variance_m2 = (1 - POOLED) * before + POOLED * rest.noise_m**2

    def _creep_ends_s(self, near_s: float, off_m: Array, within_m: float) -> float:
        """Return when a creep that came within a tolerance at a time has ended for the eye of the finest sensor."""
        way_m = _farthest(off_m)
        hidden = log(within_m / self._tolerance_m) / log(way_m / within_m) if way_m > within_m else 0.0
        return near_s * (1.0 + min(hidden, LONGEST_HIDDEN))

    def _rest(self, no_answer_m_per_s: float) -> Rest | None:
        # Views, which end with this look: an array grows only while nobody views it.
        time_s, position_m, pressure_pa = map(np.frombuffer, (self._times_s, self._positions_m, self._pressures_pa))
        half = int(time_s.searchsorted(0.5 * time_s[-1]))
        late_m = position_m[half:]
        if late_m.size < FEWEST_SECOND_HALF_ROWS:
            return None
        noise_m = _noise(late_m)
        if self._variance_m2 is not None and late_m.size < FEW:
            usual_m = max(sqrt(self._variance_m2), self.quantum_m / sqrt(12))
            noise_m = min(noise_m, NOISIER * usual_m / sqrt(self._each))
        within_m = max(SCATTER * noise_m, 1.01 * self.quantum_m, self._tolerance_m)
        mean_m, late_pa = _mean(late_m), _mean(pressure_pa[half:])
        # NaN where some are not measured.
        range_pa = float(np.maximum.reduce(pressure_pa)) - float(np.minimum.reduce(pressure_pa))
        least_pa = max(PRESSURE_LEFT * range_pa, SAME_PRESSURE * abs(late_pa))
        if isfinite(range_pa) and not _flat(pressure_pa[half:], least_pa):
            return None
        if _farthest(late_m - mean_m) > within_m or not _flat(late_m, 0.5 * max(self._tolerance_m, self.quantum_m)):
            creeping = self._creeping(time_s, position_m, half, noise_m, within_m, no_answer_m_per_s)
            return creeping and replace(creeping, pressure_pa=late_pa)
        elsewhere = np.flatnonzero(np.abs(position_m - mean_m) > within_m)
        first = int(elsewhere[-1]) + 1 if elsewhere.size else 0
        if elsewhere.size and 0.5 * time_s[-1] < self._creep_ends_s(time_s[first], position_m - mean_m, within_m):
            return None
        return Rest(
            position_m=mean_m,
            std_m=noise_m / sqrt(late_m.size),
            noise_m=noise_m * sqrt(self._each),
            count=late_m.size * self._each,
            came_to_rest_s=float(time_s[first]) if first else 0.0,
            came_by=(time_s[: first + 1].copy(), position_m[: first + 1].copy()),
            pressure_pa=late_pa,
        )

    def _creeping(
        self, time_s: Array, position_m: Array, half: int, noise_m: float, within_m: float, no_answer_m_per_s: float
    ) -> Rest | None:
        """Return where a stem stands that creeps on: samples, (n,), the index of the second half, m; None: it does not.

        No sample of the second half is farther off an even creep than `within_m`.
        """
        end_s = float(time_s[-1])
        quarter = int(time_s.searchsorted(0.25 * end_s))
        if half - quarter < FEWEST_OF_A_LINE:
            return None
        late_s, late_m = time_s[half:], position_m[half:]
        before_m_per_s, _ = _line(time_s[quarter:half], position_m[quarter:half])
        late_m_per_s, position_now_m = _line(late_s, late_m)
        w_1, w_2 = before_m_per_s * 0.25 * end_s, late_m_per_s * 0.5 * end_s
        if w_1 * w_2 < 0.0 or abs(w_2) < SLACKENS * abs(w_1):
            return None
        from_m = position_m[0] if isnan(self._from_m) else self._from_m
        slow = abs(w_2) <= max(OF_ITS_WAY * _farthest(position_m - from_m), 0.5 * end_s * no_answer_m_per_s)
        if not slow or _farthest(late_m - position_now_m - late_m_per_s * (late_s - end_s)) > within_m:
            return None
        elsewhere = np.flatnonzero(np.abs(position_m - position_now_m) > abs(w_1) + abs(w_2) + within_m)
        return Rest(
            position_m=position_now_m,
            std_m=2.0 * noise_m / sqrt(position_m.size - half),  # of the end of a line
            noise_m=noise_m * sqrt(self._each),
            count=(position_m.size - half) * self._each,
            came_to_rest_s=float(time_s[elsewhere[-1] + 1]) if elsewhere.size else 0.0,
            crept_m=abs(w_1) + abs(w_2),
        )


def _short_m(time_s: Array, position_m: Array) -> float:
    """Return how far short of its balance a stem may have stuck, m: by the samples until it had come to rest, (n,)."""
    way_m = np.abs(position_m - position_m[0])
    begun = int(np.argmax(way_m > BEGUN * way_m[-1]))
    if way_m.size - begun < 2:
        return 0.0
    quarters_m = np.abs(np.diff(np.interp(np.linspace(time_s[begun - 1], time_s[-1], 5), time_s, position_m)))
    _first, *later_m = quarters_m.tolist()
    mean_m = sum(later_m) / len(later_m)
    even = max(abs(each - mean_m) for each in later_m) <= QUARTERS_ALIKE * mean_m
    jump_m = float(np.abs(np.diff(position_m[begun + (way_m.size - begun) // 4 :])).max())
    if even and jump_m <= A_JUMP * mean_m:
        return 0.0
    _second, third_m, last_m = later_m
    few = way_m.size - begun < FEWEST_OF_A_CREEP
    return float(last_m if few or third_m <= last_m else last_m * min(1.0, last_m / (third_m - last_m)))


def _of_pairs(values: "array[float]") -> "array[float]":
    """Return the means of every two values."""
    even, odd = np.array(values[::2]), np.array(values[1::2])
    return array("d", (0.5 * (even + odd)).tobytes())


def _noise(values: Array) -> float:
    """Return the standard deviation of white noise on what changes evenly."""
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return sqrt(float(second.dot(second)) / (6.0 * second.size))


def _mean(values: Array) -> float:
    """Return the mean: numpy's own method takes three times as long for so few."""
    return float(np.add.reduce(values)) / values.size


def _farthest(values: Array) -> float:
    """Return how far from zero the farthest lies."""
    return max(float(np.maximum.reduce(values)), -float(np.minimum.reduce(values)))


def _line(time_s: Array, position_m: Array) -> tuple[float, float]:
    """Return the slope of the straight line through samples, (n,), by least squares, and where it is at the last."""
    middle_s, middle_m = _mean(time_s), _mean(position_m)
    after_s = time_s - middle_s
    slope = float(after_s.dot(position_m - middle_m)) / float(after_s.dot(after_s))
    return slope, middle_m + slope * float(after_s[-1])


def _flat(values: Array, least: float) -> bool:
    """Return whether the two halves have one mean, but for noise and for the least that counts."""
    middle = values.size // 2
    allowed = max(AGREEMENT * _noise(values) * sqrt(2 / middle), least)
    return abs(_mean(values[:middle]) - _mean(values[middle:])) <= allowed
