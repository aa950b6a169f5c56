"""How far a packing gives way, from changes that did not break its stem loose: by hand."""

import pytest

from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.packing_compliance import compliance

GIVES_M_PER_PA = 1e-7
STD_M = 1e-6


def change(step_pa: float, way_m: float, from_pa: float | None = 50e3) -> SlideOutcome:
    """Return what a change of the command did to a stem that did not break loose."""
    return SlideOutcome(
        time_s=0.0,
        direction=1 if step_pa > 0 else -1,
        from_m=0.05,
        command_pa=50e3 + step_pa,
        position_m=0.05 + way_m,
        std_m=STD_M,
        moved=False,
        landing=False,
        from_pa=from_pa,
    )


def test_it_is_what_changes_gave_way_by_each_direction_for_itself() -> None:
    held = tuple(change(step_pa, GIVES_M_PER_PA * step_pa) for step_pa in (4e3, 1e3, 2e3))
    found = compliance(held, 1)
    assert found is not None
    assert found.m_per_pa == pytest.approx(GIVES_M_PER_PA)
    assert found.spread < 1e-6
    assert compliance(held, -1) is None
    assert found.explains(change(3e3, 1.4 * GIVES_M_PER_PA * 3e3))
    assert not found.explains(change(3e3, 1.6 * GIVES_M_PER_PA * 3e3))


def test_the_latest_counts_most_and_what_lies_apart_is_said() -> None:
    found = compliance((change(2e3, 2 * GIVES_M_PER_PA * 2e3), change(2e3, GIVES_M_PER_PA * 2e3)), 1)
    assert found is not None
    assert 1.6 * GIVES_M_PER_PA < found.m_per_pa < 1.7 * GIVES_M_PER_PA
    assert found.spread > 0.2


@pytest.mark.parametrize(
    "held",
    [(), (change(4e3, 3e-6),), (change(4e3, -1e-4),), (change(4e3, 1e-4, from_pa=None),)],
    ids=["nothing is known", "no more than the position is known", "the other way", "from a stem that moved"],
)
def test_a_stiff_packing_gives_nothing(held: tuple[SlideOutcome, ...]) -> None:
    assert compliance(held, 1) is None
