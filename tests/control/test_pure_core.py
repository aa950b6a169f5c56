"""The control core is a function of what it is given; a memory that is copied is another one."""

from array import array
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import MethodType
from typing import Any

import numpy as np
import pytest

from config.codes import Mode, Quality
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from positioner.control.controller import first_memory, step
from positioner.control.controller_memory import ControllerMemory
from positioner.control.laws.slides.slide_law import SlideLaw
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.daemon.snapshot import Snapshot
from positioner.estimation.refiner import Refinement
from positioner.virtual.virtual_cycle import play_script, virtual_cycle
from sim.slave.slave import device_of
from tests.cases import few_always

STROKE_M = 0.1016
LAWS = {"seed": 44e3, "slides": 0.0}
"""With what alpha, Pa, each is identified: by a sine, or by slides, which ask for none."""
Inputs = Sequence[tuple[Sample, Requests]]
AHEAD, PERIOD_S = 60, 5e-3
ASKED = (0.3, 0.5, 0.52)
"""References, of the stroke: the law of slides goes to the last by two slides, so that it decides anew on its way."""


def daemon(law: str, **control: object) -> DaemonFile:
    known = {"b_over_c_pa_per_m": -7.9e5, "k_over_c_pa": -2.4e4}
    table = {
        "valve": {"stroke_m": STROKE_M},
        "cycle": {"pace": "device", "period_s": PERIOD_S},
        "control": {"law": law, **control},
    }
    return DaemonFile.model_validate({**table, "law": known})


@cache
def inputs(law: str) -> tuple[tuple[Sample, Requests], ...]:
    """A second of S3, then a step of the reference a second: all that the core is given of it."""
    slave = SlaveFile.model_validate(
        {"clock": {"mode": "lockstep", "period_s": PERIOD_S}, "sensor": {"noise_std_m": 1e-5}}
    )
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=LAWS[law], beta_pa=13e3, eta=(0, 0, 0))
    cycle = virtual_cycle(daemon(law), device_of(slave, shipped_valve("seed")), first)
    given = []

    def dcs(snapshot: Snapshot, requests: Requests) -> Requests:
        given.append((snapshot.sample, requests))
        if snapshot.sample.time_s < 1.0:
            return requests
        writes = int(snapshot.sample.time_s)
        return replace(requests, eta=QUIET, reference_m=ASKED[writes % 3] * STROKE_M, reference_writes=writes)

    for _ in play_script(cycle, dcs, 3.0):
        pass
    return tuple(given)


def decided(memory: ControllerMemory, settings: Settings, given: Inputs) -> tuple[ControllerMemory, str]:
    """Return the memory after inputs, and what was decided, to the last bit; NaN is itself."""
    decisions = []
    for sample, requests in given:
        memory, decision = step(memory, sample, requests, settings, Refinement())
        decisions.append(decision)
    return memory, repr(decisions[-AHEAD:])


def whole(thing: object) -> object:
    """Return all that a memory holds, to the last bit, as what can be compared."""
    if isinstance(thing, np.ndarray | array):
        return thing.tobytes()
    if isinstance(thing, Mapping):
        return [(key, whole(each)) for key, each in thing.items()]
    if isinstance(thing, list | tuple | deque):
        return [whole(each) for each in thing]
    if type(thing).__module__.startswith("positioner.estimation") and hasattr(thing, "__dict__"):
        return whole(vars(thing))
    return repr(thing) if not isinstance(thing, MethodType) else thing.__func__.__name__


def spoilt(given: Inputs, rng: np.random.Generator) -> Inputs:
    """Another future: lost replies, another position, a stem that jumps, a mode that is written."""
    return [
        (
            sample._replace(position_m=sample.position_m + rng.normal(0.0, 1e-3), quality=rng.choice(list(Quality))),
            replace(requests, eta=(0, 0, 0) if rng.random() < 0.2 else QUIET),
        )
        for sample, requests in given
    ]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", few_always(range(4)))
def test_the_same_memory_and_inputs_give_the_same_and_a_copy_leaves_no_trace(law: str, seed: int) -> None:
    settings, given, rng = Settings.of(daemon(law)), inputs(law), np.random.default_rng(seed)
    at = int(rng.integers(20, len(given) - AHEAD))
    before, _ = decided(first_memory(settings, 0.0), settings, given[:at])
    then, untouched = given[at : at + AHEAD], whole(before)
    after, once = decided(before.copied(), settings, then)
    _, other = decided(before.copied(), settings, spoilt(then, rng))
    assert whole(before) == untouched
    assert whole(after) != untouched
    original, decisions = decided(before, settings, then)
    assert decisions == once != other
    assert whole(original) == whole(after)


def disturbed(given: Inputs, rng: np.random.Generator) -> Inputs:
    """What happens to a valve at rest now and then: replies lost, a push, a status, another mode, a writer, S3."""
    events: Sequence[Callable[[Sample, Requests], tuple[Sample, Requests]]] = (
        lambda sample, requests: (sample._replace(quality=Quality.LOST), requests),
        lambda sample, requests: (sample._replace(position_m=sample.position_m + 4e-3), requests),
        lambda sample, requests: (sample._replace(status=1), requests),
        lambda sample, requests: (sample._replace(held_pa=5e4, overwritten=True), requests),
        lambda sample, requests: (sample, replace(requests, mode=Mode.MANUAL, mode_writes=requests.mode_writes + 1)),
        lambda sample, requests: (sample, replace(requests, eta=(0, 0, 0))),
        lambda sample, requests: (sample, replace(requests, eta=(1, 0, 0))),
        lambda sample, requests: (sample, replace(requests, reference_m=0.31 * STROKE_M, reference_writes=99)),
    )
    told, left, event, ended = [], 0, events[0], 0
    for sample, asked in given:
        if not left and rng.random() < 0.02:
            left, event = int(rng.integers(1, 12)), events[int(rng.integers(len(events)))]
        requests = replace(asked, acknowledgements=ended, mode_writes=asked.mode_writes + ended)
        told.append(event(sample, requests) if left else (sample, requests))
        left, ended = max(0, left - 1), ended + (left == 1)
    return told


def planning_anew(memory: ControllerMemory) -> ControllerMemory:
    """Return a memory by which nothing stands that was decided, or planned by the law, before."""
    law = replace(memory.law, planned=None) if isinstance(memory.law, SlideLaw) else memory.law
    return memory._replace(stands_for=None, law=law)


@pytest.mark.parametrize("control", [{"law": "seed"}, {"law": "slides"}, {"law": "slides", "excursion_limit": 0.01}])
@pytest.mark.parametrize("seed", few_always(range(4)))
def test_a_decision_that_stands_is_the_one_that_would_be_made_anew(control: dict[str, Any], seed: int) -> None:
    settings = Settings.of(daemon(**control))
    given = disturbed(inputs(control["law"]), np.random.default_rng(seed))
    stood, memory, anew = 0, first_memory(settings, 0.0), first_memory(settings, 0.0)
    kept = Requests()
    for sample, asked in given:
        requests = kept = kept if kept == asked else asked  # a DCS writes when something changes
        stood += memory.stands_for is requests
        memory, decision = step(memory, sample, requests, settings)
        anew, again = step(planning_anew(anew), sample, requests, settings)
        assert repr(decision) == repr(again)
    assert whole(planning_anew(memory)) == whole(planning_anew(anew))
    assert stood > 50
