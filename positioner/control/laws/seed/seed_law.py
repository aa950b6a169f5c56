"""The seed's law: the pressure that balances spring and Coulomb friction at the reference.

    x'' = a x' + b x + k sign(x') + c u          (4)
    S1, moving up:    u = -(b_e r + k_e) / c_e    (23, corrected)
    S2, moving down:  u = -(b_e r - k_e) / c_e    (24, corrected)

With b/c = -k_s/A < 0 and k/c = -F_c/A < 0 the stem meets no net force at x = r when it arrives there, and the
stable valve (poles of s^2 - a s - b) brings it there by itself. Only the two ratios are needed (`Ratios.balance_pa`);
of an extended valve, its own pressure for the place and the direction.
"""

from dataclasses import dataclass
from typing import ClassVar, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.boundary import Seen, Unlearning


@dataclass(frozen=True, slots=True)
class SeedLaw(Unlearning):
    """The law; it remembers its command alone."""

    command_pa: float
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def observe(self, seen: Seen) -> "SeedLaw":
        """Return the law with the pressure for the reference."""
        if seen.ratios is None:
            return self if seen.command_pa == self.command_pa else SeedLaw(seen.command_pa)
        balance = seen.ratios.balance_pa if seen.statics.valve is None else seen.statics.valve.landing_pa
        return SeedLaw(balance(seen.reference_m, 1 if seen.direction > 0 else -1))


@dataclass(frozen=True, slots=True)
class SeedSettings:
    """It has none."""

    by_single_steps: ClassVar[bool] = True

    @classmethod
    def of(cls, _file: DaemonFile, /) -> Self:
        """Return them."""
        return cls()

    def begin(self, held_pa: float) -> SeedLaw:
        """Return the law under a command, Pa."""
        return SeedLaw(held_pa)
