"""Lost replies while S3 finds the static law: a device that still holds what it was given has made the slide.

A valve behind a slow I/P slides and settles for many cycles of a fast loop. If every lost reply undid the slide, none
would ever be seen to its end.
"""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from config.codes import Mode, Quality
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from drivers.boundary import NoReply, Reading
from drivers.in_memory import MemoryDriver
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.virtual.virtual_cycle import lockstep_cycle, run_identification
from sim.slave.simulated_device import Device
from sim.valve import Valve

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
PERIOD_S, LAG_S = 0.005, 0.2
"""A slide and its rest take some 200 cycles."""
EVERY = 40
START_PA = 30e3
DAEMON = {
    "valve": {"stroke_m": STROKE_M},
    "cycle": {"pace": "device", "period_s": PERIOD_S},
    "excitation": {"kind": "staircase", "travel_window": (0.3, 0.9)},
}
SLAVE = {
    "clock": {"mode": "lockstep", "period_s": PERIOD_S},
    "sensor": {"noise_std_m": 1e-5, "seed": 1},
    "initial": {"pressure_pa": START_PA},
}


class Losing(MemoryDriver):
    """A driver that loses one reply in `EVERY`; the device obeys all the same."""

    exchanges = 0

    def exchange(self, command_pa: float) -> Reading:
        reading = super().exchange(command_pa)
        self.exchanges += 1
        if self.exchanges % EVERY == 0:
            raise NoReply("lost")
        return reading


def device() -> Device:
    lag = {"name": "ip_lag", "time_constant_s": LAG_S}
    valve = Valve.from_file(ValveFile.model_validate({"valve": VALVE.model_dump(), "effect": [lag]}))
    valve.rest_at(0.3 * STROKE_M, START_PA)
    return Device(valve, SlaveFile.model_validate(SLAVE), {})


def landings_of(driver: MemoryDriver) -> int:
    """Return how many landings the static law rests on when S3 ends."""
    cycle = lockstep_cycle(DaemonFile.model_validate(DAEMON), driver, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
    *_, last = run_identification(cycle, 60.0, wait=False)
    assert last.decision.applied.count == 1, last.decision.applied
    return last.decision.static_law.landings


@pytest.mark.long
def test_lost_replies_cost_no_landing() -> None:
    # One slide may be going when its command is changed in the very cycle that is lost.
    assert landings_of(Losing(device())) >= 0.8 * landings_of(MemoryDriver(device()))


class Slide:
    """A slide of half a second by command, as samples: the stem rests, follows the command and rests again."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.outcomes: list[SlideOutcome] = []
        update = StaticIdentification.update

        def seen(*args: object, **kwargs: object) -> SlideOutcome | None:
            outcome = update(*args, **kwargs)  # type: ignore[arg-type]
            self.outcomes += [] if outcome is None else [outcome]
            return outcome

        monkeypatch.setattr(StaticIdentification, "update", seen)
        self.controller = Controller(Settings.of(DaemonFile.model_validate(DAEMON)), START_PA)
        self.requests = Requests(mode=Mode.MANUAL, mode_writes=1, eta=QUIET)
        self.now_s, self.position_m = 0.0, 0.3 * STROKE_M

    def samples(self, seconds: float, towards_m: float) -> Iterator[Sample]:
        """Yield samples of a stem that goes somewhere with a lag."""
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.position_m += (towards_m - self.position_m) * PERIOD_S / LAG_S
            yield Sample(self.now_s, self.now_s, self.position_m, 0.0)

    def step(self, *samples: Sample) -> None:
        for sample in samples:
            self.controller.step(sample, self.requests)

    def found_anew(self, held_pa: float | None, unattended_s: float = 0.0) -> list[SlideOutcome]:
        """Return what is told of a slide at whose start a reply is lost and the device found anew, with a command."""
        here_m, there_m = 0.3 * STROKE_M, 0.5 * STROKE_M
        self.step(*self.samples(1.0, here_m))
        self.requests = replace(self.requests, manual_pa=60e3, manual_writes=1)
        self.step(*self.samples(PERIOD_S, here_m))
        self.step(*(sample._replace(quality=Quality.LOST) for sample in self.samples(PERIOD_S, here_m)))
        for sample in self.samples(PERIOD_S, here_m):
            self.step(sample._replace(held_pa=held_pa, unattended_s=unattended_s))
        self.step(*self.samples(3.0, there_m))
        return self.outcomes


@pytest.mark.parametrize("held_pa", [None, 60e3])
def test_a_device_that_holds_what_it_was_given_has_slid(held_pa: float | None, monkeypatch: pytest.MonkeyPatch) -> None:
    (slide,) = Slide(monkeypatch).found_anew(held_pa)
    assert slide.moved


def test_one_that_holds_the_command_before_has_yet_to_make_the_slide(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not Slide(monkeypatch).found_anew(START_PA)


def test_one_that_was_left_alone_may_have_done_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not Slide(monkeypatch).found_anew(60e3, unattended_s=2.0)
