"""Delta r is kept until the reference changes."""

from positioner.control.reference import Reference


def test_delta_is_the_last_change_and_stays() -> None:
    reference = Reference(0.02).follow(0.05)
    assert (reference.value_m, reference.delta_m) == (0.05, 0.05 - 0.02)
    assert reference.follow(0.05) == reference
    down = reference.follow(0.04)
    assert down.delta_m < 0
    assert down.follow(0.04).delta_m == down.delta_m


def test_a_fresh_reference_asks_for_no_move() -> None:
    assert Reference(0.02).delta_m == 0.0
