"""No test leaves its window by more than its declared margin, whatever happens; and where the valve is after it.

Faults of the device, of the DCS and of whoever tests are drawn, at any moment of a partial stroke, a continuous stroke
or small steps; so is what `[safety]` does on a fault.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from config.codes import ExperimentState, Fault, Mode
from config.slave_file import DeviceFault, Initial
from positioner.control.settings import Settings
from positioner.tests_on_the_valve import continuous_stroke, partial_stroke, small_steps
from positioner.tests_on_the_valve.program import Program
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
    def by(cls, seed: int) -> "Drawn":
        draw = np.random.default_rng(seed)
        what = str(draw.choice(DEVICE + PEOPLE))
        at_s, opening = float(draw.uniform(0.2, 16.0)), float(draw.uniform(0.15, 0.85))
        return cls(what, at_s, opening, str(draw.choice(TESTS)), str(draw.choice(list(ENDS_AT_PA))))

    @property
    def faults(self) -> tuple[DeviceFault, ...]:
        if self.what not in DEVICE:
            return ()
        own = {"jump": {"by_m": JUMP_M}, "drift": {"by_m": JUMP_M, "over_s": 5.0}, "supply": {"to_pa": 5e3}}
        return (DeviceFault(kind=self.what, at_s=self.at_s, **own.get(self.what, {})),)  # type: ignore[arg-type]


def asked_of(valve: VirtualValve, drawn: Drawn) -> tuple[Program, float]:
    """Return the program, and the band that it declares, m."""
    bounds, start_pa = Settings.of(valve.file).experiment, valve.command_pa()
    if drawn.test == "continuous":
        way = 1 if drawn.opening < 0.5 else -1
        asked = continuous_stroke.ContinuousStroke(rate=5e-3)
        program = continuous_stroke.programme(asked, bounds, start_pa, STROKE_M, way)
    elif drawn.test in ("steps", "narrow"):
        steps = small_steps.SmallSteps(840.0 / AREA_M2, 0.4, most=0.02 if drawn.test == "narrow" else 0.3)
        program = small_steps.programme(steps, bounds, start_pa, STROKE_M)
    else:
        wanted = partial_stroke.PartialStroke(fast=drawn.test == "fast")
        program = partial_stroke.programme(wanted, bounds, start_pa, valve.device.stem_m, STROKE_M)
    return program, program.band_m


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


def run(seed: int) -> None:
    drawn = Drawn.by(seed)
    file = daemon_file(experiment={"rate_limit_pa_per_s": RATE_PA_PER_S}, safety={"action": drawn.action})
    stem_m = drawn.opening * STROKE_M
    initial = Initial(position_m=stem_m, pressure_pa=20e3 + SLOPE * stem_m)
    valve = VirtualValve(TIGHT, file, initial=initial, faults=drawn.faults, noise=1e-4, seed=seed)
    program, band_m = asked_of(valve, drawn)
    held_pa, begun_m = valve.command_pa(), valve.device.stem_m
    farthest_m = 0.0
    turn: Callable[[], None] = valve.turn
    happened = drawn.what in DEVICE

    def watched() -> None:
        nonlocal farthest_m, happened
        if not happened and valve.cycle.snapshot.sample.now_s >= drawn.at_s:
            people(valve, drawn)
            happened = True
        turn()
        farthest_m = max(farthest_m, abs(valve.device.stem_m - begun_m))

    valve.turn = watched
    played = valve.play(program)
    speed = (RATE_PA_PER_S if drawn.test in ("fast", "steps", "narrow") else 140e3 / 60.0) / SLOPE
    lied_m = JUMP_M if drawn.what in ("jump", "drift") else 0.0
    if drawn.what == "supply":  # the air is gone: the spring closes it, whatever is commanded
        lied_m = begun_m
    margin_m = SLIP_M + COUNTED_S * speed + 6.0 * 1e-4 * STROKE_M
    assert farthest_m <= band_m + margin_m + lied_m, (seed, drawn, played.state.name)
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
            assert played.state.played or played.state is ExperimentState.BEYOND_BAND
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


@pytest.mark.long
def test_the_same_of_two_hundred() -> None:
    for seed in range(12, 212):
        run(seed)
