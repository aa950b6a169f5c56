"""A conventional positioner, as a law to compare the others with: PI on position with a dead band of the integral.

    u = K κ e + I                              e = r - x,  κ = -b/c = k_s/A
    I += κ e min(R dt, 1 - 2 K)                while abs(e) > dead band and u is within the limits

It knows the spring, as a positioner does from its calibration stroke, and nothing of the friction. Beside the period of
the loop the stem is fast (9 and 3 ms): sliding it is a gain 1/κ, and with g = R dt the loop's equation is

    z^2 + (K + g - 1) z - K = 0                stable for g < 2 - 2 K; g <= 1 - 2 K is a gain margin of 2

K and R are those that do best in a flow loop: `docs/law.md`.
"""

from dataclasses import dataclass

from config.codes import InhibitReason
from positioner.estimation.acceptance import Ratios

GAIN = 0.1
INTEGRAL_RATE_PER_S = 8.0


@dataclass(frozen=True, slots=True)
class ConventionalSettings:
    """Settings of the law: m, Pa, K and R."""

    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    gain: float = GAIN
    integral_rate_per_s: float = INTEGRAL_RATE_PER_S


@dataclass(frozen=True, slots=True)
class ConventionalMemory:
    """What the law remembers from one step to the next."""

    level_pa: float
    """The pressure asked for."""
    integral_pa: float | None = None
    """None while another state commands."""
    now_s: float = 0.0
    """Of the last good sample."""
    inhibit_reason: InhibitReason = InhibitReason.NOTHING


def while_not_commanding(command_pa: float) -> ConventionalMemory:
    """Return the memory while another state commands: from its pressure the law goes on without a bump."""
    return ConventionalMemory(command_pa)


def step(
    memory: ConventionalMemory, now_s: float, error_m: float, ratios: Ratios, settings: ConventionalSettings
) -> ConventionalMemory:
    """Return what is remembered after one good sample; its `level_pa` is the pressure asked for."""
    error_pa = -ratios.b_over_c * error_m
    proportional_pa = settings.gain * error_pa
    if memory.integral_pa is None:
        return ConventionalMemory(memory.level_pa, memory.level_pa - proportional_pa, now_s)
    integral_pa = memory.integral_pa
    if abs(error_m) > settings.dead_band_m:
        share = min(settings.integral_rate_per_s * (now_s - memory.now_s), 1 - 2 * settings.gain)
        integral_pa += share * error_pa
    wanted_pa = proportional_pa + integral_pa
    level_pa = min(max(wanted_pa, settings.minimum_pa), settings.maximum_pa)
    return ConventionalMemory(level_pa, integral_pa if level_pa == wanted_pa else memory.integral_pa, now_s)
