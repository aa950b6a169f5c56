"""Margins learnt at one place of the travel serve at another."""

from dataclasses import replace

import numpy as np
import pytest

from positioner.control.laws.slides.margins_over_travel import with_margins_at
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_memory import Held, SlideMemory
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.slide_margins import NO_MARGINS, Margin, Margins
from positioner.estimation.landings.static_law import static_law

STROKE_M, SLOPE, F_C = 0.1, 800e3, 8e3
HARDENS, GROWS = 0.3, 0.3


def landing_pa(share: float, s: int, hardens: float, grows: float) -> float:
    return SLOPE * STROKE_M * (share + hardens * share**3) + s * F_C * (1 + grows * share)


def balance(hardens: float, grows: float) -> Balance:
    """What the landings of a staircase say of a valve."""
    landings = [
        SlideOutcome(0.0, s, (x - 0.1 * s) * STROKE_M, landing_pa(x, s, hardens, grows), x * STROKE_M, 1e-6, True, True)
        for x in np.linspace(0.2, 0.85, 10)
        for s in (1, -1)
    ]
    return Balance(Ratios(*_ratios(landings)), landings, (), STROKE_M)


def _ratios(landings: list[SlideOutcome]) -> tuple[float, float, float]:
    ratios = static_law(landings, STROKE_M).ratios
    return ratios.b_over_c, ratios.k_over_c, ratios.offset_pa


def true_ratio(hardens: float, grows: float, from_: float, to: float) -> float:
    """By what (F_s - F_c)/k_s grows from one share of the stroke to another."""
    at = [(1 + grows * x) / (1 + 3 * hardens * x**2) for x in (from_, to)]
    return at[1] / at[0]


KNOWN = Margins(*(Margin(1.0e-3, 1.1e-3) for _ in range(4)))


@pytest.mark.parametrize(("hardens", "grows"), [(HARDENS, 0.0), (0.0, GROWS), (HARDENS, GROWS), (0.0, 0.0)])
def test_margins_go_as_friction_over_the_slope(hardens: float, grows: float) -> None:
    known = SlideMemory(margins=KNOWN, margins_at_m=0.3 * STROKE_M)
    there = with_margins_at(known, 0.8 * STROKE_M, balance(hardens, grows)).margins
    expected = true_ratio(hardens, grows, 0.3, 0.8)
    for margin in there.all:
        assert margin.broke_m / 1.1e-3 == pytest.approx(expected, rel=0.03)
        assert margin.held_m / 1.0e-3 == pytest.approx(expected, rel=0.03)


def test_what_a_packing_gives_way_goes_with_friction_alone() -> None:
    """Going on takes 1 mm, turning 3: a spring that stiffens changes the one, not the rest of the other."""
    soft = replace(KNOWN, turning_up=Margin(2.9e-3, 3.0e-3))
    there = with_margins_at(
        SlideMemory(margins=soft, margins_at_m=0.3 * STROKE_M), 0.8 * STROKE_M, balance(HARDENS, 0.0)
    )
    going_on = true_ratio(HARDENS, 0.0, 0.3, 0.8)
    assert there.margins.turning_up.broke_m == pytest.approx(3.0e-3 - 1.1e-3 * (1.0 - going_on), rel=0.02)


@pytest.mark.parametrize(("hardens", "grows"), [(HARDENS, 0.0), (0.0, 2 * GROWS)])
def test_play_is_the_same_everywhere(hardens: float, grows: float) -> None:
    """Going on takes 2 mm, turning 1.2, for 0.8 mm of play are taken up."""
    played = Margins(Margin(1.98e-3, 2e-3), Margin(1.98e-3, 2e-3), Margin(1.19e-3, 1.2e-3), Margin(1.19e-3, 1.2e-3))
    memory = SlideMemory(margins=played, margins_at_m=0.3 * STROKE_M)
    there = with_margins_at(memory, 0.6 * STROKE_M, balance(hardens, grows)).margins
    assert there.turning_up.broke_m == pytest.approx(2e-3 * true_ratio(hardens, grows, 0.3, 0.6) - 0.8e-3, rel=0.05)


def test_margins_come_back_with_the_reference_and_so_do_those_before_slides_that_held() -> None:
    doubted = replace(KNOWN, onward_up=Margin(1.0e-3, 1.1e-3, held_before_m=0.8e-3))
    known = SlideMemory(margins=doubted, margins_at_m=0.3 * STROKE_M, held=Held(1, doubted))
    bent = balance(HARDENS, GROWS)
    there = with_margins_at(known, 0.8 * STROKE_M, bent)
    believed_m = there.margins.onward_up.held_before_m
    assert believed_m == pytest.approx(0.8 * there.margins.onward_up.held_m)
    assert there.held.margins == there.margins
    back = with_margins_at(there, 0.3 * STROKE_M, bent)
    for now, before in zip(back.margins.all, doubted.all, strict=True):
        assert (now.held_m, now.broke_m) == pytest.approx((before.held_m, before.broke_m))


def test_where_none_is_known_none_is_made_up() -> None:
    memory = with_margins_at(SlideMemory(margins_at_m=0.3 * STROKE_M), 0.8 * STROKE_M, balance(HARDENS, 0.0))
    assert memory.margins is NO_MARGINS
    guessed = Margins(Margin(broke_m=1e-3, guessed=True), Margin(), Margin(), Margin())
    there = with_margins_at(replace(memory, margins=guessed), 0.3 * STROKE_M, balance(HARDENS, 0.0)).margins
    assert there.onward_up.guessed
    assert (there.turning_up.held_m, there.turning_up.broke_m) == (0.0, 0.0)
