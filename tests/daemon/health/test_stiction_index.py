"""The stiction index: the part of the moves asked for that the stem did not make."""

import pytest

from positioner.daemon.health.stiction_index import StictionIndex

BAND_M = 5e-4


class Dcs:
    """Asks for moves of a stem that makes a part of each."""

    def __init__(self) -> None:
        self.index = StictionIndex(settle_s=1.0, band_m=lambda: BAND_M)
        self.now_s, self.stem_m, self.reference_m = 0.0, 0.05, 0.05
        self.wait(2.0)

    def wait(self, for_s: float) -> None:
        for _ in range(round(for_s / 0.1)):
            self.now_s += 0.1
            self.index.enter(self.now_s, self.stem_m, self.reference_m)

    def ask(self, move_m: float, made: float, hold_s: float = 2.0) -> None:
        self.reference_m += move_m
        self.wait(0.1)
        self.stem_m += made * (self.reference_m - self.stem_m)
        self.wait(hold_s)


def test_a_stem_that_follows_has_an_index_of_0_and_one_that_sticks_of_1() -> None:
    following, stuck = Dcs(), Dcs()
    for _ in range(10):
        following.ask(2e-3, made=0.9)
        stuck.ask(2e-3, made=0.0)
    assert (following.index.index, following.index.judged) == (0.0, 10)
    assert (stuck.index.index, stuck.index.judged) == (1.0, 10)


def test_the_index_is_the_share_of_moves_not_made() -> None:
    dcs = Dcs()
    for made in (1.0, 0.0, 1.0, 1.0):
        dcs.ask(2e-3, made)
    assert dcs.index.index == pytest.approx(0.25)


def test_it_forgets_after_a_repair() -> None:
    dcs = Dcs()
    for _ in range(20):
        dcs.ask(2e-3, made=0.0)
    for _ in range(60):
        dcs.ask(-2e-3, made=1.0)
    assert dcs.index.index < 0.06


def test_moves_within_the_dead_band_and_the_way_back_to_it_are_not_judged() -> None:
    dcs = Dcs()
    dcs.ask(0.5 * BAND_M, made=0.0)
    assert dcs.index.judged == 0


def test_a_move_superseded_before_it_could_be_made_is_judged_with_its_successor() -> None:
    dcs = Dcs()
    dcs.ask(2e-3, made=0.0, hold_s=0.4)
    dcs.ask(2e-3, made=1.0)
    assert (dcs.index.index, dcs.index.judged) == (0.0, 1)


def test_moves_that_follow_each_other_quickly_are_one_move_and_add_up() -> None:
    dcs = Dcs()
    dcs.ask(0.8 * BAND_M, made=0.0, hold_s=0.4)
    dcs.ask(0.8 * BAND_M, made=0.0)
    assert (dcs.index.index, dcs.index.judged) == (1.0, 1)


def test_a_move_made_does_not_answer_for_the_next() -> None:
    dcs = Dcs()
    dcs.ask(3e-3, made=1.0, hold_s=0.4)
    dcs.ask(1e-3, made=0.0)
    assert (dcs.index.index, dcs.index.judged) == (1.0, 1)


def test_an_interrupted_move_is_not_judged_nor_is_taking_over_a_move() -> None:
    dcs = Dcs()
    dcs.ask(2e-3, made=0.0, hold_s=0.5)
    dcs.index.interrupt()
    dcs.reference_m = 0.02
    dcs.wait(5.0)
    assert dcs.index.judged == 0
