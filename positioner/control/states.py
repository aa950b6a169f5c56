"""The states of the seed's control logic (4.1), as a function of the situation.

    S0 start      holds the pressure, or applies the manual one
    S1 up         delta r > 0: the law for upward motion
    S2 down       delta r < 0: the law for downward motion
    S3 identify   eta_1 = 0: the excitation

What must be remembered lies in delta r, so the same situation always gives the same state, and S3 gives back
the law it interrupted by itself.
"""

from config.codes import AUTOMATIC, S0, S1, S2, S3, InhibitReason, Mode, State


def state_in(*, automatic: bool, exciting: bool, is_ready: bool, delta_r_m: float) -> State:
    """Return the state that a situation calls for."""
    if not automatic:
        return S0
    if exciting:
        return S3
    if not is_ready or delta_r_m == 0.0:
        return S0
    return S1 if delta_r_m > 0.0 else S2


def law_inhibit_reason(state: State, mode: Mode, *, is_ready: bool, is_dropped: bool) -> InhibitReason:
    """Return why a state is S0; NOTHING of any other.

    Args:
        state, mode: in force.
        is_ready: whether the law has what it needs.
        is_dropped: whether what was restored was dropped, and nothing has taken its place.
    """
    if state is not S0:
        return InhibitReason.NOTHING
    if mode is not AUTOMATIC:
        return InhibitReason.NOT_AUTOMATIC
    if not is_ready:
        return InhibitReason.RESTORED_CONTRADICTED if is_dropped else InhibitReason.NO_ESTIMATES
    return InhibitReason.NO_MOVE_ASKED
