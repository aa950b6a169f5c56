"""The seed's law: the pressure that balances spring and Coulomb friction at the reference.

    x'' = a x' + b x + k sign(x') + c u          (4)
    S1, moving up:    u = -(b_e r + k_e) / c_e    (23, corrected)
    S2, moving down:  u = -(b_e r - k_e) / c_e    (24, corrected)

With b/c = -k_s/A < 0 and k/c = -F_c/A < 0 the stem meets no net force at x = r when it arrives there, and the
stable valve (poles of s^2 - a s - b) brings it there by itself. Only the two ratios are needed (`Ratios.balance_pa`);
of an extended valve, its own pressure for the place and the direction. In which direction it arrives, `course.py` says.
"""

from dataclasses import dataclass
from typing import ClassVar, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.boundary import Seen, Unlearning
from positioner.control.laws.seed.course import AWAY, Course

NO_COURSE = Course()


@dataclass(frozen=True, slots=True)
class SeedSettings:
    """The full travel, m."""

    stroke_m: float

    by_single_steps: ClassVar[bool] = True

    @classmethod
    def of(cls, file: DaemonFile, /) -> Self:
        """Return what a daemon's file says of the law."""
        return cls(file.valve.stroke_m)

    def begin(self, held_pa: float) -> "SeedLaw":
        """Return the law under a command, Pa."""
        return SeedLaw(self, held_pa)


@dataclass(frozen=True, slots=True)
class SeedLaw(Unlearning):
    """The law with its command, and the direction in which the stem comes to its reference."""

    settings: SeedSettings
    command_pa: float
    course: Course = NO_COURSE
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def observe(self, seen: Seen) -> "SeedLaw":
        """Return the law with the pressure for the reference."""
        settings = self.settings
        if seen.ratios is None:
            idle = seen.command_pa == self.command_pa and self.course is NO_COURSE
            return self if idle else SeedLaw(settings, seen.command_pa)
        rest = seen.statics.detector.rest if seen.usable else None
        rest_m = None if rest is None else rest.position_m
        course = self.course.after(seen.reference_m, seen.direction, seen.command_pa, rest_m, settings.stroke_m)
        balance = seen.ratios.balance_pa if seen.statics.valve is None else seen.statics.valve.landing_pa
        command_pa, why = balance(seen.reference_m, course.direction), _why_away(seen, settings)
        if course is self.course and (command_pa, why) == (self.command_pa, self.inhibit_reason):
            return self
        return SeedLaw(settings, command_pa, course, why)


def _why_away(seen: Seen, settings: SeedSettings) -> InhibitReason:
    """Return why a stem that is away from its reference is not under way to it: no rest, or not under its command."""
    away = seen.usable and abs(seen.reference_m - seen.sample.position_m) > AWAY * settings.stroke_m
    return seen.statics.detector.waits_for if away else InhibitReason.NOTHING
