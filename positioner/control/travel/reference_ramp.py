"""The course of the reference in force to the one asked for: low-pass, then ramp.

    y_n = y_(n-1) + (1 - exp(-dt / T)) (w - y_(n-1))          y = w as soon as |w - y| <= eps
    r_n = r_(n-1) + min(max(y - r_(n-1), -v_down dt), v_up dt)

w asked for, y after the low-pass, r in force. Without eps y would come ever nearer to w and never be there, and the law
would be asked for ever smaller moves. It begins where the reference in force is, so that neither a mode, nor S3, nor a
restart makes it jump.
"""

from dataclasses import dataclass
from math import expm1, inf
from typing import NamedTuple

from config.daemon_file import DaemonFile

END_BAND_SHARE = 1e-4
"""Of the stroke: eps, below every dead band that is of use (`[control] dead_band` is 5e-4)."""


class OnCourse(NamedTuple):
    """Where the course is: after the low-pass, after the ramp, m, and when, s on the clock of the cycle."""

    filtered_m: float
    reference_m: float
    at_s: float

    @classmethod
    def begun(cls, reference_m: float, now_s: float) -> "OnCourse":
        """Return a course that begins at a reference in force, m."""
        return cls(reference_m, reference_m, now_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """How the reference in force goes to the one asked for: T, s (0: none), eps, m, v_up and v_down, m/s."""

    time_constant_s: float
    near_m: float
    up_m_per_s: float
    down_m_per_s: float

    @classmethod
    def of(cls, file: DaemonFile) -> "Course | None":
        """Return the course that a daemon's file asks for; None where the reference is followed at once."""
        table, travel = file.travel, file.valve.travel
        opening, closing = (
            travel.stroke_m / each if each > 0.0 else inf for each in (table.ramp_opening_s, table.ramp_closing_s)
        )
        if table.low_pass_s == 0.0 and opening == closing == inf:
            return None
        up, down = (closing, opening) if travel.closes else (opening, closing)
        near_m = END_BAND_SHARE * travel.stroke_m
        return cls(time_constant_s=table.low_pass_s, near_m=near_m, up_m_per_s=up, down_m_per_s=down)

    def after(self, before: OnCourse, now_s: float, from_m: float, asked_m: float) -> OnCourse:
        """Return where it is by now on its way from the reference in force to the one asked for, m."""
        if before.reference_m != from_m:  # it was not its course that brought the reference there
            before = OnCourse.begun(from_m, before.at_s)
        lasted_s = max(now_s - before.at_s, 0.0)
        filtered_m = self._filtered_m(before.filtered_m, asked_m, lasted_s)
        if lasted_s == 0.0:
            return OnCourse(filtered_m=filtered_m, reference_m=before.reference_m, at_s=now_s)
        least_m = before.reference_m - self.down_m_per_s * lasted_s
        most_m = before.reference_m + self.up_m_per_s * lasted_s
        return OnCourse(filtered_m=filtered_m, reference_m=min(max(filtered_m, least_m), most_m), at_s=now_s)

    def _filtered_m(self, before_m: float, asked_m: float, lasted_s: float) -> float:
        if self.time_constant_s == 0.0:
            return asked_m
        left_m = (before_m - asked_m) * (1.0 + expm1(-lasted_s / self.time_constant_s))
        return asked_m if abs(left_m) <= self.near_m else asked_m + left_m
