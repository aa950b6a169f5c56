"""Margins over the travel: what slides have taught of them at one place, at another.

    m   = (F_s - F_c)/k_s                  of a slide that goes on:        as φ/κ over the travel (slide_balance.py)
    m'  = m + (F_s + F_c)/k_p - w          of one that turns round:        m' - m as φ where a packing gives way;
                                                                           play is the same everywhere

m' - m counts as far as it is seen: m is taken as near to m' as what held and what broke loose lets it be. The first
margins of an extended valve are its own.
"""

from dataclasses import replace
from math import isnan

from positioner.control.laws.slides.slide_balance import SURE, Balance
from positioner.control.laws.slides.slide_memory import SlideMemory
from positioner.estimation.landings.slide_margins import NO_MARGINS, Margin, Margins

SHRINKS = 0.25
"""Factor on a margin, at the least."""


def with_margins_at(memory: SlideMemory, reference_m: float, balance: Balance) -> SlideMemory:
    """Return the memory with the margins at a reference, m; what slides have taught of them stays."""
    if memory.margins_at_m == reference_m:
        return memory
    if isnan(memory.margins_at_m):
        margins = memory.margins if balance.valve is None else _of_valve(reference_m, balance)
        return replace(memory, margins=margins, margins_at_m=reference_m)
    margins = _moved(memory.margins, memory.margins_at_m, reference_m, balance)
    before = _moved(memory.held.margins, memory.margins_at_m, reference_m, balance)
    return replace(memory, margins=margins, held=replace(memory.held, margins=before), margins_at_m=reference_m)


def _of_valve(reference_m: float, balance: Balance) -> Margins:
    """Return the margins of an extended valve, of which none has been tried."""
    up_m, down_m = (balance.going_on_m(reference_m, s) for s in (1, -1))
    up, down = Margin(up_m / SURE, up_m), Margin(down_m / SURE, down_m)
    return Margins(up, down, up, down)


def _moved(margins: Margins, from_m: float, to_m: float, balance: Balance) -> Margins:
    """Return margins learnt at one place, m, at another."""
    if margins is NO_MARGINS:
        return margins
    grows = balance.friction_at_m(to_m) / balance.friction_at_m(from_m)
    for s in (1, -1):
        on, turns = margins.own(s, turning=False), margins.own(s, turning=True)
        by = balance.grows(from_m, to_m, s)
        margins = margins.replaced(s, on.times(by), turning=False)
        margins = margins.replaced(s, turns.times(_turning(on, turns, by, grows)), turning=True)
    return margins


def _turning(on: Margin, turns: Margin, by: float, grows: float) -> float:
    """Return by what factor the margin of turning round changes where that of going on does, and friction."""
    turns_m = turns.sure_m
    if not turns_m:
        return 1.0
    on_m = max(on.held_m, min(turns_m, on.broke_m or turns_m))
    rest_m = turns_m - on_m
    return max(SHRINKS, (on_m * by + rest_m * (grows if rest_m > 0.0 else 1.0)) / turns_m)
