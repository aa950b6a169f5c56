"""What a staircase leaves, whatever ends it: the static law, or the reason that it has none; no other estimator's."""

from collections.abc import Callable
from dataclasses import replace
from math import inf

import pytest

from config.codes import Mode, Refusal, State
from positioner.control.requests import QUIET
from tests.control.test_frozen_staircase import Frozen

PERIOD_S = 0.1
Ending = Callable[[Frozen], None]


def ask(valve: Frozen, *etas: tuple[int, int, int]) -> None:
    """Write eta, each for two cycles."""
    for eta in etas:
        valve.cycle.requests = replace(valve.cycle.requests, eta=eta)
        valve.cycle.once()
        valve.cycle.once()


def by_mode(valve: Frozen) -> None:
    """The mode falls to hold, as it does on a fault; the switches are turned off afterwards."""
    writes = valve.cycle.requests.mode_writes + 1
    valve.cycle.requests = replace(valve.cycle.requests, mode=Mode.HOLD, mode_writes=writes)
    valve.until(valve.cycle.snapshot.sample.now_s + 2.0)
    ask(valve, QUIET)


def at_once(valve: Frozen) -> None:
    ask(valve, QUIET)


def singly(valve: Frozen) -> None:
    ask(valve, (1, 0, 0), (1, 1, 0), QUIET)


@pytest.fixture
def valve() -> Frozen:
    return Frozen(PERIOD_S, inf)


@pytest.mark.parametrize("end", [by_mode, at_once, singly])
def test_a_complete_staircase_is_applied_whatever_ends_it(valve: Frozen, end: Ending) -> None:
    valve.until(300.0, s3=True)
    assert valve.decision.progress == 1.0
    end(valve)
    applied = valve.decision.applied
    assert (applied.count, applied.refusals, applied.last_refusal) == (1, 0, Refusal.VALID)
    assert applied.ratios == valve.decision.static_law.ratios


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (by_mode, Refusal.BROKEN_OFF),
        (at_once, Refusal.LANDINGS_TOO_FEW),
        (singly, Refusal.LANDINGS_TOO_FEW),
    ],
)
def test_one_that_is_broken_off_says_why_it_has_none(valve: Frozen, end: Ending, reason: Refusal) -> None:
    """The stem has moved for seconds by then: that it has not, as the estimator of motions says, is no reason."""
    valve.until(18.0)
    assert valve.decision.state is State.S3_IDENTIFY
    assert valve.decision.static_law.landings > 2
    end(valve)
    applied = valve.decision.applied
    assert (applied.count, applied.refusals, applied.last_refusal) == (0, 1, reason)


def test_nor_is_a_law_applied_that_a_frozen_sensor_broke_off() -> None:
    valve = Frozen(PERIOD_S, 36.0)
    valve.until(300.0, s3=True)
    assert valve.decision.static_law.landings > 8
    applied = valve.decision.applied
    assert (applied.count, applied.refusals, applied.last_refusal) == (0, 1, Refusal.BROKEN_OFF)
    ask(valve, QUIET)
    assert valve.decision.applied == applied
