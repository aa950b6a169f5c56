"""A conventional positioner, as a law to compare the others with: PI on position with a dead band of the integral.

    u = K κ e + I                              e = r - x,  κ = -b/c = k_s/A
    I += κ e min(R dt, 1 - 2 K)                while abs(e) > dead band and u is within the limits

It knows the spring, as a positioner does from its calibration stroke, and nothing of the friction. Beside the period of
the loop the stem is fast (9 and 3 ms): sliding it is a gain 1/κ, and with g = R dt the loop's equation is

    z^2 + (K + g - 1) z - K = 0                stable for g < 2 - 2 K; g <= 1 - 2 K is a gain margin of 2

K and R are those that do best in a flow loop: `docs/law.md`.
"""

from dataclasses import dataclass
from typing import ClassVar, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.boundary import Seen, Unlearning
from positioner.control.pressure_clamp import clamped
from positioner.estimation.acceptance import Ratios

GAIN = 0.1
"""K"""
INTEGRAL_RATE_PER_S = 8.0
"""R"""


@dataclass(frozen=True, slots=True)
class ConventionalSettings:
    """Settings of the law: m, Pa, K and R."""

    minimum_pa: float
    maximum_pa: float
    gain: float = GAIN
    integral_rate_per_s: float = INTEGRAL_RATE_PER_S

    by_single_steps: ClassVar[bool] = False

    @classmethod
    def of(cls, file: DaemonFile) -> Self:
        """Return what a daemon's file says of the law."""
        pressure = file.pressure
        return cls(pressure.minimum_pa, pressure.maximum_pa)

    def begin(self, held_pa: float) -> "ConventionalLaw":
        """Return the law under a command, Pa."""
        return ConventionalLaw(held_pa, self)


@dataclass(frozen=True, slots=True)
class ConventionalLaw(Unlearning):
    """The law with what it remembers from one step to the next."""

    command_pa: float
    settings: ConventionalSettings
    integral_pa: float | None = None
    """None while another state commands."""
    now_s: float = 0.0
    """Of the last good sample."""
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def observe(self, seen: Seen) -> "ConventionalLaw":
        """Return the law after one sample: while another state commands it takes over that one's pressure."""
        if seen.ratios is None:
            return ConventionalLaw(seen.command_pa, self.settings)
        if not seen.usable:
            return self
        return self.after(seen.sample.now_s, seen.reference_m - seen.sample.position_m, seen.ratios, seen.dead_band_m)

    def after(self, now_s: float, error_m: float, ratios: Ratios, dead_band_m: float) -> "ConventionalLaw":
        """Return the law after one good sample of an error, m; the first goes on from the pressure without a bump."""
        settings = self.settings
        error_pa = -ratios.b_over_c * error_m
        proportional_pa = settings.gain * error_pa
        if self.integral_pa is None:
            return ConventionalLaw(self.command_pa, settings, self.command_pa - proportional_pa, now_s)
        integral_pa = self.integral_pa
        if abs(error_m) > dead_band_m:
            share = min(settings.integral_rate_per_s * (now_s - self.now_s), 1 - 2 * settings.gain)
            integral_pa += share * error_pa
        wanted_pa = proportional_pa + integral_pa
        command_pa = clamped(wanted_pa, settings.minimum_pa, settings.maximum_pa)
        kept_pa = integral_pa if command_pa == wanted_pa else self.integral_pa
        return ConventionalLaw(command_pa, settings, kept_pa, now_s)
