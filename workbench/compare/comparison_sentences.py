"""Where the model fails, in plain sentences, the gravest first, each with the stretches of time in which it shows.

A finding is said when it is both certain (3.5 standard errors, over slips, or over blocks of 1 s but no
more of them than slips: between slips an error stands) and matters (a mean
error above the floor, or a time above two periods).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.drive import Scale
from config.recording import Column
from signals.moves import Slip
from workbench.compare.measures import BLOCK_S, rms
from workbench.compare.phases import PHASES
from workbench.compare.slip_matching import MatchedSlip, SlipEvents
from workbench.data.noise_floor import UNKNOWN

CERTAIN_DEVIATIONS = 3.5
MOVES = 20.0
"""What counts as motion, so many times: a stem that goes so far one way has moved, without a slip too; noise goes 9."""
FEWEST_SLIPS_JUDGED = 3
MOST_LISTED = 8
"""Notes listed one by one."""
NAMED_PHASE_SHARE = 0.5
"""Part of the squared error from which a phase is named."""
MOST_TOLD_STRETCHES = 20
"""Of a sentence, the gravest."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of time, s since the start; of a slip, from the stem's beginning to the model's."""

    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Sentence:
    """What is said, and where it shows, the gravest first; nowhere: it is of the whole recording."""

    text: str
    stretches: tuple[Stretch, ...] = ()


Graded = tuple[float, Sentence]
"""A sentence, and how grave it is, m."""


@dataclass(frozen=True, slots=True)
class Findings:
    """What the sentences are made from; arrays over the valid samples."""

    time_s: Column
    residual_m: Column
    position_m: Column
    phase: NDArray[np.int64]
    direction: Column
    floor_m: float | None
    scale_m: float
    """What counts as motion, and as an error that matters where the floor is unknown."""
    rms_m: float
    events: SlipEvents
    measured_slips: tuple[Slip, ...]
    depends_on_input: bool
    length: Scale
    """As positions and errors are read."""
    close: bool
    """The error is at most 1.5 times the floor."""

    def mm(self, value_m: float) -> str:
        """Say a length, in mm of what slides."""
        return self.length.said(value_m, ".2g")

    @property
    def matters_m(self) -> float:
        """A mean error that matters is more."""
        return self.scale_m if self.floor_m is None else self.floor_m

    @property
    def ways(self) -> tuple[int, ...]:
        """The directions in which the stem moves, 1 opening, -1 closing: it slips so, or goes so far without a slip."""
        x = self.position_m
        slipped = {each.direction for each in self.measured_slips}
        if not x.size:
            return tuple(slipped)
        far_m = MOVES * self.scale_m
        gone = {1: float((x - np.minimum.accumulate(x)).max()), -1: float((np.maximum.accumulate(x) - x).max())}
        return tuple(way for way, travel_m in gone.items() if way in slipped or travel_m > far_m)

    @property
    def adequate(self) -> bool:
        """Close to the floor, without structure, and the recording has motion to judge by."""
        unmatched = self.events.missed_s or self.events.spurious_s
        return bool(self.ways) and self.close and not self.depends_on_input and not unmatched


def judge_findings(found: Findings) -> tuple[Sentence, ...]:
    """Return what is to be said."""
    if not found.ways:
        spurious = found.events.spurious_s
        tail = f", the model makes {_count(len(spurious), 'spurious ')}" if spurious else ""
        text = f"the stem does not move in this recording{tail}: it says nothing of spring or friction in motion"
        still = Sentence(text, _at(spurious))
        return (still,) if found.floor_m is not None else (still, Sentence(UNKNOWN))
    said = []
    if len(found.ways) == 1:
        way = "opens" if found.ways[0] > 0 else "closes"
        said.append(Sentence(f"the stem only {way} in this recording: the other direction is not judged"))
    if not found.measured_slips:
        went = found.mm(float(np.ptp(found.position_m)))
        text = f"the stem goes over {went} and never comes to rest: break-away and rests are not judged"
        said.append(Sentence(text))
    if found.adequate:
        errors = f"error {found.mm(found.rms_m)}, floor {found.mm(found.matters_m)}"
        return (*said, Sentence(f"the model holds: {errors}, no structure left"))
    graded = [*_along_motion(found), *_late(found), *_offset(found), *_trends(found)]
    said += [each for _, each in sorted(graded, key=lambda each: -each[0])]
    return (*said, *_slips(found), *_share(found), *_rest(found, bool(graded)))


def sentences(found: Findings) -> tuple[str, ...]:
    """Return the sentences alone."""
    return tuple(each.text for each in judge_findings(found))


def slip_sentences(events: SlipEvents, length: Scale) -> Mapping[str, tuple[str, ...]]:
    """Say of each slip what the model makes of it: missed, spurious and matched ones, in their order."""
    return {
        "missed": tuple(f"at {each:.2f} s the stem slips, and the model does not" for each in events.missed_s),
        "spurious": tuple(f"at {each:.2f} s the model slips, and the stem does not" for each in events.spurious_s),
        "matched": tuple(_slip(each, length) for each in events.matched),
    }


