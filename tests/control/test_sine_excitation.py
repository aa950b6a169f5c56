"""The excitation of S3 and the reasons to refuse one."""

import math

import pytest

from config.codes import InhibitReason
from positioner.control.sine_excitation import SineExcitation


def test_the_signal_is_that_of_25() -> None:
    excitation = SineExcitation(44126.0, 13238.0, 1.0)
    assert excitation.pressure_pa(0.0) == 44126.0
    assert excitation.pressure_pa(math.pi / 2) == pytest.approx(44126.0 + 13238.0)


@pytest.mark.parametrize(
    ("alpha", "beta", "breakaway", "why"),
    [
        (44e3, 13e3, None, InhibitReason.NOTHING),
        (44e3, 13e3, 26e3, InhibitReason.NOTHING),
        (26e3, 13e3, 26e3, InhibitReason.ALPHA_BELOW_BREAKAWAY),
        (20e3, 13e3, None, InhibitReason.NOTHING),
        (44e3, 0.0, None, InhibitReason.AMPLITUDE_ZERO),
        (44e3, 45e3, None, InhibitReason.EXCITATION_BEYOND_LIMITS),
        (390e3, 31e3, None, InhibitReason.EXCITATION_BEYOND_LIMITS),
        (389e3, 31e3, None, InhibitReason.NOTHING),
    ],
)
def test_refusals(alpha: float, beta: float, breakaway: float | None, why: InhibitReason) -> None:
    assert SineExcitation(alpha, beta, 1.0).problem(0.0, 420e3, breakaway) is why
