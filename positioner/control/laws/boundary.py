"""What every law does. A law is a value: each sample gives the next one; it reads no clock and moves nothing itself.

    settings.begin(held_pa)       the law before its first sample, under the command that is in force
    law.observe(seen)             the law after one sample; while another state commands it only watches
    law.command_pa                the pressure that it asks for
    law.interrupted_pa(u)         what is held if something interrupts it after a command u: of a push what follows it
    law.known(knowledge)          what is kept over a restart, with what the law has learnt
    law.restored(knowledge)       the law with that

The folder of a law, found by its name, has `Settings`, the class of its settings.
"""

from importlib import import_module
from typing import ClassVar, NamedTuple, Protocol, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.keyword_records import by_name
from positioner.control.sample import Sample
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification


class Seen(NamedTuple):
    """What a law is shown in one step, SI units."""

    sample: Sample
    usable: bool
    """Whether the sample is new and could be true."""
    command_pa: float
    """The last command given."""
    reference_m: float
    dead_band_m: float
    """Error at rest that is left alone."""
    direction: int
    """In which the reference changed last: +1 up, -1 down, 0 not yet."""
    ratios: Ratios | None
    """None: another state commands, the law only watches."""
    outcome: SlideOutcome | None
    """Of the last change of the command, in the step in which it is known."""
    statics: StaticIdentification
    """Rests and landings of the stem, and the static law that they give."""


seen_of = by_name(Seen)


class Law(Protocol):
    """A law with all that it remembers."""

    @property
    def command_pa(self) -> float:
        """The pressure that it asks for, Pa."""
        ...

    @property
    def inhibit_reason(self) -> InhibitReason:
        """Why it does not do what is asked for; `NOTHING` where it does."""
        ...

    def observe(self, seen: Seen) -> Self:
        """Return the law after one sample."""
        ...

    def interrupted_pa(self, command_pa: float) -> float:
        """Return what to hold if something interrupts it after a command, Pa."""
        ...

    def known(self, knowledge: ValveKnowledge, statics: StaticIdentification, /) -> ValveKnowledge:
        """Return what is known of the valve with what the law has learnt."""
        ...

    def restored(self, knowledge: ValveKnowledge, /) -> Self:
        """Return the law with what it had learnt before a restart."""
        ...


class LawSettings(Protocol):
    """The settings of a law; they do not change while it runs."""

    by_single_steps: ClassVar[bool]
    """Whether it commands a pressure and waits for what that does, so that its moves can be told apart."""

    @classmethod
    def of(cls, file: DaemonFile, /) -> Self:
        """Return what a daemon's file says of the law."""
        ...

    def begin(self, held_pa: float) -> Law:
        """Return the law before its first sample, under a command in force, Pa."""
        ...


class Unlearning:
    """What a law is that learns nothing that would be kept over a restart."""

    def interrupted_pa(self, command_pa: float) -> float:
        """Return the command: there is nothing that has to follow it."""
        return command_pa

    def known(self, knowledge: ValveKnowledge, _statics: StaticIdentification, /) -> ValveKnowledge:
        """Return what is known without it."""
        return knowledge

    def restored(self, _knowledge: ValveKnowledge, /) -> Self:
        """Return the law as it is."""
        return self


def law_named(name: str) -> type[LawSettings]:
    """Return the class of a law's settings; which names there are, `config.law_names` says."""
    settings: type[LawSettings] = import_module(f"positioner.control.laws.{name}").Settings
    return settings
