"""The table of the seed's figure 2: every situation, the state it calls for, and what it says of itself."""

import pytest

from config.codes import InhibitReason, Mode, State
from positioner.control.states import law_inhibit_reason, state_in

S0, S1, S2, S3 = State

TABLE = [
    # automatic, exciting, law ready, delta r -> state, why
    (False, False, False, 0.0, S0, InhibitReason.NOT_AUTOMATIC),
    (False, False, True, 0.1, S0, InhibitReason.NOT_AUTOMATIC),
    (False, True, True, 0.1, S0, InhibitReason.NOT_AUTOMATIC),
    (True, False, False, 0.0, S0, InhibitReason.NO_ESTIMATES),
    (True, False, False, 0.1, S0, InhibitReason.NO_ESTIMATES),
    (True, False, True, 0.0, S0, InhibitReason.NO_MOVE_ASKED),
    (True, False, True, 0.1, S1, InhibitReason.NOTHING),
    (True, False, True, 1e-12, S1, InhibitReason.NOTHING),
    (True, False, True, -0.1, S2, InhibitReason.NOTHING),
    (True, True, False, 0.0, S3, InhibitReason.NOTHING),
    (True, True, True, 0.1, S3, InhibitReason.NOTHING),
    (True, True, True, -0.1, S3, InhibitReason.NOTHING),
]


@pytest.mark.parametrize(("automatic", "exciting", "ready", "delta", "state", "why"), TABLE)
def test_state_and_its_reason(
    automatic: bool, exciting: bool, ready: bool, delta: float, state: State, why: InhibitReason
) -> None:
    assert state_in(automatic=automatic, exciting=exciting, is_ready=ready, delta_r_m=delta) is state
    mode = Mode.AUTOMATIC if automatic else Mode.HOLD
    assert law_inhibit_reason(state, mode, is_ready=ready, is_dropped=False) is why