def _slip(each: MatchedSlip, length: Scale) -> str:
    way = f"{'opening' if each.direction > 0 else 'closing'}, {'after a reversal' if each.reversal else 'going on'}"
    late = f"{_seconds(abs(each.late_s))} {'late' if each.late_s > 0.0 else 'early'}" if each.late_s else "on time"
    far = f"{length.said(abs(each.farther_m), '.2g')} too {'far' if each.farther_m > 0.0 else 'short'}"
    return f"slip at {each.time_s:.2f} s, {way}: the model comes {late} and ends {far}"


def shorten_notes(notes: Sequence[str]) -> tuple[str, ...]:
    """Return what is said of a recording, many of a kind only begun: a bad line may lose samples by the thousand."""
    if len(notes) <= MOST_LISTED + 1:
        return tuple(notes)
    return (*notes[:MOST_LISTED], f"and {len(notes) - MOST_LISTED} more of the kind")


def _along_motion(found: Findings) -> Iterator[Graded]:
    """Too far or too short at the end of slips, after reversals and otherwise."""
    for when, reversal in (("after a reversal, the model slips", True), ("without a reversal, the model slips", False)):
        pairs = [each for each in found.events.matched if each.reversal == reversal]
        yield from _by_direction(
            pairs, [each.farther_m for each in pairs], found.matters_m, when, ("too far", "too short"), found.mm
        )


def _late(found: Findings) -> Iterator[Graded]:
    """Slips that come too late or too early; graded as if it stood wrong by a median slip for that long."""
    pairs = found.events.matched
    period_s = float(np.median(np.diff(found.time_s))) if found.time_s.size > 1 else 0.0
    graded = _by_direction(
        pairs, [each.late_s for each in pairs], 2.0 * period_s, "the model slips", ("too late", "too early"), _seconds
    )
    for _, sentence in graded:
        yield 0.5 * found.rms_m, sentence


def _by_direction(
    pairs: Sequence[MatchedSlip],
    values: Sequence[float],
    matters: float,
    when: str,
    words: tuple[str, str],
    unit: Callable[[float], str],
) -> Iterator[Graded]:
    """Say a mean over slips that is certain in both directions, alike or not, or in one only."""
    means = {}
    for direction in (1, -1):
        part = np.array([value for pair, value in zip(pairs, values, strict=True) if pair.direction == direction])
        if part.size >= FEWEST_SLIPS_JUDGED:
            mean, error = float(np.median(part)), float(np.std(part, ddof=1)) / part.size**0.5
            if _certain(mean, error, matters):
                means[direction] = mean
    if not means:
        pooled = np.array(values)
        if pooled.size >= FEWEST_SLIPS_JUDGED and len({each.direction for each in pairs}) == 2:
            mean, error = float(np.median(pooled)), float(np.std(pooled, ddof=1)) / pooled.size**0.5
            if _certain(mean, error, matters):
                text = f"{when} {unit(abs(mean))} {words[0] if mean > 0 else words[1]}, both directions"
                yield abs(mean), Sentence(text, _of_slips(pairs, values, (1, -1)))
        return
    told = {way: f"{unit(abs(mean))} {words[0] if mean > 0 else words[1]}" for way, mean in means.items()}
    grade = max(abs(mean) for mean in means.values())
    if len(means) == 1:
        ((way, amount),) = told.items()
        text = f"{when} {amount}, only when {'opening' if way > 0 else 'closing'}"
    elif means[1] * means[-1] > 0.0 and 0.5 < means[1] / means[-1] < 2.0:
        both = 0.5 * (means[1] + means[-1])
        text = f"{when} {unit(abs(both))} {words[0] if both > 0 else words[1]}, both directions"
    else:
        text = f"{when} {told[1]} when opening and {told[-1]} when closing"
    yield grade, Sentence(text, _of_slips(pairs, values, tuple(means)))


def _offset(found: Findings) -> Iterator[Graded]:
    mean, error = _block_mean(found, np.ones(found.time_s.size, np.bool_))
    if _certain(mean, error, found.matters_m) and abs(mean) > 0.5 * found.rms_m:
        text = f"the model stands {found.mm(abs(mean))} too {'high' if mean > 0 else 'low'} throughout"
        yield abs(mean), Sentence(text)


def _trends(found: Findings) -> Iterator[Graded]:
    """Errors that grow over the stroke or with time."""
    for over, what, unit in (
        (found.position_m, "over the stroke", found.mm),
        (found.time_s, "with time", _seconds),
    ):
        if np.ptp(over) == 0.0:
            continue
        blocks = _blocks(found.time_s)
        count = np.bincount(blocks)
        x, y = np.bincount(blocks, over) / count, np.bincount(blocks, found.residual_m) / count
        independent = min(x.size, len(found.measured_slips))
        if independent < 8 or np.ptp(x) == 0.0:
            continue
        slope, intercept = np.polyfit(x, y, 1)
        spread = float(np.std(y - slope * x - intercept)) / (float(np.std(x)) * (independent - 2) ** 0.5)
        low, high = float(np.min(x)), float(np.max(x))
        change = float(slope) * (high - low)
        if _certain(float(slope), spread, 0.0) and abs(change) > max(2.0 * found.matters_m, found.rms_m):
            at_low, at_high = slope * low + intercept, slope * high + intercept
            first, last = (found.length.said(each, "+.2g") for each in (at_low, at_high))
            text = f"the error changes {what}: {first} at {unit(low)}, {last} at {unit(high)}"
            yield 0.5 * abs(change), Sentence(text, _runs(found, blocks, np.abs(y)))


