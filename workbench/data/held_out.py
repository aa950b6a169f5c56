"""What is fitted on and what is held out: another recording, or the end of the one there is.

The held-out end is simulated in one free run with what lies before it, so that its start needs no guess; only its rows
count. Several recordings become one: where the clock is set back, the workbench simulates anew.

What was fitted cannot judge: a held-out part of which most samples stand in the fitted one, to the last bit and at the
same times, is the same recording under another name, or one that was given twice, and is refused.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from config.recording import Column, Recording
from config.results.result import Brief
from workbench.data.clock_difference import Doubt
from workbench.data.record import Mask, Record, ready, require_few_samples
from workbench.data.stretches import informative

HELD_OUT = 1.0 / 3.0
"""Part of the recording that is held out where no other is given."""
SIDE_SAMPLES = 40
"""Samples on either side."""
KNOWN = 0.5
"""Share of the held-out samples that may stand in what is fitted, too: two recordings may begin alike."""
HELD_OUT_RECORDING = "held-out recording"
"""What errors call it."""


@dataclass(frozen=True, slots=True, repr=False)
class Part(Brief):
    """A recording that is simulated, and which of its rows count."""

    recording: Recording
    record: Record
    counted: Mask


@dataclass(frozen=True, slots=True)
class PressureScatter:
    """How far the noise of a measured pressure moves the stem that it drives."""

    noise_pa: float
    """Standard deviation."""
    typical_m: float
    """In a typical second, rms."""


@dataclass(frozen=True, slots=True, repr=False)
class Split(Brief):
    """What a candidate is fitted on, and what it is judged on: the other recording, or the end of the whole one."""

    train: Part
    test: Part
    floor_m: float | None
    """The error that no model undercuts: the valve's repeatability where a command repeats, else the sensor's noise.

    Besides, in a typical second, what the noise of a measured pressure does. None: unknown."""
    by_pressure: PressureScatter | None = None
    """Where the stem is driven by a measured pressure whose noise is known."""

    @property
    def scale_m(self) -> float:
        """What errors are weighed by where the floor is unknown, and no verdict rests on it; else the floor."""
        if self.floor_m is not None:
            return self.floor_m
        return max(each.record.floor_or_scale_m for each in (self.train, self.test))

    @property
    def motion_std_m(self) -> float:
        """The standard deviation of the position that is fitted, m."""
        return float(np.std(self.train.record.position_m[self.train.counted]))

    @property
    def records(self) -> tuple[Record, ...]:
        """The records that there are: of one whose end is held out, the whole, for what is fitted is its beginning."""
        begun = len(self.train.record)
        of_one = len(self.test.record) > begun and not self.test.counted[:begun].any()
        return (self.test.record,) if of_one else (self.train.record, self.test.record)

    @property
    def early(self) -> Doubt | None:
        """How much the stem moves before its command, if it does: no verdict rests on such a recording."""
        known = [each.record.early for each in (self.train, self.test) if each.record.early]
        return max(known, key=lambda each: each.turns, default=None)

    @property
    def repeats(self) -> bool:
        """Whether a command repeats itself, so that the floor is the valve's own."""
        return any(each.record.repeatability_m is not None for each in (self.train, self.test))


def split(recordings: Sequence[Recording], test: Recording | None = None) -> Split:
    """Set apart what is held out.

    Raises:
        InputError: no recording, too few samples, more than can be fitted, or what is held out is fitted as well.
    """
    whole = join_recordings(recordings)
    require_few_samples(whole)
    whole = informative(whole)
    if test:
        with _of_held_out():
            require_few_samples(test)
            test = informative(test)
    end = len(whole) if test else round(len(whole) * (1.0 - HELD_OUT))
    train = _part(_head(whole, end), 0)
    with _of_held_out():
        held_out = _part(test, 0) if test else _part(whole, end)
    for part, what in ((train, "to fit"), (held_out, "held out")):
        if part.counted.sum() < SIDE_SAMPLES:
            raise InputError("recording", f"{part.counted.sum()} samples {what} are too few: {SIDE_SAMPLES} are needed")
    _require_unseen(train, held_out)
    floors_m = [each.record.floor_m for each in (train, held_out) if each.record.floor_m is not None]
    return Split(train, held_out, max(floors_m, default=None))


@contextmanager
def _of_held_out() -> Iterator[None]:
    """Say of what is wrong with a recording that it is the one held out."""
    try:
        yield
    except InputError as error:
        raise error.named({"recording": HELD_OUT_RECORDING}) from None


def _require_unseen(train: Part, test: Part) -> None:
    names = sorted(train.recording.columns.keys() & test.recording.columns.keys())
    held_out = _samples(test, names)
    known = int(np.isin(held_out, _samples(train, names)).sum())
    if known > KNOWN * held_out.size:
        problem = f"{known} of its {held_out.size} samples are fitted as well, so it judges nothing; allowed is another"
        raise InputError(HELD_OUT_RECORDING, problem)


def _samples(part: Part, names: Sequence[str]) -> npt.NDArray[np.void]:
    """Return what the columns of these names hold in each row that counts, as so many bytes, (rows,)."""
    rows = np.column_stack([part.recording.columns[name][part.counted] for name in names])
    return rows.view(f"V{rows.itemsize * len(names)}").ravel()


def _part(recording: Recording, first: int) -> Part:
    record = ready(recording)
    return Part(recording, record, record.valid & (np.arange(len(recording)) >= first))


def residual_m(part: Part, simulated_m: Column) -> Column:
    """Return simulated less measured position, m, (n,), NaN where it does not count."""
    return np.where(part.counted, simulated_m - part.record.position_m, np.nan)


def join_recordings(recordings: Sequence[Recording]) -> Recording:
    """Return the recordings one after another, with the columns that all of them have.

    Raises:
        InputError: there is none.
    """
    if not recordings:
        raise InputError("recording", "none is given")
    shared = [name for name in recordings[0].columns if all(name in each.columns for each in recordings)]
    columns = {name: np.concatenate([each.columns[name] for each in recordings]) for name in shared}
    return Recording(columns, recordings[0].metadata)


def _head(recording: Recording, rows: int) -> Recording:
    return Recording({name: column[:rows] for name, column in recording.columns.items()}, recording.metadata)
