"""The memory of the law that chooses the move: that of pulses and that of slides, and which of them has the stem."""

from dataclasses import dataclass
from math import nan

from config.codes import InhibitReason
from positioner.control.breakaway_memory import BreakawayMemory, BreakawaySettings
from positioner.control.slide_memory import SlideMemory, SlideSettings
from positioner.estimation.acceptance import Ratios


@dataclass(frozen=True, slots=True)
class MoveSettings:
    """Settings of the law: those of its moves."""

    pulses: BreakawaySettings
    slides: SlideSettings


@dataclass(frozen=True, slots=True)
class MoveMemory:
    """What the law remembers from one step to the next."""

    pulses: BreakawayMemory
    slides: SlideMemory
    by_pulses: bool = False
    """Whether pulses have the stem; else slides."""
    identified: Ratios | None = None
    """What pulses have taken over of the identification."""
    declined: tuple[float, int] = (nan, 0)
    """Reference, m, and slides given for it, for which no pulse was worth giving."""
    given_up: bool = False
    """Whether pulses do not move this valve: until it is identified anew."""
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    @property
    def level_pa(self) -> float:
        """The pressure asked for."""
        return self.pulses.level_pa if self.by_pulses else self.slides.level_pa

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: what follows a push, an excursion."""
        return self.pulses.held_pa(command_pa) if self.by_pulses else self.slides.held_pa(command_pa)
