"""No test leaves its window by more than its declared margin, whatever happens; and where the valve is after it.

Faults of the device, of the DCS and of whoever tests are drawn, at any moment of any test; so is what `[safety]` does
on a fault. Signature and commissioning go over the whole travel: they are broken off by a window inside it, too, and
their commands go no faster than they may.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from config.codes import ExperimentState, Fault, Mode, ValveTestVerdict
from config.slave_file import DeviceFault, Initial
from positioner.control.settings import Settings
from positioner.tests_on_the_valve import continuous_stroke, partial_stroke, signature, small_steps
from positioner.tests_on_the_valve.commissioning import commission
from positioner.tests_on_the_valve.program import Played, Program
from tests.tests_on_the_valve.virtual_valve import (
    AREA_M2,
    MAXIMUM_PA,
    PERIOD_S,
    SLOPE,
    STROKE_M,
    VirtualValve,
    daemon_file,
    told,
)

TIGHT = told(coulomb_n=400.0, static_n=440.0)
SLIP_M = 2.0 * 40.0 / 140e3
"""What a stem that breaks loose goes by itself."""
COUNTED_S = 4.0 * PERIOD_S
"""Until the median of five samples has seen it, and the command that answers is obeyed."""
RATE_PA_PER_S = 20e3
JUMP_M = 0.05 * STROKE_M
DEVICE = ("jump", "nan", "supply", "drift")
ENDS_AT_PA = {"hold": None, "vent": 0.0, "fill": MAXIMUM_PA}
"""What is commanded after a fault, by `[safety] action`; None: what was commanded before it."""
TESTS = ("partial", "fast", "continuous", "steps", "narrow")
"""Narrow: steps that go farther than their band, and are broken off by it."""
WHOLE = ("signature", "windowed", "commissioning")
"""Tests over the whole travel; windowed: a signature in a window inside it."""
WINDOW = (0.1, 0.9)
LIMIT_S = 100.0
"""Of a program of those over the whole travel: ramps as fast as they may be."""
PEOPLE = ("veto", "no consent", "hold", "nothing", "twice")


@dataclass(frozen=True)
class Drawn:
    """What happens, when, where the stem was, and which test it is."""

    what: str
    at_s: float
    opening: float
    test: str
    action: str

    @classmethod
    def by(cls, seed: int, tests: Sequence[str], within_s: float) -> "Drawn":
        draw = np.random.default_rng(seed)
        what = str(draw.choice(DEVICE + PEOPLE))
        at_s, opening = float(draw.uniform(0.2, within_s)), float(draw.uniform(0.15, 0.85))
        return cls(what, at_s, opening, str(draw.choice(tests)), str(draw.choice(list(ENDS_AT_PA))))

    @property
    def window(self) -> tuple[float, float]:
        return WINDOW if self.test == "windowed" else (0.0, 1.0)

    @property
    def rate_pa_per_s(self) -> float:
        """Of the command, at the most."""
        return RATE_PA_PER_S if self.test in ("fast", "steps", "narrow", *WHOLE) else MAXIMUM_PA / 60.0

    @property
    def faults(self) -> tuple[DeviceFault, ...]:
        if self.what not in DEVICE:
            return ()
        own = {"jump": {"by_m": JUMP_M}, "drift": {"by_m": JUMP_M, "over_s": 5.0}, "supply": {"to_pa": 5e3}}
        return (DeviceFault(kind=self.what, at_s=self.at_s, **own.get(self.what, {})),)  # type: ignore[arg-type]


def programs_of(valve: VirtualValve, drawn: Drawn) -> tuple[Program, ...]:
    """Return the programs of a test."""
    bounds, start_pa = Settings.of(valve.file).experiment, valve.command_pa()
    if drawn.test in ("signature", "windowed"):
        return signature.programmes(bounds, start_pa)
    if drawn.test == "continuous":
        way = 1 if drawn.opening < 0.5 else -1
        asked = continuous_stroke.ContinuousStroke(rate=5e-3)
        return (continuous_stroke.programme(asked, bounds, start_pa, STROKE_M, way),)
    if drawn.test in ("steps", "narrow"):
        steps = small_steps.SmallSteps(840.0 / AREA_M2, 0.4, most=0.02 if drawn.test == "narrow" else 0.3)
        return (small_steps.programme(steps, bounds, start_pa, STROKE_M),)
    wanted = partial_stroke.PartialStroke(fast=drawn.test == "fast")
    return (partial_stroke.programme(wanted, bounds, start_pa, valve.device.stem_m, STROKE_M),)


class Watched(VirtualValve):
    """A valve to which something happens; what became of the last program, and how far the stem went."""

    played: Played

    def __init__(self, drawn: Drawn, seed: int) -> None:
        experiment = {"rate_limit_pa_per_s": RATE_PA_PER_S, "travel_window": drawn.window}
        if drawn.test in WHOLE:
            experiment |= {"limit_s": LIMIT_S}
        stem_m = drawn.opening * STROKE_M
        super().__init__(
            TIGHT,
            daemon_file(experiment=experiment, safety={"action": drawn.action}),
            initial=Initial(position_m=stem_m, pressure_pa=20e3 + SLOPE * stem_m),
            faults=drawn.faults,
            noise=1e-4,
            seed=seed,
        )
        self.drawn, self._to_come = drawn, drawn.what in PEOPLE
        self.lowest_m = self.highest_m = self.begun_m = self.device.stem_m
        self.fastest_pa_per_s = 0.0
        self.turn = self._turn

    def test(self) -> None:
        """Have the test done, as its command does it."""
        if self.drawn.test == "commissioning":
            commission(self, "FV-1", Settings.of(self.file).experiment)
            return
        for program in programs_of(self, self.drawn):
            if not self.play(program).state.played:
                return

    def play(self, program: Program) -> Played:
        self.band_m = program.band_m
        self.played = super().play(program)
        return self.played

    def _turn(self) -> None:
        if self._to_come and self.cycle.snapshot.sample.now_s >= self.drawn.at_s:
            people(self, self.drawn)
            self._to_come = False
        before_pa = self.command_pa()
        self.cycle.once()
        if self.cycle.snapshot.decision.experiment.commands:
            self.fastest_pa_per_s = max(self.fastest_pa_per_s, abs(self.command_pa() - before_pa) / PERIOD_S)
        self.lowest_m, self.highest_m = min(self.lowest_m, self.device.stem_m), max(self.highest_m, self.device.stem_m)


def people(valve: VirtualValve, drawn: Drawn) -> None:
    """Have people do what was drawn."""
    requests = valve.cycle.requests
    experiment = requests.experiment
    if drawn.what == "veto":
        requests = replace(requests, experiment=replace(experiment, vetoed=True))
    elif drawn.what == "no consent":
        requests = replace(requests, experiment=replace(experiment, consented=False))
    elif drawn.what == "hold":
        requests = replace(requests, mode=Mode.HOLD, mode_writes=requests.mode_writes + 1)
    elif drawn.what == "twice":
        requests = replace(requests, experiment=replace(experiment, starts=experiment.starts + 1))
    valve.cycle.requests = requests


def run(seed: int, tests: Sequence[str] = TESTS, within_s: float = 16.0) -> None:
    drawn = Drawn.by(seed, tests, within_s)
    valve = Watched(drawn, seed)
    held_pa = valve.command_pa()
    valve.test()
    played = valve.played
    lied_m = JUMP_M if drawn.what in ("jump", "drift") else 0.0
    if drawn.what == "supply":  # the air is gone: the spring closes it, whatever is commanded
        lied_m = valve.begun_m
    margin_m = SLIP_M + COUNTED_S * drawn.rate_pa_per_s / SLOPE + 6.0 * 1e-4 * STROKE_M
    low_m, high_m = (each * STROKE_M for each in drawn.window)
    if valve.band_m:
        low_m, high_m = valve.begun_m - valve.band_m, valve.begun_m + valve.band_m
    assert low_m - margin_m - lied_m <= valve.lowest_m, (seed, drawn, played.state.name)
    assert valve.highest_m <= high_m + margin_m + lied_m, (seed, drawn, played.state.name)
    if drawn.test in WHOLE:
        assert valve.fastest_pa_per_s <= 1.01 * RATE_PA_PER_S, (seed, drawn)
    decision = valve.cycle.snapshot.decision
    assert not decision.experiment.commands
    after_pa = valve.command_pa()
    if decision.fault is not Fault.NONE:
        assert (played.state, decision.mode) == (ExperimentState.FAULT, Mode.HOLD), (seed, drawn)
        ends_at_pa = ENDS_AT_PA[drawn.action]
        assert ends_at_pa in (None, after_pa), (seed, drawn, after_pa)
    elif drawn.what == "hold" and played.state is ExperimentState.NOT_AUTOMATIC:
        assert decision.mode is Mode.HOLD
        assert after_pa == held_pa, (seed, drawn)
    else:
        assert after_pa == held_pa, (seed, drawn, played.state.name)
        if drawn.what == "twice":
            assert played.state.played or played.broken_off == [ValveTestVerdict.TRAVEL_EXCEEDED]
    valve.watch(1.0)
    if valve.cycle.snapshot.decision.fault is decision.fault:  # none has come after the test
        assert valve.command_pa() == after_pa, "it stays where it is"
    if decision.fault is not Fault.NONE and drawn.action != "hold" and drawn.what != "supply":
        valve.watch(5.0)
        end_m = 0.0 if drawn.action == "vent" else STROKE_M
        assert valve.device.stem_m == pytest.approx(end_m, abs=1e-3 * STROKE_M), "as the safety table says"


@pytest.mark.parametrize("seed", range(12))
def test_whatever_happens_the_stem_stays_within_its_band_and_the_command_comes_back(seed: int) -> None:
    run(seed)


@pytest.mark.parametrize("seed", range(2))
def test_so_it_does_in_tests_over_the_whole_travel(seed: int) -> None:
    run(seed, WHOLE, 60.0)


@pytest.mark.long
def test_the_same_of_two_hundred() -> None:
    for seed in range(12, 212):
        run(seed)


@pytest.mark.long
def test_the_same_of_two_hundred_over_the_whole_travel() -> None:
    for seed in range(2, 202):
        run(seed, WHOLE, 120.0)
