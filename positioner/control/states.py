"""The states of the seed's control logic (4.1), as a function of the situation.

    S0 start      holds the pressure, or applies the manual one
    S1 up         delta r > 0: the law for upward motion
    S2 down       delta r < 0: the law for downward motion
    S3 identify   eta_1 = 0: the excitation

What must be remembered lies in delta r, so the same situation always gives the same state, and S3 gives back
the law it interrupted by itself.
"""

from typing import NamedTuple

from config.codes import S0, S1, S2, S3, InhibitReason, State
from positioner.control.records import by_name


class Situation(NamedTuple):
    """Everything the choice of state depends on."""

    automatic: bool
    exciting: bool
    law_ready: bool
    delta_r_m: float
    dropped: bool = False
    """Whether what was restored was dropped, and nothing has taken its place."""


situation_of = by_name(Situation)


def state_in(situation: Situation) -> State:
    """Return the state that a situation calls for."""
    automatic, exciting, law_ready, delta_r_m, _ = situation
    if not automatic:
        return S0
    if exciting:
        return S3
    if not law_ready or delta_r_m == 0.0:
        return S0
    return S1 if delta_r_m > 0.0 else S2


def law_inhibit_reason(situation: Situation) -> InhibitReason:
    """Return why neither S1 nor S2 is in force; NOTHING when one is, or when S3 occupies their place."""
    if not situation.automatic:
        return InhibitReason.NOT_AUTOMATIC
    if situation.exciting:
        return InhibitReason.NOTHING
    if not situation.law_ready:
        return InhibitReason.RESTORED_CONTRADICTED if situation.dropped else InhibitReason.NO_ESTIMATES
    return InhibitReason.NO_MOVE_ASKED if situation.delta_r_m == 0.0 else InhibitReason.NOTHING
