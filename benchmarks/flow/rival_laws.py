"""Published compensators of stiction, as laws: what they add to the pressure of a valve that has no positioner.

    u = κ r + offset + f                      r the DCS's output; the stem is not looked at

    knocker     f = a sign(r - r_p)           for τ, every h      (Hägglund 2002: a 1 to 4 %, h 2 to 5 scans, τ 1 to 2)
    constant    f = a sign(r_n - r_(n-1))     reinforcement, a scan long      (Ivan and Lakshminarayanan 2009)
    two moves   f = a sign(r - r_p)           for τ, then 0 until r has changed by more than the dead band
                                                                               (Srinivasan and Rengaswamy 2008)
    pulses      f = min(a, abs(r - r_p)/2 + a/4) sign(r - r_p)     as the knocker, amplitudes by what is asked
                                                                               (Arifin et al. 2018, by r for the error)

a is in the same unit as r, p.u.; r_p the reference at the last pulse or move. The papers give a in stick bands S, of
this valve (F_s + F_c)/k_s = 5.9 % of stroke: S/2 reaches the one end of the band from its middle.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.boundary import Seen, Unlearning
from positioner.control.pressure_clamp import clamped


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalSettings:
    """Which one, and how it is tuned: p.u., s."""

    kind: str
    amplitude: float
    lasts_s: float
    every_s: float
    stroke_m: float
    minimum_pa: float
    maximum_pa: float

    by_single_steps: ClassVar[bool] = False

    @classmethod
    def of(cls, _file: DaemonFile, /) -> Self:
        raise NotImplementedError("a rival is tuned by a benchmark, no file names it")

    def begin(self, held_pa: float) -> "RivalLaw":
        """Return the law under a command, Pa."""
        return RivalLaw(held_pa, self)


@dataclass(frozen=True, slots=True)
class RivalLaw(Unlearning):
    """A compensator with what it remembers: references, p.u., and when the last pulse began, s."""

    command_pa: float
    settings: RivalSettings
    last: float = 0.0
    pulsed: float = 0.0
    begun_s: float = -1e9
    added: float = 0.0
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def observe(self, seen: Seen) -> "RivalLaw":
        """Return the law after one sample."""
        settings, r = self.settings, seen.reference_m / self.settings.stroke_m
        if seen.ratios is None:
            return replace(self, command_pa=seen.command_pa, last=r, pulsed=r)
        law = ADDED[settings.kind](self, r, seen.sample.now_s, seen.dead_band_m / settings.stroke_m)
        slope_pa = -seen.ratios.b_over_c * settings.stroke_m
        wanted_pa = slope_pa * (r + law.added) + seen.ratios.offset_pa
        return replace(law, last=r, command_pa=clamped(wanted_pa, settings.minimum_pa, settings.maximum_pa))


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


def _knocked(law: RivalLaw, r: float, now_s: float, amplitude: float) -> RivalLaw:
    if now_s - law.begun_s >= law.settings.every_s:
        return replace(law, pulsed=r, begun_s=now_s, added=amplitude * _sign(r - law.pulsed))
    ended = now_s - law.begun_s >= law.settings.lasts_s
    return replace(law, added=0.0) if ended else law


def _knocker(law: RivalLaw, r: float, now_s: float, _band: float) -> RivalLaw:
    return _knocked(law, r, now_s, law.settings.amplitude)


def _pulses(law: RivalLaw, r: float, now_s: float, _band: float) -> RivalLaw:
    amplitude = law.settings.amplitude
    return _knocked(law, r, now_s, min(amplitude, 0.5 * abs(r - law.pulsed) + 0.25 * amplitude))


def _constant(law: RivalLaw, r: float, now_s: float, _band: float) -> RivalLaw:
    return law if r == law.last else replace(law, added=law.settings.amplitude * _sign(r - law.last), begun_s=now_s)


def _two_moves(law: RivalLaw, r: float, now_s: float, band: float) -> RivalLaw:
    under_way = now_s - law.begun_s < law.settings.lasts_s
    if not under_way and abs(r - law.pulsed) > band:
        return replace(law, pulsed=r, begun_s=now_s, added=law.settings.amplitude * _sign(r - law.pulsed))
    return law if under_way else replace(law, added=0.0)


ADDED: dict[str, Callable[[RivalLaw, float, float, float], RivalLaw]] = {
    "knocker": _knocker,
    "constant reinforcement": _constant,
    "two moves": _two_moves,
    "pulses of variable amplitude": _pulses,
}
