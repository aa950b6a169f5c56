"""A segment of a record: motion in one direction, with the rest that it began from."""

from dataclasses import dataclass

from positioner.estimation.array import Array


@dataclass(frozen=True, slots=True)
class MotionSegment:
    """Samples of one motion, (N,) each, SI units.

    Attributes:
        direction: +1 up, -1 down.
        time_s: increasing.
        position_m: measured.
        pressure_pa: held: of the interval before each sample; else at each sample.
        begins: the last sample before the stem measurably moves; 0: it moved already.
        earliest: the first sample after which it may have begun; from it to `begins` the stem rests or has hardly left.
    """

    direction: int
    time_s: Array
    position_m: Array
    pressure_pa: Array
    begins: int
    earliest: int