def _slips(found: Findings) -> Iterator[Sentence]:
    missed, spurious = len(found.events.missed_s), len(found.events.spurious_s)
    of = len(found.events.matched) + missed  # the others are pieces of a slide, or too small to count
    said = [f"misses {missed} of {of} slips"] if missed else []
    if spurious:
        said.append(f"makes {_count(spurious, 'spurious ')}")
    if said:
        yield Sentence(f"the model {' and '.join(said)}", _at((*found.events.missed_s, *found.events.spurious_s)))


def _share(found: Findings) -> Iterator[Sentence]:
    squares = np.bincount(found.phase, found.residual_m**2, len(PHASES))
    worst = int(squares.argmax())
    share = float(squares[worst] / squares.sum()) if squares.sum() else 0.0
    if share > NAMED_PHASE_SHARE:
        inside = found.phase == worst
        part = found.residual_m[inside]
        where = "near the stops" if PHASES[worst] == "near stops" else f"in phase {PHASES[worst]!r}"
        text = f"{100 * share:.0f} % of the squared error is {where}, {found.mm(rms(part))} rms"
        run = np.cumsum(np.diff(inside, prepend=inside[0]))
        grade = np.bincount(run, np.where(inside, found.residual_m**2, 0.0)).astype(np.float64)
        yield Sentence(text, _runs(found, run, grade))


def _rest(found: Findings, named: bool) -> Iterator[Sentence]:
    if found.floor_m is None:
        yield Sentence(f"the error is {found.mm(found.rms_m)} rms; {UNKNOWN}", _worst(found))
        return
    times = found.rms_m / found.floor_m if found.floor_m else np.inf
    if not found.close:
        text = f"the error, {found.mm(found.rms_m)} rms, is {times:.1f} times the floor of {found.mm(found.floor_m)}"
        yield Sentence(text, _worst(found))
    if found.depends_on_input and not named:
        yield Sentence("what is left depends on the command")


def _at(times_s: Sequence[float]) -> tuple[Stretch, ...]:
    return tuple(Stretch(each, each) for each in times_s[:MOST_TOLD_STRETCHES])


def _of_slips(pairs: Sequence[MatchedSlip], values: Sequence[float], ways: Sequence[int]) -> tuple[Stretch, ...]:
    """Return where the slips of these directions are, those with the largest values first."""
    both = sorted(zip(values, pairs, strict=True), key=lambda each: -abs(each[0]))
    slips = [pair for _, pair in both if pair.direction in ways][:MOST_TOLD_STRETCHES]
    return tuple(Stretch(*sorted((each.time_s, each.time_s + each.late_s))) for each in slips)


def _worst(found: Findings) -> tuple[Stretch, ...]:
    """Return the blocks of 1 s with the largest squared error."""
    blocks = _blocks(found.time_s)
    return _runs(found, blocks, np.bincount(blocks, found.residual_m**2).astype(np.float64))


def _runs(found: Findings, run: NDArray[np.int64], grade: Column) -> tuple[Stretch, ...]:
    """Return the runs of samples of one number, rising along the recording, by the grade of each; of grade 0 none."""
    order = np.argsort(run, kind="stable")  # a clock that is set back leaves them out of order
    first = order[np.searchsorted(run[order], np.arange(grade.size))]
    last = order[np.searchsorted(run[order], np.arange(grade.size), side="right") - 1]
    gravest = [each for each in np.argsort(-grade, kind="stable")[:MOST_TOLD_STRETCHES] if grade[each] > 0.0]
    return tuple(Stretch(float(found.time_s[first[each]]), float(found.time_s[last[each]])) for each in gravest)


def _blocks(time_s: Column) -> NDArray[np.int64]:
    _, member = np.unique(np.floor((time_s - time_s[0]) / BLOCK_S), return_inverse=True)
    return np.asarray(member, dtype=np.int64)


def _block_mean(found: Findings, rows: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the mean residual and its standard error over blocks of 1 s."""
    blocks = _blocks(found.time_s[rows])
    means = np.bincount(blocks, found.residual_m[rows]) / np.bincount(blocks)
    independent = min(means.size, len(found.measured_slips))
    if independent < FEWEST_SLIPS_JUDGED:
        return float(means.mean()), np.inf
    return float(means.mean()), float(np.std(means, ddof=1)) / independent**0.5


def _certain(mean: float, error: float, matters: float) -> bool:
    return abs(mean) > CERTAIN_DEVIATIONS * error and abs(mean) > matters


def _count(slips: int, kind: str = "") -> str:
    return f"{slips} {kind}slip{'s' if slips > 1 else ''}"


def _seconds(value_s: float) -> str:
    return f"{value_s:.2g} s"
