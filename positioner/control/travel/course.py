"""The course of the reference in force to the one asked for: low-pass, then ramp.

It begins where the reference in force is, so that neither a mode, nor S3, nor a restart makes it jump.
"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from config.daemon_file import DaemonFile
from positioner.control.travel.low_pass import LowPass
from positioner.control.travel.ramp import Ramp

END_BAND_SHARE = 1e-4
"""Of the stroke: an end of the low-pass, below every dead band that is of use (`[control] dead_band` is 5e-4)."""


class OnCourse(NamedTuple):
    """Where the course is: after the low-pass, after the ramp, m, and when, s on the clock of the cycle."""

    filtered_m: float
    reference_m: float
    at_s: float

    @classmethod
    def begun(cls, reference_m: float, now_s: float) -> "OnCourse":
        """Return a course that begins at a reference in force, m."""
        return cls(reference_m, reference_m, now_s)


@dataclass(frozen=True, slots=True)
class Course:
    """How the reference in force goes to the one asked for."""

    low_pass: LowPass
    ramp: Ramp

    @classmethod
    def of(cls, file: DaemonFile) -> "Course | None":
        """Return the course that a daemon's file asks for; None where the reference is followed at once."""
        table, travel = file.travel, file.valve.travel
        opening, closing = (
            travel.stroke_m / each if each > 0.0 else inf for each in (table.ramp_opening_s, table.ramp_closing_s)
        )
        if table.low_pass_s == 0.0 and opening == closing == inf:
            return None
        rates = (closing, opening) if travel.closes else (opening, closing)
        return cls(LowPass(table.low_pass_s, END_BAND_SHARE * travel.stroke_m), Ramp(*rates))

    def after(self, before: OnCourse, now_s: float, from_m: float, asked_m: float) -> OnCourse:
        """Return where it is by now on its way from the reference in force to the one asked for, m."""
        if before.reference_m != from_m:  # it was not its course that brought the reference there
            before = OnCourse.begun(from_m, before.at_s)
        lasted_s = max(now_s - before.at_s, 0.0)
        filtered_m = self.low_pass.after(before.filtered_m, asked_m, lasted_s)
        reference_m = self.ramp.after(before.reference_m, filtered_m, lasted_s)
        return OnCourse(filtered_m=filtered_m, reference_m=reference_m, at_s=now_s)
